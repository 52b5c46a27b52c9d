"""Derivative of the joints' forces by everything that is fitted, the structure's motion answering."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, rfft

from estimation import WindowedSpectrum

from ...joints import JointPath, JointResponse, driven_force, joint_dynamics, stiffness_ramp, tangent_run
from ..cause import Cause
from ..hypothesis import Hypothesis, Predicted, surround
from ..lines import displacement_at, receptance_at
from .driven_changes import driven_mix, driven_signals

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Signals = NDArray[np.float32]

BEYOND = 10.0
"""Changes of motion are followed up to this multiple of the band's end, which most records do not reach. Modes hardly
move there; the flexibility of modes outside the band does, and dry friction feels it (at 3 a third of it is missed)."""

LARGEST = 1e30
"""Change of a motion beyond which it has run away: single precision holds no more."""


@dataclass(frozen=True)
class JointChange:
    """A joint's force at the lines, and its derivative; the structure feels it with a minus sign.

    Parameters
    ----------
    push : (n_excitations,)
        The excitations by a unit of the force.
    turns : (n_excitations, n_angles)
        Derivative of these by the joint's angles.
    angles
        Column of the first angle among all that is fitted.
    force : (n_lines,), N
        Windowed lines of the force g.
    change : (n_lines, n_columns), N
        Derivative of these lines by what is fitted, from column ``first`` on.
    first
        The first of these columns.
    """

    push: Real
    turns: Real
    angles: int
    force: Complex
    change: Complex
    first: int


@dataclass(frozen=True)
class _Joint:
    """A joint's cause, how it reaches the model, its numbers among all that is fitted, and what it does."""

    cause: Cause
    path: JointPath
    own: slice
    answer: JointResponse


@dataclass(frozen=True)
class _Driving:
    """What drives a joint, at padded lines: the outer force and its derivative by all that is fitted."""

    force: Complex
    change: Complex | None


def joint_changes(hypothesis: Hypothesis, lines: WindowedSpectrum, predicted: Predicted) -> tuple[JointChange, ...]:
    """Derivative of the windowed lines of each joint's force.

    A change of the modal parameters, of the outer force or of an earlier joint changes a joint's driven motion; its
    tangent run says how its force answers.

    Parameters
    ----------
    hypothesis
        Hypothesis with at least one joint.
    lines
        Windowed spectrum of the recording.
    predicted
        What the hypothesis predicts for the recording.
    """
    count = int(np.sum(lines.padded_frequencies <= BEYOND * lines.frequencies[-1]))
    driving = _outer_change(hypothesis, lines, count)
    paths = hypothesis.reach.paths
    forces = lines.cut(lines.signal(np.stack([answer.force for answer in predicted.joints], axis=1))).T
    found: list[JointChange] = []
    at = hypothesis.shape.size
    for cause in hypothesis.causes:
        own = slice(at, at + cause.size)
        at += cause.size
        if cause.axis is None:
            continue
        answer, path = predicted.joints[len(found)], paths[len(found)]
        signals, mix, first = _force_change(hypothesis, lines, _Joint(cause, path, own, answer), driving)
        angles, turns = own.start + len(cause.values), path.columns @ path.axis.turns
        change = _mixed(lines.cut(signals), mix)
        found.append(JointChange(path.push, turns, angles, np.ascontiguousarray(forces[len(found)]), change, first))
        if len(found) < len(predicted.joints):
            felt = _Driving(driving.force - answer.force[:count, None] * path.push, driving.change)
            driving = _driven_on(hypothesis, lines, felt, found[-1], (signals, mix, answer))
    return tuple(found)


def _mixed(signals: NDArray[np.complexfloating], mix: Real | None) -> Complex:
    """Real combinations (n, n_columns) of complex signals (n, n_signals)."""
    if mix is None:
        return signals.astype(complex)
    out = np.empty((len(signals), mix.shape[1]), dtype=complex)
    out.real, out.imag = signals.real @ mix, signals.imag @ mix
    return out


def _driven_on(
    hypothesis: Hypothesis,
    lines: WindowedSpectrum,
    driving: _Driving,
    joint: JointChange,
    written: tuple[Signals, Real | None, JointResponse],
) -> _Driving:
    """What drives the joints after one, whose own force changes too."""
    signals, mix, answer = written
    change, count = driving.change, len(driving.force)
    if change is None:
        change = np.zeros((*driving.force.shape, hypothesis.size), dtype=complex)
    moved = _mixed(rfft(signals, n=lines.padded, axis=0)[:count], mix)
    change[:, :, joint.first : joint.first + moved.shape[1]] -= moved[:, None] * joint.push[:, None]
    angles = slice(joint.angles, joint.angles + joint.turns.shape[1])
    change[:, :, angles] -= answer.force[:count, None, None] * joint.turns
    return _Driving(driving.force, change)


def _outer_change(hypothesis: Hypothesis, lines: WindowedSpectrum, count: int) -> _Driving:
    """Outer force at padded lines, and its derivative by the numbers of linear causes."""
    frequencies, force = lines.padded_frequencies[:count], lines.force_lines[:count]
    forces = hypothesis.reach.forces
    outer = np.array(forces(surround(hypothesis, frequencies).pushed(force)))
    if all(cause.axis is not None for cause in hypothesis.causes):
        return _Driving(outer, None)
    change = np.zeros((*outer.shape, hypothesis.size), dtype=complex)
    here, first, steps = hypothesis.coordinates(), hypothesis.shape.size, hypothesis.steps_aside()
    at = 0
    for cause in hypothesis.causes:
        for k in range(at, at + cause.size if cause.axis is None else at):
            aside = here.copy()
            aside[k] += steps[k]
            moved = surround(hypothesis.with_causes(aside), frequencies).pushed(force)
            change[:, :, first + k] = (forces(moved) - outer) / steps[k]
        at += cause.size
    return _Driving(outer, change if change.any() else None)


def _force_change(
    hypothesis: Hypothesis, lines: WindowedSpectrum, joint: _Joint, driving: _Driving
) -> tuple[Signals, Real | None, int]:
    """Derivative of g at the samples: signals (n, n_signals), their mix (n_signals, n_columns), and the first column.

    Without a mix each signal is a column.
    """
    cause, own, answer = joint.cause, joint.own, joint.answer
    often = len(answer.deflection) // (len(lines.recording.force) if cause.seen is not None else lines.padded)
    by_law = _law_change(cause, lines, answer, often)
    if cause.seen is not None:
        return by_law, None, own.start
    driven, mix = _driven_change(hypothesis, lines, joint, driving)
    if not np.abs(driven).max() < LARGEST:
        raise np.linalg.LinAlgError(f"the motion under {cause.physics.name} runs away when it is simulated")
    values = len(cause.values)
    # the law's numbers change the force at given motion, everything else the motion that drives it
    spectrum = np.zeros((often * lines.padded // 2 + 1, values + driven.shape[1]), dtype=np.complex64)
    spectrum[: len(driven), values:] = often * driven
    by_number = np.zeros((values, hypothesis.size))
    by_number[:, own.start : own.start + values] = np.eye(values)
    n = often * len(lines.recording.force)
    dg = np.zeros((n, spectrum.shape[1]), dtype=np.float32)
    dg[:, :values] = by_law
    law, step = cause.law(), 1 / (often * lines.recording.rate)
    s = 2j * np.pi * np.arange(len(driven), dtype=np.float32)[:, None] / np.float32(lines.padded * step * often)
    deflection = irfft(spectrum, n=often * lines.padded, axis=0)
    spectrum[: len(driven)] *= s
    velocity = irfft(spectrum, n=often * lines.padded, axis=0)
    tangent_run(
        (answer.deflection[:n], answer.velocity[:n]),
        joint_dynamics(hypothesis.reach.model, joint.path.ends, step),
        law.tables(),
        (law.reach, law.speed),
        stiffness_ramp(law, n, step, lines.recording.duration),
        (law.springs, law.yields),
        (deflection[:n], velocity[:n]),
        dg,
    )
    return at_samples(dg, often), np.vstack([by_number, mix]), 0


def at_samples(signal: Signals, often: int) -> Signals:
    """Every ``often``-th instant of signals (often n, n_columns), each the mean of those around it, tapered."""
    if often == 1:
        return signal
    weights = np.bartlett(2 * often + 1)[1:-1]
    weights /= weights.sum()
    padded = np.pad(signal, ((often - 1, often - 1), (0, 0)))
    return np.asarray(
        sum(weight * padded[k : k + len(signal) : often] for k, weight in enumerate(weights.astype(np.float32)))
    )


def _law_change(cause: Cause, lines: WindowedSpectrum, answer: JointResponse, often: int) -> Signals:
    """Derivative of g at given motion by the law's numbers, (n, n_values)."""
    n = often * len(lines.recording.force)
    x, v = answer.deflection[:n], answer.velocity[:n]
    # a derivative need not be known to more than six digits
    result = np.zeros((n, len(cause.values)), dtype=np.float32)
    here, steps = cause.coordinates(), cause.steps_aside()
    plain = driven_force(lines, x, v, cause.law(), often=often)
    for k in range(len(cause.values)):
        aside = here.copy()
        aside[k] += steps[k]
        change = (driven_force(lines, x, v, cause.moved(aside).law(), often=often) - plain) / steps[k]
        if not np.abs(change).max() < LARGEST:
            raise np.linalg.LinAlgError(f"the force of {cause.physics.name} runs away when it is simulated")
        result[:, k] = change
    return result


def _driven_change(
    hypothesis: Hypothesis, lines: WindowedSpectrum, joint: _Joint, driving: _Driving
) -> tuple[Complex, Real]:
    """Derivative of the driven deflection at padded lines: signals (n, n_signals) and their mix (n_signals, size)."""
    path, own, turns = joint.path, joint.own, joint.path.axis.turns
    outer, model = driving.force, hypothesis.reach.model
    pushed = joint.answer.force[: len(outer), None] * path.push
    frequencies, along = lines.padded_frequencies[: len(outer)], path.along
    driven = driven_signals(hypothesis.shape, model, frequencies, (outer - pushed, outer), along)
    mix = np.zeros((driven.shape[1], hypothesis.size))
    mix[:, : hypothesis.shape.size] = driven_mix(hypothesis.shape, model, along)
    # its own force moves a joint through the modes alone, as in the free simulation
    modes = replace(model, residuals=None)
    displacement = displacement_at(model, frequencies, outer) - displacement_at(modes, frequencies, pushed)
    compliance = along @ receptance_at(modes, frequencies)
    turned = (compliance @ (path.columns @ turns)) * joint.answer.force[: len(outer), None]
    extra = np.zeros((len(outer), hypothesis.size), dtype=complex)
    extra[:, own.start + len(joint.cause.values) : own.stop] = displacement @ (path.rows @ turns) - turned
    if driving.change is not None:
        extra += np.einsum("kq,kqc->kc", along @ receptance_at(model, frequencies), driving.change)
    used = np.flatnonzero(extra.any(axis=0))
    if len(used) > hypothesis.size // 2:
        return _mixed(driven, mix) + extra, np.eye(hypothesis.size)
    return np.concatenate([driven, extra[:, used]], axis=1), np.vstack([mix, np.eye(hypothesis.size)[used]])
