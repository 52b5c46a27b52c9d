"""`JointAxis`: location and direction of a joint; `JointReach`: a modal model extended by joints without sensors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from estimation import quantities_of_unit
from millfrf.core import Complex, DegreeOfFreedom, InputError, Real
from modal_fit import ModalModel, Residuals

ANGLE_STEP = 0.02  # unit of the angles of an axis in a fit, rad


@dataclass(frozen=True)
class ModalScales:
    """Scales of the participations of the modes in a joint.

    A mode with a real shape has one participation, in phase with its scale. A complex mode, which occurs if damping is
    not proportional, has two participations: the second leads the scale by a quarter of a turn.
    """

    # deflection of the joint for a participation of 1 and a unit of the modal coordinate, in the unit of the model's
    # right vectors: one number for each mode, or these numbers followed by the numbers times i, (n_participations,)
    seen: Complex
    # force on the modal coordinate for a participation of 1 and a unit of the joint's force, in the unit of the model's
    # left vectors, in the same order, (n_participations,)
    pushed: Complex

    def with_phases(self) -> "ModalScales":
        """Return scales for two participations of each mode, if these scales are for one participation."""
        return ModalScales(np.append(self.seen, 1j * self.seen), np.append(self.pushed, 1j * self.pushed))


@dataclass(frozen=True)
class JointAxis:
    """Axis of a joint: the combination of motions that is its deflection, and along which its force acts."""

    # unit vector over the axes that forces and responses share (:func:`tip_axes`), or over the participations of the
    # modes, (n_entries,)
    entries: Real
    scales: ModalScales | None = None  # scales of the participations; None for a direction at the tip

    @property
    def phased(self) -> bool:
        """Whether each mode has two participations."""
        if self.scales is None or len(self.entries) % 2:
            return False
        first, second = np.split(self.scales.seen, 2)
        return bool(np.allclose(second, 1j * first, rtol=1e-9, atol=0.0))

    @property
    def angle_slopes(self) -> Real:
        """Derivative of the entries by each angle's coordinate, (n_entries, n_entries - 1)."""
        # the last right singular vectors of one row span its orthogonal complement
        return np.asarray(ANGLE_STEP * np.linalg.svd(self.entries[None, :])[2][1:].T)

    def rotated(self, angles: Real) -> "JointAxis":
        """Return the axis rotated by angles (n_entries - 1,), in units of :data:`ANGLE_STEP`."""
        entries = self.entries + self.angle_slopes @ angles
        return replace(self, entries=entries / np.linalg.norm(entries))

    @property
    def out_of_phase(self) -> float:
        """``sum_r |Im a_r^2| / sum_r |a_r|^2`` of the complex participations a_r: 0 if all are real."""
        if not self.phased:
            return 0.0
        first, second = np.split(self.entries, 2)
        return float(np.sum(np.abs(2 * first * second)) / np.sum(self.entries**2))

    @property
    def common_phase(self) -> float:
        """Common phase of the participations, rad: half the phase of the sum of their squares.

        With a common phase of an eighth of a turn, a spring acts as a damper.
        """
        if not self.phased:
            return 0.0
        first, second = np.split(self.entries, 2)
        return float(0.5 * np.angle(np.sum((first + 1j * second) ** 2)))

    def nearly_along(self, other: "JointAxis") -> bool:
        """Return whether the axis is closer to another axis than to a perpendicular one.

        Examples
        --------
        >>> first, second = JointAxis(np.array([1.0, 0.0])), JointAxis(np.array([0.6, -0.8]))
        >>> first.nearly_along(second), first.nearly_along(JointAxis(np.array([-0.8, 0.6])))
        (False, True)
        """
        if len(self.entries) != len(other.entries) or (self.scales is None) != (other.scales is None):
            return False
        return bool(2 * float(self.entries @ other.entries) ** 2 > 1.0)

    def with_phases(self) -> "JointAxis":
        """Return the axis with a second participation of each mode, which is initially zero."""
        assert self.scales is not None
        return JointAxis(np.append(self.entries, np.zeros_like(self.entries)), self.scales.with_phases())

    def participations(self, modes: int) -> Complex:
        """Return one complex participation for each mode, (n_modes,)."""
        rows = self.entries.reshape(-1, modes)
        return np.asarray(rows[0] + 1j * rows[1] if len(rows) > 1 else rows[0] + 0j)

    def with_flipped_sign(self, mode: int, modes: int) -> "JointAxis":
        """Return the axis in which the participation of one mode has the opposite sign."""
        rows = self.entries.reshape(-1, modes).copy()
        rows[:, mode] *= -1
        return replace(self, entries=rows.ravel())

    def with_mode(self, scales: ModalScales, modes: int) -> "JointAxis":
        """Return the axis in a model with one more mode than ``modes``, which does not participate yet.

        The last entries of ``scales`` are those of the new mode.
        """
        if self.scales is None:
            return self
        phased = len(self.entries) > modes
        extended = ModalScales(
            np.append(self.scales.seen[:modes], scales.seen[-1]),
            np.append(self.scales.pushed[:modes], scales.pushed[-1]),
        )
        entries = np.append(self.entries.reshape(-1, modes), np.zeros((2 if phased else 1, 1)), axis=1).ravel()
        return JointAxis(entries, extended.with_phases() if phased else extended)

    def without_mode(self, place: int, modes: int) -> "JointAxis":
        """Return the axis in a model without one of its modes."""
        if self.scales is None:
            return self
        entries = np.delete(self.entries.reshape(-1, modes), place, axis=1).ravel()
        seen = np.delete(self.scales.seen.reshape(-1, modes), place, axis=1).ravel()
        pushed = np.delete(self.scales.pushed.reshape(-1, modes), place, axis=1).ravel()
        size = float(np.linalg.norm(entries))
        return JointAxis(entries / size if size else np.eye(len(entries))[0], ModalScales(seen, pushed))


def tip_axes(model: ModalModel) -> tuple[Real, Real, tuple[str, ...]]:
    """Find the axes along which the model has both an excitation and a response.

    Along such axes the deflection and the force of a joint at the tip are known. If there are several responses along
    an axis, the response at the node of the excitation is used. Both are taken along the positive axis, regardless of
    the signs of their labels.

    The sign of a force is physical. That of another excitation is not: a base that accelerates along an axis pushes
    the mass against it, and a voltage pushes as its actuator is wired. Such an excitation is counted positive along the
    motion that it causes at 0 Hz, so that springs restore and dampers brake.

    Parameters
    ----------
    model
        Modal model with the labels of responses and excitations.

    Returns
    -------
    rows : (n_responses, n_axes)
        Matrix whose transpose takes the responses to the deflection along each axis.
    columns : (n_excitations, n_axes)
        Matrix from forces along the axes to the excitations.
    names
        Names of the axes, ``X`` ... ``RZ`` or ``S``; with the node (``J1:RZ``) where several nodes have the same axis.

    Raises
    ------
    InputError
        Responses and excitations share no axis.
    """
    responses = [DegreeOfFreedom.parse(label) for label in model.responses]
    excitations = [DegreeOfFreedom.parse(label) for label in model.excitations]
    pairs = []
    for column, force in enumerate(excitations):
        same_axis = [row for row, response in enumerate(responses) if response.axis == force.axis]
        same_node = [row for row in same_axis if responses[row].node == force.node]
        if same_axis:
            pairs.append(((same_node or same_axis)[0], column))
    if not pairs:
        raise InputError(f"responses {', '.join(model.responses)} share no axis with {', '.join(model.excitations)}")
    rows, columns = np.zeros((len(responses), len(pairs))), np.zeros((len(excitations), len(pairs)))
    for axis, (row, column) in enumerate(pairs):
        rows[row, axis], columns[column, axis] = responses[row].sign, excitations[column].sign
        columns[column, axis] *= _sign_of_drive(model, rows[:, axis], columns[:, axis])
    names = [excitations[column].axis for _, column in pairs]
    if len(set(names)) < len(names):
        names = [f"{excitations[column].node}:{name}" for (_, column), name in zip(pairs, names, strict=True)]
    return rows, columns, tuple(names)


def _sign_of_drive(model: ModalModel, along: Real, push: Real) -> float:
    """Return -1 if the excitation is no force, and at 0 Hz deflects the responses ``along`` in the negative sense."""
    if quantities_of_unit(model.unit)[1] in ("force", "moment"):
        return 1.0
    flexibility = -2 * float(np.sum((model.right @ along) * (model.left @ push) / model.poles).real)
    flexibility += 0.0 if model.residuals is None else float(along @ model.residuals.upper @ push)
    return -1.0 if flexibility < 0 else 1.0


def axis_location(axis: JointAxis) -> dict[str, Any]:
    """Return the location of an axis for a model file: ``direction``, or ``participation`` of each mode and scales."""
    entries = [float(x) for x in axis.entries]
    if axis.scales is None:
        return {"direction": entries}
    scales = {
        "seen": [[float(x.real), float(x.imag)] for x in axis.scales.seen],
        "pushed": [[float(x.real), float(x.imag)] for x in axis.scales.pushed],
    }
    return {"participation": entries, "scales": scales}


def axis_of(location: Mapping[str, Any]) -> JointAxis | None:
    """Return the axis that a location in a model file states; None if it is not the location of a joint."""
    if "direction" in location:
        return JointAxis(np.array(location["direction"], dtype=float))
    if "participation" not in location:
        return None
    pairs = (np.array(location["scales"][name], dtype=float) for name in ("seen", "pushed"))
    seen, pushed = (np.asarray(pair[:, 0] + 1j * pair[:, 1]) for pair in pairs)
    return JointAxis(np.array(location["participation"], dtype=float), ModalScales(seen, pushed))


def joint_in_words(location: Mapping[str, Any], axes: Sequence[str] = ()) -> str:
    """Describe the place of a joint in words; the text is empty if the location does not belong to a joint.

    Parameters
    ----------
    location
        Location of a cause in a diagnosis.
    axes
        Names of the axes of a direction at the tip; empty to leave them out.

    Examples
    --------
    >>> joint_in_words({"direction": [0.8, -0.6]}, ("X", "Y"))
    'along +0.800 X, -0.600 Y'
    >>> joint_in_words({"direction": [0.8, -0.6], "participation": []}, ("X", "Y"))
    'away from the tip, nearly along +0.800 X, -0.600 Y'
    >>> modes = [{"mode_hz": 7.3, "part": 0.95}, {"mode_hz": 11.0, "part": -0.3}]
    >>> joint_in_words({"participation": modes})
    'away from the tip: the mode at 7.3 Hz participates with +0.95, that at 11 Hz with -0.30'
    >>> places = [{"place": "between WING and PAYLOAD along Z"}, {"place": "WING:+Z to ground"}]
    >>> joint_in_words({"participation": modes[:1], "places": places})
    'between WING and PAYLOAD along Z: the mode at 7.3 Hz participates with +0.95 (equally likely: WING:+Z to ground)'
    """
    places = [str(entry["place"]) for entry in location.get("places", ())]
    others = f" (equally likely: {', or '.join(places[1:])})" if len(places) > 1 else ""
    if "direction" in location:
        names = list(axes) + [""] * (len(location["direction"]) - len(axes))
        entries = [f"{value:+.3f} {name}".rstrip() for value, name in zip(location["direction"], names, strict=False)]
        # a joint that was found at the tip and then moved away keeps its direction at the tip
        nearly = "away from the tip, nearly " if "participation" in location else ""
        return f"{nearly}along " + ", ".join(entries) + others
    if "participation" not in location:
        return ""
    modes = [mode for mode in location["participation"] if abs(mode["part"]) >= 0.1]  # smaller ones are left out
    texts = [f"at {mode['mode_hz']:.4g} Hz with {mode['part']:+.2f}" for mode in modes]
    texts[0] = texts[0].replace(" Hz with", " Hz participates with")
    return f"{places[0] if places else 'away from the tip'}: the mode " + ", that ".join(texts) + others


@dataclass(frozen=True)
class JointPath:
    """Path from a joint's axis to the degrees of freedom of an extended model.

    ``rows`` (n_responses, n_entries) is the matrix from the entries of the axis to the responses, and ``columns``
    (n_excitations, n_entries) the matrix from the entries to the excitations.
    """

    axis: JointAxis
    rows: Real
    columns: Real

    @property
    def along(self) -> Real:
        """Weights of the responses whose sum is the joint's deflection, (n_responses,)."""
        return np.asarray(self.rows @ self.axis.entries)

    @property
    def push(self) -> Real:
        """Forces on the excitations per unit of the joint's force, (n_excitations,)."""
        return np.asarray(self.columns @ self.axis.entries)

    @property
    def ends(self) -> tuple[Real, Real]:
        """Both :attr:`along` and :attr:`push`."""
        return self.along, self.push


@dataclass(frozen=True)
class JointReach:
    """Modal model extended for its joints, and the path of each joint.

    For a joint away from the tip, the model gets one more response and one more excitation for each participation of a
    mode. The joint can then be treated like a joint at the tip.
    """

    # model with these additional responses and excitations last; unchanged if all joints act at the tip
    model: ModalModel
    paths: tuple[JointPath, ...]  # path of each joint, in the order of the joints

    @cached_property
    def reduced(self) -> ModalModel:
        """Return the model with its original degrees of freedom, and one response and excitation for each joint.

        The response is the joint's deflection, and the excitation is the joint's force. A prediction needs no single
        participations, of which there may be many.
        """
        added = sum(len(path.axis.entries) for path in self.paths if path.axis.scales is not None)
        n, m = len(self.model.responses) - added, len(self.model.excitations) - added
        rows = np.hstack([np.eye(len(self.model.responses), n), *(path.along[:, None] for path in self.paths)])
        columns = np.hstack([np.eye(len(self.model.excitations), m), *(path.push[:, None] for path in self.paths)])
        return combined_model(self.model, rows, columns)

    def forces(self, force: Complex) -> Complex:
        """Extend forces (n_lines, n) on the model's own excitations by zeros to (n_lines, n_excitations)."""
        added = len(self.model.excitations) - force.shape[1]
        return np.pad(force, ((0, 0), (0, added))) if added else force


def joint_reach(model: ModalModel, axes: Sequence[JointAxis]) -> JointReach:
    """Extend the modal model of the linear structure for joints with these axes."""
    n, m, modes = len(model.responses), len(model.excitations), len(model.poles)
    scales = [axis.scales for axis in axes if axis.scales is not None]
    added = sum(len(scale.seen) for scale in scales)
    extended = model
    if scales:
        names = tuple(f"MODE {place % modes + 1}:+S" for place in range(added))
        extended = replace(
            model,
            right=np.hstack([model.right, *(_modal_entries(scale.seen, modes) for scale in scales)]),
            left=np.hstack([model.left, *(_modal_entries(scale.pushed, modes) for scale in scales)]),
            responses=(*model.responses, *names),
            excitations=(*model.excitations, *names),
            residuals=_extended_residuals(model, added),
            covariance=None,
        )
    paths, first = [], 0
    for axis in axes:
        if axis.scales is None:
            rows, columns, _ = tip_axes(model)
            paths.append(JointPath(axis, np.pad(rows, ((0, added), (0, 0))), np.pad(columns, ((0, added), (0, 0)))))
        else:
            count = len(axis.entries)
            rows, columns = (np.zeros((size + added, count)) for size in (n, m))
            rows[n + first : n + first + count] = columns[m + first : m + first + count] = np.eye(count)
            paths.append(JointPath(axis, rows, columns))
            first += count
    return JointReach(extended, tuple(paths))


def combined_model(model: ModalModel, rows: Real, columns: Real) -> ModalModel:
    """Return a model whose responses and excitations are combinations of the given model's.

    Each column of ``rows`` (n_responses, number of new responses) holds the weights of the responses in a new response.
    Each column of ``columns`` (n_excitations, number of new excitations) holds the forces on the excitations per unit
    of a new excitation.
    """
    residuals = model.residuals
    if residuals is not None:
        residues = None if residuals.residues is None else rows.T @ residuals.residues @ columns
        upper, lower = (rows.T @ matrix @ columns for matrix in (residuals.upper, residuals.lower))
        residuals = replace(residuals, upper=upper, lower=lower, residues=residues)
    return replace(
        model,
        right=model.right @ rows,
        left=model.left @ columns,
        responses=tuple(f"COMBINATION {k + 1}:+S" for k in range(rows.shape[1])),
        excitations=tuple(f"COMBINATION {k + 1}:+S" for k in range(columns.shape[1])),
        residuals=residuals,
        covariance=None,
        errors=None,
    )


def _modal_entries(scales: Complex, modes: int) -> Complex:
    """Return the entries (n_modes, n_participations) of the modes' vectors for scales (n_participations,)."""
    return np.hstack([np.diag(row) for row in scales.reshape(-1, modes)])


def _extended_residuals(model: ModalModel, added: int) -> Residuals | None:
    """Extend the residual terms by zeros, as modes outside the band do not participate in joints away from the tip."""
    own = model.residuals
    if own is None:
        return None
    width = ((0, added), (0, added))
    residues = None if own.residues is None else np.pad(own.residues, ((0, 0), *width))
    return replace(own, upper=np.pad(own.upper, width), lower=np.pad(own.lower, width), residues=residues)


def modal_scales(model: ModalModel) -> ModalScales:
    """Return scales with which the participation of a mode in a joint is one real number.

    A reciprocal structure with real mode shapes ``phi`` has residues ``phi_p phi_q / (2 i omega m)``. For each mode,
    the entries of the right and the left vector at a point are therefore one real number times a right and a left
    scale, whose product lags by a quarter of a turn in a passive structure. The magnitudes of the scales are the norms
    of the mode's vectors over the tip axes; their phases are fitted to both vectors.
    """
    rows, columns, _ = tip_axes(model)
    right, left = model.right @ rows, model.left @ columns
    seen, pushed = np.linalg.norm(right, axis=1), np.linalg.norm(left, axis=1)
    # squares do not depend on the sign of a vector, so that the phase is determined up to half a turn
    phase = np.exp(0.5j * np.angle(_doubled_phase(right) - np.conj(_doubled_phase(left))))
    return ModalScales(seen * phase, -1j * pushed * np.conj(phase))


def _doubled_phase(vectors: Complex) -> Complex:
    """Return complex numbers (n_modes,) of magnitude 1 with twice the mean phase of each vector, (n_modes, n)."""
    squares = np.sum(vectors**2, axis=1)
    return np.asarray(squares / np.maximum(np.abs(squares), 1e-300))


def axis_over_modes(model: ModalModel, axis: JointAxis) -> JointAxis:
    """Return the axis over the modes, with phases, that is closest to a direction at the tip in motion and force."""
    scales = modal_scales(model)
    rows, columns, _ = tip_axes(model)
    seen, pushed = model.right @ rows @ axis.entries / scales.seen, model.left @ columns @ axis.entries / scales.pushed
    participations = 0.5 * (seen + pushed)
    size = float(np.linalg.norm(participations))
    entries = np.append(participations.real, participations.imag) / size
    return JointAxis(entries, ModalScales(size * scales.seen, size * scales.pushed).with_phases())
