"""`Hypothesis`: a modal model with deviations from the nominal one, and causes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real
from modal_fit import ModalModel

from ..joints.joint_axis import JointAxis, JointReach, combined_model, joint_reach, modal_scales
from ..joints.joint_law import (
    JointResponse,
    driven_force,
    joint_responses,
)
from ..physics.linear_causes import MissingMode
from ..physics.protocol import Chain, ChainPhysics
from .cause import Cause
from .modal_lines import closed_loop, displacement_at, line_products, receptance_at
from .model_shape import ModelShape

NEGLIGIBLE = 1e-8  # singular value of the first motion's slopes, relative to the largest, that has no effect


@dataclass(frozen=True)
class Hypothesis:
    """Modal parameters and causes, which together predict a recording.

    Parameters
    ----------
    shape
        Nominal model, and the laboratory errors in which deviations are counted.
    u : (shape.size,)
        Deviation from the nominal model in lab errors.
    causes
        Causes that were added to the model, in the order found.
    """

    shape: ModelShape
    u: Real
    causes: tuple[Cause, ...] = ()

    @cached_property
    def model(self) -> ModalModel:
        """The modal model at ``u``, without causes."""
        return self.shape.model(self.u)

    @cached_property
    def reach(self) -> JointReach:
        """The modal model at ``u``, and how each joint acts on it."""
        return self.reach_with()

    def reach_with(self, *more: JointAxis) -> JointReach:
        """Return the modal model at ``u``, and how each joint and further axes act on it."""
        return joint_reach(self.model, [*(cause.axis for cause in self.causes if cause.axis is not None), *more])

    @property
    def size(self) -> int:
        """Number of fitted numbers."""
        return self.shape.size + sum(cause.size for cause in self.causes)

    def with_cause(self, cause: Cause) -> "Hypothesis":
        """Return the hypothesis with one more cause, the last."""
        return replace(self, causes=(*self.causes, cause))

    def without(self, place: int) -> "Hypothesis":
        """Return the hypothesis without the cause with this index."""
        others = (*self.causes[:place], *self.causes[place + 1 :])
        if not isinstance(self.causes[place].physics, MissingMode):
            return replace(self, causes=others)
        added = sum(isinstance(cause.physics, MissingMode) for cause in self.causes[:place])
        shape, u = self.shape.without_mode(added, self.u)
        removed, modes = self.shape.nominal_modes + added, len(self.shape.nominal.poles)
        adapted = (
            cause if cause.axis is None else replace(cause, axis=cause.axis.without_mode(removed, modes))
            for cause in others
        )
        return Hypothesis(shape, u, tuple(adapted))

    def with_mode(self, pole: complex, right: Complex, left: Complex, physics: MissingMode) -> "Hypothesis":
        """Return the hypothesis with one more mode: pole in rad/s, vectors (n_responses,), (n_excitations,)."""
        shape = self.shape.with_mode(pole, right, left)
        own, outside = self.u[: self.shape.modal_size], self.u[self.shape.modal_size :]
        u = np.concatenate([own, np.zeros(shape.per_mode), outside])
        causes = self.causes
        if any(cause.axis is not None and cause.axis.scales is not None for cause in causes):
            scales, modes = modal_scales(shape.nominal), len(self.shape.nominal.poles)
            axes = (None if cause.axis is None else cause.axis.with_mode(scales, modes) for cause in causes)
            causes = tuple(replace(cause, axis=axis) for cause, axis in zip(causes, axes, strict=True))
        return Hypothesis(shape, u, (*causes, Cause(physics, np.zeros(0))))

    @property
    def nominal(self) -> "Hypothesis":
        """The nominal model without causes."""
        return Hypothesis(self.shape.bare, np.zeros(self.shape.bare.size))

    @property
    def laws(self) -> tuple[Cause, ...]:
        """Causes that are joint laws."""
        return tuple(cause for cause in self.causes if cause.axis is not None)

    @property
    def has_added_physics(self) -> bool:
        """Whether there is a cause that is not an added mode."""
        return any(not isinstance(cause.physics, MissingMode) for cause in self.causes)

    def with_causes(self, coordinates: Real) -> "Hypothesis":
        """Return the hypothesis with all causes at other coordinates."""
        moved, at = [], 0
        for cause in self.causes:
            moved.append(cause.moved(coordinates[at : at + cause.size]))
            at += cause.size
        return replace(self, causes=tuple(moved))

    def stepped(self, coordinates: Real) -> "Hypothesis":
        """Return the hypothesis with all causes at other coordinates, clipped to slightly beyond their limits."""
        moved = self.with_causes(coordinates)
        return replace(self, causes=tuple(cause.stepped(cause.coordinates()) for cause in moved.causes))

    def blocked(self) -> Real:
        """Return for each coordinate of the causes whether a limit blocks it: 1 upwards, -1 downwards, 0 not."""
        return np.concatenate([np.zeros(0), *(cause.blocked() for cause in self.causes)])

    def difference_steps(self) -> Real:
        """Return steps of the coordinates of the causes for difference quotients, away from a near limit."""
        return np.concatenate([np.zeros(0), *(cause.difference_steps() for cause in self.causes)])

    def coordinates(self) -> Real:
        """Return the coordinates of all causes."""
        return np.concatenate([np.zeros(0), *(cause.coordinates() for cause in self.causes)])


@dataclass(frozen=True)
class Surround:
    """Matrices of all linear causes at given lines: response C, force B and feedback K; None for a missing effect.

    With the receptance H, the displacement is ``X = (I + H K)^-1 H (B F - joint)``, and the measured response ``C X``.
    """

    response: Complex | None
    force: Complex | None
    feedback: Complex | None

    def pushed(self, force: Complex) -> Complex:
        """Return B F, (n_lines, n_excitations)."""
        return force if self.force is None else line_products(self.force, force)

    def closed(self, receptance: Complex) -> Complex:
        """Return ``(I + H K)^-1 H``; in H, the excitations on which joints act come last."""
        return receptance if self.feedback is None else closed_loop(receptance, self.feedback)

    def shown(self, displacement: Complex) -> Complex:
        """Return C X for a displacement X of the shape (n_lines, n_responses, ...)."""
        return displacement if self.response is None else line_products(self.response, displacement)


def surround(hypothesis: Hypothesis, frequencies: Real) -> Surround:
    """Return the matrices of all linear causes at frequencies (n,), Hz."""
    s = np.asarray(2j * np.pi * frequencies, dtype=complex)
    response, force, feedback = None, None, None
    for cause in hypothesis.causes:
        if cause.axis is None and isinstance(cause.physics, ChainPhysics):
            chain: Chain = cause.physics.chain(s, cause.values, cause.place, hypothesis.shape.nominal)
            if chain.response is not None:
                response = chain.response if response is None else line_products(chain.response, response)
            if chain.force is not None:
                force = chain.force if force is None else line_products(chain.force, force)
            if chain.feedback is not None:
                feedback = chain.feedback if feedback is None else feedback + chain.feedback
    return Surround(response, force, feedback)


@dataclass(frozen=True)
class Predicted:
    """Prediction of a hypothesis for one recording."""

    response: Complex  # windowed lines of the predicted responses, in their units, (n_lines, n_responses)
    # spectrum of the predicted responses over the whole record, ramped and padded, (n_padded_lines, n_responses)
    spectrum: Complex
    # spectrum of the forces of all joints on the excitations on which they act
    # (:class:`millfrf.mismatch.joints.joint_axis.JointReach`); they act on the structure with a minus sign,
    # (n_padded_lines, n_excitations), N
    joint: Complex
    joints: tuple[JointResponse, ...]  # force and motion of each joint, in the order of the causes
    # modal coordinates at the first sample, (n_modes,); None if the first motion has decayed before the compared part
    first: Complex | None = None
    # derivative of ``response`` by the estimated numbers of the first motion, relative to the size of each response,
    # (n_lines, n_responses, n_numbers)
    first_slopes: Complex | None = None
    first_ridge: float = 0.0  # weight of the squares of these numbers in their estimate

    @cached_property
    def taken_up_by_first_motion(self) -> Real:
        """Orthonormal basis of what the first motion can take up of the lines, relative to the size of each response.

        Real parts above imaginary parts, (2 * n_lines * n_responses, n_basis).
        """
        assert self.first_slopes is not None
        own = real_rows(self.first_slopes)
        with_ridge = np.vstack([own, np.sqrt(self.first_ridge) * np.eye(own.shape[1])])
        left, sizes, _ = np.linalg.svd(with_ridge, full_matrices=False)
        return np.asarray(left[: len(own), sizes > NEGLIGIBLE * sizes[0]])


def real_rows(lines: Complex) -> Real:
    """Return real parts above imaginary parts of lines (n_lines, n_responses, n_columns), a row for each."""
    return np.concatenate([lines.real, lines.imag]).reshape(-1, lines.shape[2])


def predicted_from(hypothesis: Hypothesis, lines: WindowedSpectrum, first: Complex | None = None) -> Predicted:
    """Return the response to the forces of a recording, cut and windowed like the measurement.

    ``first``: modal coordinates at the first sample, (n_modes,); None: the structure is at rest.
    """
    return DrivenStructure(hypothesis, lines).predicted(first)


@dataclass(frozen=True)
class DrivenStructure:
    """A hypothesis under the forces of a recording; the first motion and the joints' forces are superposed on these."""

    hypothesis: Hypothesis
    lines: WindowedSpectrum

    @cached_property
    def _around(self) -> Surround:
        return surround(self.hypothesis, self.lines.padded_frequencies)

    @cached_property
    def _by_recording(self) -> Complex:
        """Displacement of the responses, then of the joints, by these forces, (n_padded_lines, n + n_joints), m."""
        reach = self.hypothesis.reach
        force = np.pad(self._around.pushed(self.lines.force_lines), ((0, 0), (0, len(reach.paths))))
        return displacement_at(reach.reduced, self.lines.padded_frequencies, force)

    @cached_property
    def _between(self) -> ModalModel:
        """Model whose excitations are the forces of the joints."""
        model, joints = self.hypothesis.reach.reduced, len(self.hypothesis.reach.paths)
        own = combined_model(model, np.eye(len(model.responses)), np.eye(len(model.excitations))[:, -joints:])
        outside = own.residuals
        acts = outside is not None and (
            outside.upper.any() or outside.lower.any() or (outside.residues is not None and outside.residues.any())
        )
        return own if acts else replace(own, residuals=None)

    @cached_property
    def _pulse(self) -> Complex:
        return start_pulse(self.lines)

    @cached_property
    def _closed(self) -> Complex:
        """Receptance with the feedback of linear causes, (n_padded_lines, n_responses, n_excitations), m/N."""
        return self._around.closed(receptance_at(self.hypothesis.model, self.lines.padded_frequencies))

    def predicted(self, first: Complex | None = None) -> Predicted:
        """Return the response from a first motion with modal coordinates ``first``, (n_modes,); None: from rest."""
        hypothesis, lines, n = self.hypothesis, self.lines, len(self.hypothesis.model.responses)
        free = self._by_recording if first is None else self._by_recording + self._decay(first)
        joints = self._joints(free[:, n:]) if hypothesis.laws else ()
        displacement, reach = free[:, :n], hypothesis.reach
        # without joints, one broadcast zero saves memory
        joint_force: Complex = np.broadcast_to(
            np.zeros((), dtype=complex), (len(displacement), len(reach.model.excitations))
        )
        if joints:
            displacement = displacement - self._by_joints([answer.force for answer in joints])[:, :n]
            for path, answer in zip(reach.paths, joints, strict=True):
                joint_force = joint_force + answer.force[:, None] * path.push
        spectrum = self._shown(displacement)
        return Predicted(lines.cut(lines.signal(spectrum)), spectrum, joint_force, joints, first)

    def to_joints(self) -> list[Complex]:
        """Return the measured responses to a unit force of each joint, (n_padded_lines, n_responses)."""
        n, units = len(self.hypothesis.model.responses), np.eye(len(self.hypothesis.reach.paths))
        lines = np.ones(len(self.lines.padded_frequencies), dtype=complex)
        moved = [-self._by_joints([number * lines for number in unit])[:, :n] for unit in units]
        return [self._shown(displacement) for displacement in moved]

    def _shown(self, displacement: Complex) -> Complex:
        """Return the spectrum of the measured responses for a displacement, (n_padded_lines, n_responses)."""
        if self._around.feedback is not None:
            fed_back = line_products(self._around.feedback, displacement)
            displacement = displacement - line_products(self._closed, fed_back)
        return self._around.shown(displacement * self.lines.padded_kinematic)

    def _decay(self, first: Complex) -> Complex:
        """Return the displacement by the first motion, with the shape of ``_by_recording``."""
        model = with_excitation(replace(self.hypothesis.reach.reduced, residuals=None), first)
        force = np.zeros((len(self._pulse), len(model.excitations)), dtype=complex)
        force[:, -1] = self._pulse
        return displacement_at(model, self.lines.padded_frequencies, force)

    def _by_joints(self, forces: Sequence[Complex]) -> Complex:
        """Return the displacement by forces of all joints, each (n_padded_lines,), N, as in ``_by_recording``."""
        return displacement_at(self._between, self.lines.padded_frequencies, np.stack(forces, axis=1))

    def _joints(self, free: Complex) -> tuple[JointResponse, ...]:
        """Return force and motion of each joint, where ``free`` (n_padded_lines, n_joints) are their free deflections.

        Joints whose motion is given act on the others, which are simulated together.
        """
        hypothesis, lines = self.hypothesis, self.lines
        laws = [cause.law(lines.recording) for cause in hypothesis.laws]
        answers: dict[int, JointResponse] = {}
        for number, (cause, law) in enumerate(zip(hypothesis.laws, laws, strict=True)):
            if cause.seen is not None:
                x, v = cause.seen[lines.recording.name]
                answers[number] = JointResponse(scipy.fft.rfft(driven_force(lines, x, v, law), n=lines.padded), x, v)
        simulated = [number for number in range(len(laws)) if number not in answers]
        if simulated:
            if answers:
                rest = np.zeros(len(free), dtype=complex)
                forces = [answers[k].force if k in answers else rest for k in range(len(laws))]
                free = free - self._by_joints(forces)[:, -len(laws) :]
            ends, own = [hypothesis.reach.paths[k].ends for k in simulated], [laws[k] for k in simulated]
            motions = joint_responses(hypothesis.reach.model, lines, free[:, simulated], ends, own)
            answers |= dict(zip(simulated, motions, strict=True))
        return tuple(answers[number] for number in range(len(laws)))


def start_pulse(lines: WindowedSpectrum) -> Complex:
    """Return the spectrum (n_padded_lines,) of a pulse of 1 N s at the first samples.

    On a modal coordinate it acts like the unknown motion before the recording. Its spectrum falls towards half the
    sample rate, so that the motion between the samples does not oscillate.
    """
    turn = np.pi * np.arange(lines.padded // 2 + 1) / (lines.padded // 2)
    return np.asarray(lines.recording.rate * (0.5 + 0.5 * np.cos(turn)) * np.exp(-1j * turn))


def with_excitation(model: ModalModel, left: Complex) -> ModalModel:
    """Return a model with one more excitation, the last, that drives the modes with the factors ``left`` (n_modes,)."""
    residuals = model.residuals
    if residuals is not None:
        width = ((0, 0), (0, 1))
        residues = None if residuals.residues is None else np.pad(residuals.residues, ((0, 0), *width))
        residuals = replace(
            residuals, upper=np.pad(residuals.upper, width), lower=np.pad(residuals.lower, width), residues=residues
        )
    return replace(
        model,
        left=np.column_stack([model.left, left]),
        excitations=(*model.excitations, "START:+S"),
        residuals=residuals,
        covariance=None,
        errors=None,
    )


def line_response(hypothesis: Hypothesis, lines: WindowedSpectrum) -> Complex:
    """Return the response lines (n_lines, n_responses) of the linear part to the windowed forces.

    Leakage is neglected, so that the result is only used for derivatives.
    """
    around = surround(hypothesis, lines.frequencies)
    force = around.pushed(lines.force_here)
    if around.feedback is None:
        displacement = displacement_at(hypothesis.model, lines.frequencies, force)
    else:
        closed = around.closed(hypothesis.model.receptance(lines.frequencies))
        displacement = line_products(closed, force)
    return around.shown(displacement * lines.kinematic)
