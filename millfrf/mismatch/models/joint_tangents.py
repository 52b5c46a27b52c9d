"""Derivatives of joint forces by the fitted parameters."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real

from ..joints.joint_law import JointLaw, LawSlopes, law_quotient, law_slopes
from ..joints.joint_reach import JointPath
from ..joints.joint_simulation import JointResponse, joint_dynamics, stiffness_ramp
from ..joints.tangent_loop import tangent_run
from ..joints.time_loops import law_change_run
from ..physics.free_form import FreeForm
from .driven_changes import DrivenChange, DrivenJoint, Driving, Moved, driven_change
from .hypothesis import Cause, Hypothesis, Predicted, surround

Signals = NDArray[np.float32]


def cause_slopes(cause: Cause) -> LawSlopes:
    """Derivative of a joint's law by the coordinates of its numbers.

    Parameters
    ----------
    cause
        A joint's cause. The factors of a free form are taken as they are, all other numbers by difference quotients.
    """
    law, here, steps = cause.law(), cause.coordinates(), cause.steps_aside()
    linear: tuple[JointLaw, ...] = ()
    if isinstance(cause.physics, FreeForm) and cause.motion is not None:
        linear = cause.physics.law_changes(cause.values, cause.motion)
    quotients = []
    for k in range(len(cause.values) - len(linear)):
        aside = here.copy()
        aside[k] += steps[k]
        quotients.append(law_quotient(law, cause.moved(aside).law(), steps[k]))
    return law_slopes(law, [*quotients, *linear])


def given_motion_change(cause: Cause, lines: WindowedSpectrum, answer: JointResponse) -> Signals:
    """Derivative of a joint's force by its law's numbers at the motion seen, (n, n_numbers), N by a coordinate.

    Parameters
    ----------
    cause
        A joint whose law is driven by what was seen.
    lines
        Windowed spectrum of the recording.
    answer
        The joint's motion at the recording's samples.
    """
    law, n = cause.law(), len(lines.recording.force)
    out, sticks = np.empty((n, len(cause.values)), dtype=np.float32), np.empty((n, len(law.yields)), dtype=np.bool_)
    law_change_run(
        (answer.deflection[:n], answer.velocity[:n]),
        0,
        ((law.reach, law.speed), law.yields),
        (*cause_slopes(cause).parts, 1 / (lines.recording.rate * lines.recording.duration)),
        (np.zeros(len(law.yields)), np.zeros(len(law.yields))),
        (sticks, out),
    )
    return out


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
        joint = _Joint(cause, paths[len(found)], own, predicted.joints[len(found)])
        signals, mix, first = _force_change(hypothesis, lines, joint, driving)
        angles, turns = own.start + len(cause.values), joint.path.columns @ cause.axis.turns
        change = _mixed(lines.cut(signals), mix)
        force = np.ascontiguousarray(forces[len(found)])
        found.append(JointChange(joint.path.push, turns, angles, force, change, first))
        if any(other.seen is None for other in hypothesis.laws[len(found) :]):
            driving = _driven_on(hypothesis, lines, driving, (joint, found[-1]), (signals, mix))
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
    driving: Driving,
    joint: tuple[_Joint, JointChange],
    written: tuple[Signals, Real | None],
) -> Driving:
    """What drives the joints after one, whose own force changes too."""
    (own, found), (signals, mix) = joint, written
    count = len(driving.force)
    force = own.answer.force[:count]
    if mix is None:
        mix = np.eye(signals.shape[1], hypothesis.size, found.first)
    spectra = scipy.fft.rfft(np.ascontiguousarray(signals.T), n=lines.padded, axis=1)[:, :count].T
    turned = np.eye(found.turns.shape[1], hypothesis.size, found.angles)
    moved = [Moved(-found.push[:, None], spectra, mix)]
    moved += [Moved(-turn[:, None], force[:, None], row[None]) for turn, row in zip(found.turns.T, turned, strict=True)]
    pushes = (*driving.joints, (force, own.path.push))
    return Driving(driving.force - force[:, None] * own.path.push, pushes, (*driving.moved, *moved))


def _outer_change(hypothesis: Hypothesis, lines: WindowedSpectrum, count: int) -> Driving:
    """Outer force at padded lines, and its derivative by the numbers of linear causes."""
    frequencies, force = lines.padded_frequencies[:count], lines.force_lines[:count]
    forces = hypothesis.reach.forces
    outer = np.array(forces(surround(hypothesis, frequencies).pushed(force)))
    here, first, steps = hypothesis.coordinates(), hypothesis.shape.size, hypothesis.steps_aside()
    moved, at = [], 0
    for cause in hypothesis.causes:
        for k in range(at, at + cause.size if cause.axis is None else at):
            aside = here.copy()
            aside[k] += steps[k]
            pushed = surround(hypothesis.with_causes(aside), frequencies).pushed(force)
            change = (forces(pushed) - outer) / steps[k]
            if change.any():
                moved.append(Moved(change, None, np.eye(1, hypothesis.size, first + k)))
        at += cause.size
    return Driving(outer, (), tuple(moved))


def _force_change(
    hypothesis: Hypothesis, lines: WindowedSpectrum, joint: _Joint, driving: Driving
) -> tuple[Signals, Real | None, int]:
    """Derivative of g at the samples: signals (n, n_signals), their mix (n_signals, n_columns), and the first column.

    Without a mix each signal is a column.
    """
    cause, own, answer = joint.cause, joint.own, joint.answer
    if cause.seen is not None:
        by_law = given_motion_change(cause, lines, answer)
        _stands(by_law, f"the force of {cause.physics.name} runs away when it is simulated")
        return by_law, None, own.start
    often = len(answer.deflection) // lines.padded
    moving = DrivenJoint(joint.path, answer.force[: len(driving.force)], own.start + len(cause.values))
    driven = driven_change(hypothesis, moving, driving, lines, (often, bool(cause.law().damping.any())))
    # the law's numbers change the force at given motion, everything else the motion that drives it
    by_number = np.eye(len(cause.values), hypothesis.size, own.start)
    signals = np.empty((len(lines.recording.force), len(by_number) + len(driven.mix)), dtype=np.float32)
    _run(hypothesis, lines, joint, driven, signals)
    _stands(signals, f"the motion under {cause.physics.name} runs away when it is simulated")
    return signals, np.vstack([by_number, driven.mix]), 0


def _stands(signals: Signals, otherwise: str) -> None:
    """Raise where a change has run away; a number that is none counts as that."""
    if not (signals.max(initial=0.0) < LARGEST and signals.min(initial=0.0) > -LARGEST):
        raise np.linalg.LinAlgError(otherwise)


def _run(
    hypothesis: Hypothesis, lines: WindowedSpectrum, joint: _Joint, driven: DrivenChange, signals: Signals
) -> None:
    """Write the change of the joint's force at the samples for every signal (n, n_signals)."""
    often = len(joint.answer.deflection) // lines.padded
    n, step = often * len(signals), 1 / (often * lines.recording.rate)
    law, filters = joint.cause.law(), driven.filters
    weights = np.bartlett(2 * often + 1)[1:-1]
    tangent_run(
        (joint.answer.deflection[:n], joint.answer.velocity[:n]),
        joint_dynamics(hypothesis.reach.model, joint.path.ends, step),
        (
            law.tables(),
            (law.reach, law.speed),
            stiffness_ramp(law, n, step, lines.recording.duration),
            (law.springs, law.yields),
        ),
        (*cause_slopes(joint.cause).parts, step / lines.recording.duration),
        (
            filters.sources,
            filters.start,
            (filters.turns, filters.inputs, filters.direct),
            (filters.n_modes, filters.step),
        ),
        driven.given,
        (weights / weights.sum()).astype(np.float32),
        signals,
    )
