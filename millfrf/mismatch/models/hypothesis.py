"""A `Hypothesis`: a modal model with deviations from nominal and added causes."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real
from modal_fit import ModalModel

from ..joints.joint_axis import JointAxis
from ..joints.joint_law import JointLaw, JointMotion
from ..joints.joint_reach import JointReach, joint_reach, modal_scales
from ..joints.joint_simulation import JointResponse, driven_force, joint_response
from ..physics.protocol import Chain, ChainPhysics, JointPhysics, LimitedPhysics, ModePhysics, Physics
from .modal_lines import closed_loop, displacement_at, line_products, receptance_at
from .model_shape import ModelShape

ASIDE = 0.02
"""Step of a cause's coordinate for a difference quotient."""

BEYOND_LIMIT = 1e-4
"""Share by which a number may lie beyond its limit: enough to tell that it asks for more, and near the way back."""

LONGEST_STEP = 15.0
"""Largest change of a cause's coordinate in one step of a fit; one on a linear scale may also change by its half."""


@dataclass(frozen=True)
class Cause:
    """One cause at a place with its numbers.

    Parameters
    ----------
    physics
        The kind of cause, from the library.
    values : (n_parameters,)
        Numbers of the cause in SI units, in the order of ``physics.parameters``.
    place
        Place at which a linear cause sits; empty for a joint.
    axis
        Where a joint gives way; None for a linear cause.
    motion
        Sizes of the joint's motion in the trials; None for a linear cause.
    seen
        Deflection and velocity at each sample by recording's name: the law is then driven by them instead of being
        simulated freely. For approaching a solution only; what was measured leaks into the prediction.
    """

    physics: Physics
    values: Real
    place: str = ""
    axis: JointAxis | None = None
    motion: JointMotion | None = None
    seen: Mapping[str, tuple[Real, Real]] | None = None

    @property
    def size(self) -> int:
        """Numbers that are fitted: parameters, and angles of the axis."""
        return len(self.values) + (len(self.axis.entries) - 1 if self.axis is not None else 0)

    def coordinates(self) -> Real:
        """Coordinates that the fit starts from, (size,); angles are zero."""
        values = [p.to_fit(float(v)) for p, v in zip(self.physics.parameters, self.values, strict=True)]
        return np.array(values + [0.0] * (self.size - len(values)))

    def longest_steps(self) -> Real:
        """How far each coordinate may move in one step of a fit, (size,)."""
        numbers = zip(self.coordinates(), self.physics.parameters, strict=False)
        own = [max(LONGEST_STEP, 0.0 if p.logarithmic else 0.5 * abs(float(c))) for c, p in numbers]
        return np.array(own + [LONGEST_STEP] * (self.size - len(own)))

    def moved(self, coordinates: Real) -> "Cause":
        """The cause at other coordinates; angles turn the axis from where it was."""
        count = len(self.values)
        values = np.array(
            [p.from_fit(float(c)) for p, c in zip(self.physics.parameters, coordinates[:count], strict=True)]
        )
        axis = None if self.axis is None else self.axis.turned(coordinates[count:])
        return replace(self, values=values, axis=axis)

    def stepped(self, coordinates: Real) -> "Cause":
        """The cause at other coordinates, where a step leads: hardly beyond the limits within which numbers count."""
        there = self.moved(coordinates)
        held = held_values(there)
        margin = BEYOND_LIMIT * np.abs(held)
        return replace(there, values=np.clip(there.values, held - margin, held + margin))

    def blocked(self) -> Real:
        """Direction of each coordinate, (size,), in which a limit lies: 1 upwards, -1 downwards, 0 where none does."""
        result, here = np.zeros(self.size), self.coordinates()
        for k, parameter in enumerate(self.physics.parameters):
            for side in (-1.0, 1.0):
                aside = here[k] + side * ASIDE
                value = parameter.from_fit(float(aside))
                if isinstance(self.physics, LimitedPhysics):
                    values = self.values.copy()
                    values[k] = value
                    value = float(held_values(replace(self, values=values))[k])
                if abs(parameter.to_fit(value) - aside) > 0.1 * ASIDE:
                    result[k] = side
        return result

    def steps_aside(self) -> Real:
        """Steps of the coordinates, (size,), for difference quotients: away from a limit that is near."""
        return np.where(self.blocked() > 0, -ASIDE, ASIDE)

    def law(self) -> JointLaw:
        """Force law of a joint."""
        assert isinstance(self.physics, JointPhysics)
        assert self.motion is not None
        return self.physics.law(self.values, self.motion)


def location_of(axis: JointAxis, model: ModalModel) -> dict[str, Any]:
    """Location of a joint, as a diagnosis states it; the largest entry is positive.

    Parameters
    ----------
    axis
        Where the joint gives way.
    model
        Model in which it does, whose modes name what takes part.
    """
    if axis.scales is None:
        entries = axis.entries * np.sign(axis.entries[np.argmax(np.abs(axis.entries))])
        return {"direction": [round(float(x), 6) for x in entries]}
    parts = axis.parts(len(model.poles))
    largest = parts[np.argmax(np.abs(parts))]
    # the phase that all modes share is that of the whole, and says nothing
    parts = parts * np.sign(largest.real if largest.real else 1.0)
    frequencies = [round(float(frequency), 4) for frequency in model.natural_frequencies]
    told: list[dict[str, float]] = []
    for frequency, part in zip(frequencies, parts, strict=True):
        sign = -1.0 if part.real < 0 else 1.0
        one = {"mode_hz": frequency, "part": round(sign * float(abs(part)), 6)}
        if len(axis.entries) > len(parts):
            one["lead_deg"] = round(float(np.degrees(np.angle(sign * part))), 2)
        told.append(one)
    return {"participation": told}


def held_values(cause: Cause) -> Real:
    """The numbers that a law goes by, brought within what its name means."""
    if isinstance(cause.physics, LimitedPhysics) and cause.motion is not None:
        return cause.physics.held(cause.values, cause.motion)
    return cause.values


@dataclass(frozen=True)
class Hypothesis:
    """Modal parameters and causes: everything that predicts a recording.

    Parameters
    ----------
    shape
        Nominal model and the lab error that its numbers are counted in.
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
        """The modal model at ``u``, and how each joint and then more axes act on it."""
        return joint_reach(self.model, [*(cause.axis for cause in self.causes if cause.axis is not None), *more])

    @property
    def size(self) -> int:
        """Numbers that are fitted."""
        return self.shape.size + sum(cause.size for cause in self.causes)

    def with_cause(self, cause: Cause) -> "Hypothesis":
        """The hypothesis with one more cause, the last."""
        return replace(self, causes=(*self.causes, cause))

    def without(self, place: int) -> "Hypothesis":
        """The hypothesis without one of its causes; ``place`` counts them in the order found."""
        kept = (*self.causes[:place], *self.causes[place + 1 :])
        if not isinstance(self.causes[place].physics, ModePhysics):
            return replace(self, causes=kept)
        added = sum(isinstance(cause.physics, ModePhysics) for cause in self.causes[:place])
        shape, u = self.shape.without_mode(added, self.u)
        gone, modes = self.shape.believed + added, len(self.shape.nominal.poles)
        rested = (one if one.axis is None else replace(one, axis=one.axis.without_mode(gone, modes)) for one in kept)
        return Hypothesis(shape, u, tuple(rested))

    def with_mode(self, pole: complex, right: Complex, left: Complex, physics: ModePhysics) -> "Hypothesis":
        """The hypothesis with one more mode of ``physics``: pole in rad/s, vectors (n_responses,), (n_excitations,)."""
        shape = self.shape.with_mode(pole, right, left)
        own, outside = self.u[: self.shape.modal_size], self.u[self.shape.modal_size :]
        u = np.concatenate([own, np.zeros(shape.per_mode), outside])
        known = self.causes
        if any(cause.axis is not None and cause.axis.scales is not None for cause in known):
            scales, modes = modal_scales(shape.nominal), len(self.shape.nominal.poles)
            axes = (None if one.axis is None else one.axis.with_mode(scales, modes) for one in known)
            known = tuple(replace(one, axis=axis) for one, axis in zip(known, axes, strict=True))
        return Hypothesis(shape, u, (*known, Cause(physics, np.zeros(0))))

    @property
    def nominal(self) -> "Hypothesis":
        """The nominal model without causes."""
        return Hypothesis(self.shape.bare, np.zeros(self.shape.bare.size))

    @property
    def laws(self) -> tuple[Cause, ...]:
        """The causes that are laws of joints."""
        return tuple(cause for cause in self.causes if cause.axis is not None)

    @property
    def has_added_physics(self) -> bool:
        """Whether there is a cause beside added modes."""
        return any(not isinstance(cause.physics, ModePhysics) for cause in self.causes)

    def with_causes(self, coordinates: Real) -> "Hypothesis":
        """The hypothesis with all causes at other coordinates, one after the other."""
        moved, at = [], 0
        for cause in self.causes:
            moved.append(cause.moved(coordinates[at : at + cause.size]))
            at += cause.size
        return replace(self, causes=tuple(moved))

    def stepped(self, coordinates: Real) -> "Hypothesis":
        """The hypothesis with all causes where a step leads, hardly beyond their limits."""
        there = self.with_causes(coordinates)
        return replace(self, causes=tuple(one.stepped(one.coordinates()) for one in there.causes))

    def blocked(self) -> Real:
        """Direction of each coordinate of the causes in which a limit lies: 1 upwards, -1 downwards, else 0."""
        return np.concatenate([np.zeros(0), *(cause.blocked() for cause in self.causes)])

    def steps_aside(self) -> Real:
        """Steps of the causes' coordinates for difference quotients: away from a limit that is near."""
        return np.concatenate([np.zeros(0), *(cause.steps_aside() for cause in self.causes)])

    def coordinates(self) -> Real:
        """Coordinates of all causes."""
        return np.concatenate([np.zeros(0), *(cause.coordinates() for cause in self.causes)])


@dataclass(frozen=True)
class Surround:
    """All linear causes together at some lines: ``X = T H (B F - joint)``, measured ``C X``."""

    response: Complex | None
    force: Complex | None
    feedback: Complex | None

    def pushed(self, force: Complex) -> Complex:
        """B F, (n_lines, n_excitations)."""
        return force if self.force is None else line_products(self.force, force)

    def closed(self, receptance: Complex) -> Complex:
        """``(I + H K)^-1 H``; excitations behind those that K returns to are those of joints."""
        return receptance if self.feedback is None else closed_loop(receptance, self.feedback)

    def shown(self, displacement: Complex) -> Complex:
        """C X for (n_lines, n_responses, ...)."""
        return displacement if self.response is None else line_products(self.response, displacement)


def surround(hypothesis: Hypothesis, frequencies: Real) -> Surround:
    """Matrices of all linear causes at frequencies (n,), Hz."""
    s = np.asarray(2j * np.pi * frequencies, dtype=complex)
    response, force, feedback = None, None, None
    for cause in hypothesis.causes:
        if isinstance(cause.physics, ChainPhysics):
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
    """What a hypothesis gives for one recording.

    Parameters
    ----------
    response : (n_lines, n_responses)
        Windowed lines of the predicted responses, in the responses' units.
    spectrum : (n_padded_lines, n_responses)
        Spectrum of the predicted responses over the whole record, ramped and padded.
    joint : (n_padded_lines, n_excitations), N
        Spectrum of all joints' forces as their laws give them, on the excitations that they reach
        (:class:`millfrf.mismatch.joints.joint_reach.JointReach`); the structure feels them with a minus sign.
    joints
        Force and motion of each joint, in the order of the causes.
    """

    response: Complex
    spectrum: Complex
    joint: Complex
    joints: tuple[JointResponse, ...]


def predict_lines(hypothesis: Hypothesis, lines: WindowedSpectrum) -> Predicted:
    """Response of the whole hypothesis to a recording's forces, cut and windowed like the measurement."""
    reach, frequencies = hypothesis.reach, lines.padded_frequencies
    model, n = reach.reduced, len(hypothesis.model.responses)
    around = surround(hypothesis, frequencies)
    pushed = around.pushed(lines.force_lines)
    # one number stands for all where there is no joint
    joint: Complex = np.broadcast_to(np.zeros((), dtype=complex), (len(pushed), len(reach.model.excitations)))
    felt, joints = np.pad(pushed, ((0, 0), (0, len(reach.paths)))), []
    for number, (cause, path) in enumerate(zip(hypothesis.laws, reach.paths, strict=True)):
        if cause.seen is not None:
            x, v = cause.seen[lines.recording.name]
            answer = JointResponse(scipy.fft.rfft(driven_force(lines, x, v, cause.law()), n=lines.padded), x, v)
        else:
            free = displacement_at(model, frequencies, felt)[:, n + number]
            answer = joint_response(reach.model, lines, free, path.ends, cause.law())
        joints.append(answer)
        joint = joint + answer.force[:, None] * path.push
        felt[:, pushed.shape[1] + number] = -answer.force
    if around.feedback is None:
        displacement = displacement_at(model, frequencies, felt)[:, :n]
    else:
        displacement = line_products(around.closed(receptance_at(model, frequencies)[:, :n]), felt)
    spectrum = around.shown(displacement * lines.padded_kinematic)
    return Predicted(lines.cut(lines.signal(spectrum)), spectrum, joint, tuple(joints))


def line_response(hypothesis: Hypothesis, lines: WindowedSpectrum, joint: Complex | None = None) -> Complex:
    """Response lines (n_lines, n_responses) of the linear part to the windowed forces: for derivatives, no leakage.

    Parameters
    ----------
    hypothesis
        Hypothesis whose linear part answers; its joints are not simulated.
    lines
        Windowed spectrum of the recording.
    joint : (n_lines, n_excitations)
        Windowed lines of the joints' forces, or None.
    """
    around = surround(hypothesis, lines.frequencies)
    force = around.pushed(lines.force_here)
    if joint is not None:
        force = force - joint
    if around.feedback is None:
        displacement = displacement_at(hypothesis.model, lines.frequencies, force)
    else:
        closed = around.closed(hypothesis.model.receptance(lines.frequencies))
        displacement = line_products(closed, force)
    return around.shown(displacement * lines.kinematic)
