"""`JointAxis`: where a joint gives way, as a direction at the tip or as the part that each mode takes in it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from foundation import DegreeOfFreedom, InputError
from modal_fit import ModalModel

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

TURN_STEP = 0.02
"""Angle that one unit of an axis' coordinate stands for in a fit, rad."""


@dataclass(frozen=True)
class ModalScales:
    """What one unit of a mode's part in a joint stands for.

    Parameters
    ----------
    seen : (n_modes,)
        Deflection of the joint per unit of each modal coordinate, in the unit of the model's right vectors.
    pushed : (n_modes,)
        Force on each modal coordinate per unit of the joint's force, in the unit of the model's left vectors.
    """

    seen: Complex
    pushed: Complex


@dataclass(frozen=True)
class JointAxis:
    """The axis of a joint: its deflection is one combination of motions, and its force acts along the same.

    Parameters
    ----------
    entries : (n_entries,)
        Unit vector: over the axes that forces and responses share (:func:`tip_axes`), or over the modes.
    scales
        What the entries are counted in where they belong to modes; None for a direction at the tip.
    """

    entries: Real
    scales: ModalScales | None = None

    @property
    def turns(self) -> Real:
        """Change of the entries by a unit of each angle, (n_entries, n_entries - 1)."""
        return TURN_STEP * across(self.entries)

    def turned(self, angles: Real) -> "JointAxis":
        """The axis turned by angles (n_entries - 1,), counted in :data:`TURN_STEP`."""
        turned = self.entries + self.turns @ angles
        return replace(self, entries=turned / np.linalg.norm(turned))

    def with_mode(self, scales: ModalScales) -> "JointAxis":
        """The axis in a model with one more mode, which takes no part yet; ``scales`` (1,) are that mode's."""
        if self.scales is None:
            return self
        own = ModalScales(
            np.append(self.scales.seen, scales.seen[-1]), np.append(self.scales.pushed, scales.pushed[-1])
        )
        return JointAxis(np.append(self.entries, 0.0), own)

    def without_mode(self, place: int) -> "JointAxis":
        """The axis in a model without one of the modes."""
        if self.scales is None:
            return self
        kept = np.delete(self.entries, place)
        own = ModalScales(np.delete(self.scales.seen, place), np.delete(self.scales.pushed, place))
        size = float(np.linalg.norm(kept))
        return JointAxis(kept / size if size else np.eye(len(kept))[0], own)


def across(direction: Real) -> Real:
    """Orthonormal vectors across a direction, (n, n - 1)."""
    return np.asarray(np.linalg.svd(direction[None, :])[2][1:].T)


def tip_axes(model: ModalModel) -> tuple[Real, Real, tuple[str, ...]]:
    """The axes along which both forces and responses are known: where a joint's deflection and its force are seen.

    A response at the force's own node counts before one at another; a joint away from the tip is seen by the latter.
    Both are counted along the positive axis, whatever the sign of their labels.

    Returns
    -------
    rows : (n_responses, n_axes)
        Matrix from a direction to the responses that make up the deflection.
    columns : (n_excitations, n_axes)
        Matrix from a direction to the excitations that make up the force.
    names
        The axes, ``X`` ... ``RZ`` or ``S``.

    Raises
    ------
    InputError
        There are none.
    """
    responses = [DegreeOfFreedom.parse(label) for label in model.responses]
    excitations = [DegreeOfFreedom.parse(label) for label in model.excitations]
    pairs = []
    for column, force in enumerate(excitations):
        same = [row for row, response in enumerate(responses) if response.axis == force.axis]
        own = [row for row in same if responses[row].node == force.node]
        if same:
            pairs.append(((own or same)[0], column))
    if not pairs:
        raise InputError(f"responses {', '.join(model.responses)} share no axis with {', '.join(model.excitations)}")
    rows, columns = np.zeros((len(responses), len(pairs))), np.zeros((len(excitations), len(pairs)))
    for axis, (row, column) in enumerate(pairs):
        rows[row, axis], columns[column, axis] = responses[row].sign, excitations[column].sign
    return rows, columns, tuple(excitations[column].axis for _, column in pairs)
