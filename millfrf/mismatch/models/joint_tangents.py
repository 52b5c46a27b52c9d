"""Derivatives of the forces of joints by the fitted parameters, and their simulation."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import WholeSpectrum, WindowedSpectrum
from millfrf.core import Complex, Real

from ..joints.joint_axis import JointAxis, JointPath
from ..joints.joint_law import (
    JointResponse,
    LawSlopes,
    joint_dynamics,
    no_slopes,
    steps_per_sample,
    stiffness_ramp,
)
from ..joints.tangent_loops import tangent_run
from ..joints.time_loops import law_change_run
from .cause import Cause
from .driven_motion import DecayChange, DrivenChange, DrivenJoint, Driving, ForceChange, Signals, driven_change
from .hypothesis import Hypothesis, Predicted, start_pulse, surround


def given_motion_change(cause: Cause, lines: WindowedSpectrum, answer: JointResponse) -> Signals:
    """Return the derivative of a joint force by the numbers of its law at fixed motion, (n_samples, n_numbers), N."""
    law, n = cause.law(lines.recording), len(lines.recording.force)
    out, sticks = np.empty((n, cause.law_size), dtype=np.float32), np.empty((n, len(law.yields)), dtype=np.bool_)
    law_change_run(
        (answer.deflection[:n], answer.velocity[:n]),
        0,
        ((law.reach, law.speed), law.yields),
        (*cause.law_slopes(lines.recording).parts, 1 / (lines.recording.rate * lines.recording.duration)),
        (np.zeros(len(law.yields)), np.zeros(len(law.yields))),
        (sticks, out),
    )
    return out


# Changes of motion are computed up to this multiple of the upper end of the band, beyond the range of most recordings.
# Modes hardly move there, but the flexibility of modes outside the band matters for dry friction (at 3, a third is
# lost)
MAX_FREQUENCY_RATIO = 10.0

LARGEST = 1e30  # a larger derivative of a motion or force has diverged; near the limit of single precision


@dataclass(frozen=True)
class JointChange:
    """The force of a joint at the lines and its derivative; it acts on the structure with a minus sign."""

    push: Real  # forces on the excitations per unit of the joint force, (n_excitations,)
    turns: Real  # derivative of ``push`` by the joint's angles, (n_excitations, n_angles)
    angles: int  # column of the joint's first angle among all fitted numbers
    force: Complex  # windowed lines of the joint force g, (n_lines,), N
    change: Complex  # derivative of ``force`` by the fitted numbers from column ``first`` on, (n_lines, n_columns), N
    first: int  # first column of ``change`` among all fitted numbers


@dataclass(frozen=True)
class _Joint:
    """A joint cause, its action on the model, the slice of its numbers, and its predicted motion."""

    cause: Cause
    path: JointPath
    own: slice
    answer: JointResponse

    @property
    def axis(self) -> JointAxis:
        """Axis of the joint."""
        assert self.cause.axis is not None
        return self.cause.axis

    def weights(self, lines: WindowedSpectrum) -> Real:
        """Return the weights of the simulated instants around a sample in the change of the force at this sample."""
        oversampling = len(self.answer.deflection) // lines.padded
        weights = np.bartlett(2 * oversampling + 1)[1:-1]
        return np.asarray(weights / weights.sum())

    def smoothing(self, lines: WindowedSpectrum, frequencies: Real) -> Real:
        """Return the factor by which the weighted mean over instants changes signals at frequencies (n,), Hz.

        It is close to 1 in the band; derivatives whose leakage is neglected do without it.
        """
        if self.cause.seen is not None or not isinstance(lines, WholeSpectrum):
            return np.ones_like(frequencies)
        weights = self.weights(lines)
        instants = np.arange(len(weights)) - len(weights) // 2
        step = 2 / ((len(weights) + 1) * lines.recording.rate)
        return np.asarray(np.cos(2 * np.pi * step * np.outer(frequencies, instants)) @ weights)


def joint_changes(hypothesis: Hypothesis, lines: WindowedSpectrum, predicted: Predicted) -> tuple[JointChange, ...]:
    """Return the derivative of the windowed lines of the force of each joint by the fitted numbers.

    Modal parameters, the outer force and the other joints change the driven motion of a joint. The tangent simulation
    computes the resulting change of the joint force.
    """
    outer = _outer_change(hypothesis, lines, _count(lines, lines.frequencies[-1]))
    return _changes(hypothesis, lines, predicted, replace(outer, first=predicted.first))


def changes_by_decays(
    hypothesis: Hypothesis, lines: WindowedSpectrum, predicted: Predicted, units: Complex, highest: float
) -> tuple[JointChange, ...]:
    """Return the derivative of the windowed lines of the force of each joint by numbers of the first motion.

    ``units``: modal coordinates at the first sample for each number, (n_numbers, n_modes); ``highest``: highest
    compared frequency, Hz.
    """
    count = _count(lines, highest)
    decays = DecayChange(units, start_pulse(lines)[:count], np.eye(len(units)))
    return _changes(hypothesis, lines, predicted, Driving(lines.force_lines[:count], (), (decays,), own=False))


def _count(lines: WindowedSpectrum, highest: float) -> int:
    return int(np.sum(lines.padded_frequencies <= MAX_FREQUENCY_RATIO * highest))


def _changes(
    hypothesis: Hypothesis, lines: WindowedSpectrum, predicted: Predicted, outer: Driving
) -> tuple[JointChange, ...]:
    count = len(outer.force)
    forces = lines.cut(lines.signal(np.stack([answer.force for answer in predicted.joints], axis=1))).T
    joints = _joints_of(hypothesis, predicted)
    # derivatives whose leakage is neglected need no fine steps, and those by the first motion are right to 1 % without
    if not outer.own or not isinstance(lines, WholeSpectrum):
        model = hypothesis.reach.model
        joints = [replace(joint, answer=joint.answer.at_fewest_instants(model, lines)) for joint in joints]
    simulated = [joint.cause.seen is None for joint in joints]
    # each joint changes the motion of the others: all but the last answer again, to what later ones have changed
    again = [place for place in range(len(joints) - 1) if simulated[place]] if sum(simulated) > 1 else []
    order = [*range(len(joints)), *again]
    changes, moved = list[JointChange](), [list[ForceChange]() for _ in joints]
    for number, place in enumerate(order):
        joint, first_time = joints[place], number < len(joints)
        driving = _driving_of(outer, joints, place, moved[place], first_time) if simulated[place] else outer
        signals, mix, first = _force_change(hypothesis, lines, joint, driving)
        change = _mixed(lines.cut(signals) / joint.smoothing(lines, lines.frequencies)[:, None], mix)
        if first_time:
            angles, turns = joint.own.start + joint.cause.law_size, joint.path.columns @ joint.axis.angle_slopes
            force = np.ascontiguousarray(forces[place])
            changes.append(JointChange(joint.path.push, turns, angles, force, change, first))
        else:
            changes[place] = replace(changes[place], change=changes[place].change + change)
        moved[place] = []
        following = [other for other in set(order[number + 1 :]) if other != place and simulated[other]]
        if following:
            more = _moved_by(hypothesis, lines, joint, changes[place], (signals, mix), count)
            for other in following:
                moved[other] += more if first_time and outer.own else more[:1]
    return tuple(changes)


def _joints_of(hypothesis: Hypothesis, predicted: Predicted) -> list[_Joint]:
    """Return the joints of a hypothesis with their predicted motion, in the order of the causes."""
    joints, first_column = list[_Joint](), hypothesis.shape.size
    for cause in hypothesis.causes:
        own = slice(first_column, first_column + cause.size)
        first_column += cause.size
        if cause.axis is not None:
            joints.append(_Joint(cause, hypothesis.reach.paths[len(joints)], own, predicted.joints[len(joints)]))
    return joints


def _mixed(signals: NDArray[np.complexfloating], mix: Real | None) -> Complex:
    """Return the products (n, n_columns) of complex signals (n, n_signals) and a real matrix; None is the identity."""
    if mix is None:
        return signals.astype(complex)
    out = np.empty((len(signals), mix.shape[1]), dtype=complex)
    out.real, out.imag = signals.real @ mix, signals.imag @ mix
    return out


def _driving_of(
    outer: Driving, joints: Sequence[_Joint], place: int, moved: Sequence[ForceChange], first_time: bool
) -> Driving:
    """Return the forces that drive a joint: the outer force less the forces of all other joints; and their changes.

    ``moved`` are changes of the other joints' forces, to which it has not answered yet.
    """
    others = [joint for other, joint in enumerate(joints) if other != place]
    pushes = tuple((joint.answer.force[: len(outer.force)], joint.path.push) for joint in others)
    felt = outer.force - sum((force[:, None] * push for force, push in pushes), np.zeros_like(outer.force))
    changes = (*outer.moved, *moved) if first_time else tuple(moved)
    return Driving(felt, pushes, changes, first_time and outer.own, outer.first)


def _moved_by(
    hypothesis: Hypothesis,
    lines: WindowedSpectrum,
    joint: _Joint,
    change: JointChange,
    written: tuple[Signals, Real | None],
    count: int,
) -> tuple[ForceChange, ...]:
    """Return the changes of the force of a joint, up to ``count`` padded lines, which drive the other joints."""
    signals, mix = written
    if mix is None:
        mix = np.eye(signals.shape[1], hypothesis.size, change.first)
    spectra = scipy.fft.rfft(np.ascontiguousarray(signals.T), n=lines.padded, axis=1)[:, :count].T
    spectra /= joint.smoothing(lines, lines.padded_frequencies[:count])[:, None]
    angle_rows = np.eye(change.turns.shape[1], hypothesis.size, change.angles)
    turned = [
        ForceChange(-turn[:, None], joint.answer.force[:count, None], row[None])
        for turn, row in zip(change.turns.T, angle_rows, strict=True)
    ]
    return (ForceChange(-change.push[:, None], spectra, mix), *turned)


def _outer_change(hypothesis: Hypothesis, lines: WindowedSpectrum, count: int) -> Driving:
    """Return the outer force at padded lines, and its derivative by the numbers of linear causes."""
    frequencies, force = lines.padded_frequencies[:count], lines.force_lines[:count]
    forces = hypothesis.reach.forces
    outer = np.array(forces(surround(hypothesis, frequencies).pushed(force)))
    if all(cause.axis is not None for cause in hypothesis.causes):
        return Driving(outer, (), ())
    coordinates, first, steps = hypothesis.coordinates(), hypothesis.shape.size, hypothesis.difference_steps()
    moved, index = [], 0
    for cause in hypothesis.causes:
        for k in range(index, index + cause.size if cause.axis is None else index):
            perturbed = coordinates.copy()
            perturbed[k] += steps[k]
            pushed = surround(hypothesis.with_causes(perturbed), frequencies).pushed(force)
            change = (forces(pushed) - outer) / steps[k]
            if change.any():
                moved.append(ForceChange(change, None, np.eye(1, hypothesis.size, first + k)))
        index += cause.size
    return Driving(outer, (), tuple(moved))


def _force_change(
    hypothesis: Hypothesis, lines: WindowedSpectrum, joint: _Joint, driving: Driving
) -> tuple[Signals, Real | None, int]:
    """Return the derivative of the joint force g at the samples by the fitted numbers.

    The derivative is the product of signals (n_samples, n_signals) and a mix (n_signals, n_columns); without a mix each
    signal is a column. The third result is the first column among all fitted numbers.
    """
    cause, own, answer = joint.cause, joint.own, joint.answer
    if cause.seen is not None:
        if not driving.own:
            mix = driving.moved[0].mix
            return np.zeros((len(lines.recording.force), len(mix)), dtype=np.float32), mix, 0
        by_law = given_motion_change(cause, lines, answer)
        _require_finite(by_law, f"the force of {cause.physics.name} diverges in the simulation")
        return by_law, None, own.start
    oversampling = len(answer.deflection) // lines.padded
    # the simulation joins the values of the joint's force by straight lines, which lowers the force that the modes feel
    step = 1 / (steps_per_sample(hypothesis.reach.model, lines.recording.rate) * lines.recording.rate)
    count = len(driving.force)
    joined = np.sinc(lines.padded_frequencies[:count] * step) ** 2 * answer.force[:count]
    moving = DrivenJoint(joint.path, joined, own.start + cause.law_size)
    driven = driven_change(hypothesis, moving, driving, lines, (oversampling, bool(cause.law().damping.any())))
    # the numbers of the law change the force for a given motion, all other numbers change the motion
    by_number = np.eye(cause.law_size if driving.own else 0, driven.mix.shape[1], own.start)
    signals = np.empty((len(lines.recording.force), len(by_number) + len(driven.mix)), dtype=np.float32)
    law_slopes = cause.law_slopes(lines.recording) if driving.own else no_slopes(len(cause.law().springs))
    _run(hypothesis, lines, joint, driven, law_slopes, signals)
    _require_finite(signals, f"the motion under {cause.physics.name} diverges in the simulation")
    return signals, np.vstack([by_number, driven.mix]), 0


def _require_finite(signals: Signals, message: str) -> None:
    """Raise LinAlgError if a value is larger than :data:`LARGEST` or NaN."""
    if not (signals.max(initial=0.0) < LARGEST and signals.min(initial=0.0) > -LARGEST):
        raise np.linalg.LinAlgError(message)


def _run(
    hypothesis: Hypothesis,
    lines: WindowedSpectrum,
    joint: _Joint,
    driven: DrivenChange,
    law_slopes: LawSlopes,
    signals: Signals,
) -> None:
    """Run the tangent simulation and write the change of the joint force into ``signals`` (n_samples, n_signals)."""
    oversampling = len(joint.answer.deflection) // lines.padded
    n, step = oversampling * len(signals), 1 / (oversampling * lines.recording.rate)
    law, filters = joint.cause.law(lines.recording), driven.filters
    tangent_run(
        (joint.answer.deflection[:n], joint.answer.velocity[:n]),
        joint_dynamics(hypothesis.reach.model, joint.path.ends, step),
        (
            law.tables(),
            (law.reach, law.speed),
            stiffness_ramp(law, n, step, lines.recording.duration),
            (law.springs, law.yields),
        ),
        (*law_slopes.parts, step / lines.recording.duration),
        (
            filters.sources,
            filters.start,
            (filters.turns, filters.inputs, filters.direct),
            (filters.n_modes, filters.step),
        ),
        driven.driving,
        joint.weights(lines).astype(np.float32),
        signals,
    )
