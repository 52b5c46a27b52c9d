"""`JointAxis`: location and direction of a joint, at the tip or as its share in each mode."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from millfrf.core import Complex, DegreeOfFreedom, InputError, Real
from modal_fit import ModalModel

TURN_STEP = 0.02
"""Angle that one unit of an axis' coordinate stands for in a fit, rad."""


@dataclass(frozen=True)
class ModalScales:
    """What one unit of a mode's part in a joint stands for.

    A mode has one part where its shape is real. A structure whose damping is not proportional has complex modes, and
    then each has two parts: one in phase with its scale, one that leads it by a quarter of a turn.

    Parameters
    ----------
    seen : (n_parts,)
        Deflection of the joint per unit of each modal coordinate, in the unit of the model's right vectors: one number
        for each mode, or these and behind them the same times i.
    pushed : (n_parts,)
        Force on each modal coordinate per unit of the joint's force, in the unit of the model's left vectors, likewise.
    """

    seen: Complex
    pushed: Complex

    def with_phases(self) -> "ModalScales":
        """Scales for two parts of each mode, from those for one."""
        return ModalScales(np.append(self.seen, 1j * self.seen), np.append(self.pushed, 1j * self.pushed))


@dataclass(frozen=True)
class JointAxis:
    """The axis of a joint: its deflection is one combination of motions, and its force acts along the same.

    Parameters
    ----------
    entries : (n_entries,)
        Unit vector: over the axes that forces and responses share (:func:`tip_axes`), or over the parts of the modes.
    scales
        What the entries are counted in where they belong to modes; None for a direction at the tip.
    """

    entries: Real
    scales: ModalScales | None = None

    @property
    def phased(self) -> bool:
        """Whether each mode has two parts."""
        if self.scales is None or len(self.entries) % 2:
            return False
        ahead, behind = np.split(self.scales.seen, 2)
        return bool(np.allclose(behind, 1j * ahead, rtol=1e-9, atol=0.0))

    @property
    def turns(self) -> Real:
        """Change of the entries by a unit of each angle, (n_entries, n_entries - 1)."""
        return TURN_STEP * across(self.entries)

    def turned(self, angles: Real) -> "JointAxis":
        """The axis turned by angles (n_entries - 1,), counted in :data:`TURN_STEP`."""
        turned = self.entries + self.turns @ angles
        return replace(self, entries=turned / np.linalg.norm(turned))

    @property
    def out_of_phase(self) -> float:
        """``sum_r |Im a_r^2| / sum_r |a_r|^2`` of the parts a_r: 0 where none leads, 1 where all lead like dampers."""
        if not self.phased:
            return 0.0
        ahead, behind = np.split(self.entries, 2)
        return float(np.sum(np.abs(2 * ahead * behind)) / np.sum(self.entries**2))

    @property
    def common_lead(self) -> float:
        """Phase that the parts share, rad: half that of the sum of their squares. At an eighth of a turn a spring with
        it is a damper.
        """
        if not self.phased:
            return 0.0
        ahead, behind = np.split(self.entries, 2)
        return float(0.5 * np.angle(np.sum((ahead + 1j * behind) ** 2)))

    def with_phases(self) -> "JointAxis":
        """The axis with a second part for each mode, a quarter of a turn ahead of the first, which is none yet."""
        assert self.scales is not None
        return JointAxis(np.append(self.entries, np.zeros_like(self.entries)), self.scales.with_phases())

    def parts(self, modes: int) -> Complex:
        """Part of each mode (n_modes,) as a complex number, counted in its scale; real where it has one part."""
        rows = self.entries.reshape(-1, modes)
        return np.asarray(rows[0] + 1j * rows[1] if len(rows) > 1 else rows[0] + 0j)

    def turned_over(self, mode: int, modes: int) -> "JointAxis":
        """The axis in which one of ``modes`` takes part with the other sign."""
        rows = self.entries.reshape(-1, modes).copy()
        rows[:, mode] *= -1
        return replace(self, entries=rows.ravel())

    def with_mode(self, scales: ModalScales, modes: int) -> "JointAxis":
        """The axis in a model with one more mode than ``modes``, which takes no part yet.

        The last entries of ``scales`` are that mode's.
        """
        if self.scales is None:
            return self
        phased = len(self.entries) > modes
        seen, pushed = (
            np.append(values[:modes], last) for values, last in zip(self._values(), _last(scales), strict=True)
        )
        own = ModalScales(seen, pushed)
        entries = np.append(self.entries.reshape(-1, modes), np.zeros((2 if phased else 1, 1)), axis=1).ravel()
        return JointAxis(entries, own.with_phases() if phased else own)

    def without_mode(self, place: int, modes: int) -> "JointAxis":
        """The axis in a model without one of ``modes``."""
        if self.scales is None:
            return self
        kept = np.delete(self.entries.reshape(-1, modes), place, axis=1).ravel()
        seen, pushed = (np.delete(one.reshape(-1, modes), place, axis=1).ravel() for one in self._values())
        size = float(np.linalg.norm(kept))
        return JointAxis(kept / size if size else np.eye(len(kept))[0], ModalScales(seen, pushed))

    def _values(self) -> tuple[Complex, Complex]:
        """Both scales of all parts."""
        assert self.scales is not None
        return self.scales.seen, self.scales.pushed


def _last(scales: ModalScales) -> tuple[complex, complex]:
    """Both scales of the last mode."""
    return complex(scales.seen[-1]), complex(scales.pushed[-1])


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


def axis_location(axis: JointAxis) -> dict[str, Any]:
    """Location of a joint in a file: ``direction``, or ``participation`` of each mode with its two scales."""
    entries = [float(x) for x in axis.entries]
    if axis.scales is None:
        return {"direction": entries}
    scales = {"seen": _pairs(axis.scales.seen), "pushed": _pairs(axis.scales.pushed)}
    return {"participation": entries, "scales": scales}


def axis_of(location: Mapping[str, Any]) -> JointAxis | None:
    """The axis that a location holds; None where it is that of no joint.

    Raises
    ------
    KeyError, TypeError, ValueError
        The location is incomplete.
    """
    if "direction" in location:
        return JointAxis(np.array(location["direction"], dtype=float))
    if "participation" not in location:
        return None
    seen, pushed = (_numbers(location["scales"][name]) for name in ("seen", "pushed"))
    return JointAxis(np.array(location["participation"], dtype=float), ModalScales(seen, pushed))


def _pairs(numbers: Complex) -> list[list[float]]:
    return [[float(x.real), float(x.imag)] for x in numbers]


def _numbers(pairs: list[list[float]]) -> Complex:
    parts = np.array(pairs, dtype=float)
    return np.asarray(parts[:, 0] + 1j * parts[:, 1])


LEAST_PART = 0.1
"""Part of a mode below which it is not named."""


def joint_in_words(location: Mapping[str, Any], axes: Sequence[str] = ()) -> str:
    """The place of a joint as a sentence goes on; empty where a location is that of no joint.

    Parameters
    ----------
    location
        Location of a cause in a diagnosis.
    axes
        Axes over which a direction at the tip is counted; empty: they are not named.

    Examples
    --------
    >>> joint_in_words({"direction": [0.8, -0.6]}, ("X", "Y"))
    'along +0.800 X, -0.600 Y'
    >>> joint_in_words({"direction": [0.8, -0.6], "participation": []}, ("X", "Y"))
    'inside, nearly along +0.800 X, -0.600 Y'
    >>> parts = [{"mode_hz": 7.3, "part": 0.95}, {"mode_hz": 11.0, "part": -0.3}]
    >>> joint_in_words({"participation": parts})
    'inside: the mode at 7.3 Hz takes part with +0.95, that at 11 Hz with -0.30'
    >>> places = [{"place": "between WING and PAYLOAD along Z"}, {"place": "WING:+Z to ground"}]
    >>> joint_in_words({"participation": parts[:1], "places": places})
    'between WING and PAYLOAD along Z: the mode at 7.3 Hz takes part with +0.95 (or, as likely, WING:+Z to ground)'
    """
    places = [str(one["place"]) for one in location.get("places", ())]
    other = f" (or, as likely, {', or '.join(places[1:])})" if len(places) > 1 else ""
    if "direction" in location:
        named = list(axes) + [""] * (len(location["direction"]) - len(axes))
        parts = [f"{value:+.3f} {name}".rstrip() for value, name in zip(location["direction"], named, strict=False)]
        nearly = "inside, nearly " if "participation" in location else ""
        return f"{nearly}along " + ", ".join(parts) + other
    if "participation" not in location:
        return ""
    told = [one for one in location["participation"] if abs(one["part"]) >= LEAST_PART]
    said = [f"at {one['mode_hz']:.4g} Hz with {one['part']:+.2f}" for one in told]
    said[0] = said[0].replace(" Hz with", " Hz takes part with")
    return f"{places[0] if places else 'inside'}: the mode " + ", that ".join(said) + other
