"""Score tests that rank linear causes and joint laws without fitting them."""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from millfrf.core import Real

from ..joints.joint_axis import JointAxis
from ..joints.joint_simulation import driven_force
from ..models.hypothesis import Cause, Hypothesis, line_response
from ..models.modal_lines import receptance_at
from ..physics.protocol import ChainPhysics, JointPhysics
from .joint_places import SeenMotion, motion_of, seen_motion
from .whitened_residual import Floor, FloorRecord


@dataclass(frozen=True)
class ScreenedChain:
    """A linear cause at a place, started at its linearised best, and the misfit that it would gain."""

    cause: Cause
    gain: float


def screen_chains(floor: Floor, hypothesis: Hypothesis, causes: list[ChainPhysics]) -> list[ScreenedChain]:
    """Rank linear causes at all their places, best first.

    The gain is ``g^T S^-1 g`` with g the gradient along the cause's numbers and S its normal matrix after modal
    parameters have adapted within the lab's belief (Rao's score test).
    """
    found = []
    for physics in causes:
        for place in physics.places(hypothesis.shape.nominal):
            start = Cause(physics, physics.start(hypothesis.shape.nominal), place)
            gain, step = _gain(floor, hypothesis, start)
            found.append(ScreenedChain(start.moved(start.coordinates() + np.clip(step, -60, 60)), gain))
    return sorted(found, key=lambda one: -one.gain)


def gain_of_chain(floor: Floor, hypothesis: Hypothesis, absent: Cause) -> float:
    """Gain in misfit of one linear cause at its place.

    Parameters
    ----------
    floor
        Residual of the fit so far.
    hypothesis
        Hypothesis of the fit so far.
    absent
        The cause with the numbers at which it does nothing.
    """
    return _gain(floor, hypothesis, absent)[0]


def _gain(floor: Floor, hypothesis: Hypothesis, cause: Cause) -> tuple[float, Real]:
    with_it = hypothesis.with_cause(cause)
    here = with_it.coordinates()
    own = np.zeros((cause.size, cause.size))
    shared = np.zeros((len(floor.gradient), cause.size))
    pull = np.zeros(cause.size)
    for record in floor.records:
        base = line_response(with_it, record.lines)
        columns = []
        for k in range(len(here) - cause.size, len(here)):
            aside = here.copy()
            aside[k] += 0.1
            changed = line_response(with_it.with_causes(aside), record.lines)
            columns.append(record.column((changed - base) / 0.1))
        slope = np.array(columns).T
        own += 2 * slope.T @ slope
        shared += 2 * record.slope.T @ slope
        pull += 2 * slope.T @ record.rest
    solved = floor.inverse @ shared
    left = own - shared.T @ solved
    drive = pull - solved.T @ floor.gradient
    step = np.asarray(np.linalg.lstsq(left, drive, rcond=1e-10)[0], dtype=float)
    return float(drive @ step), step


@dataclass(frozen=True)
class Screened:
    """A law's shapes along an axis, the most promising first.

    Parameters
    ----------
    causes
        The law in each shape, with the amplitude that fits best, driven by the motion that was seen.
    gain
        Gain of the first shape in misfit, linear in the amplitude and after the modal parameters have adapted.
    """

    causes: tuple[Cause, ...]
    gain: float


def screen_joints(floor: Floor, hypothesis: Hypothesis, axis: JointAxis, laws: list[JointPhysics]) -> list[Screened]:
    """Rank laws along an axis, best first; those of the wrong sign are left out.

    Parameters
    ----------
    floor
        Residual of the fit so far.
    hypothesis
        Hypothesis of the fit so far.
    axis
        Where the joint gives way.
    laws
        Laws that are tried.
    """
    seen = [seen_motion(record, hypothesis, axis) for record in floor.records]
    reach = hypothesis.reach_with(axis)
    static = reach.model.receptance(np.array([hypothesis.model.natural_frequencies.min() / 20]))[0]
    stiffness = 1 / abs(reach.paths[-1].along @ static @ reach.paths[-1].push)
    motion = motion_of(seen, float(stiffness))
    by_name = {
        record.lines.recording.name: (one.deflection, one.velocity)
        for record, one in zip(floor.records, seen, strict=True)
    }
    found = []
    for law in laws:
        causes = [Cause(law, start, "", axis, motion, by_name) for start in law.starts(motion)]
        parts = [
            [_column(record, hypothesis, one, cause) for record, one in zip(floor.records, seen, strict=True)]
            for cause in causes
        ]
        gains, factors = floor.gains(parts)
        low, high = law.parameters[0].low, law.parameters[0].high
        fitting = (factors > low) & (factors < high) & (factors != 0)
        order = [int(k) for k in np.argsort(-gains) if fitting[k]]
        if order:
            shapes = [replace(causes[k], values=np.array([factors[k], *causes[k].values[1:]])) for k in order]
            found.append(Screened(tuple(shapes), float(gains[order[0]])))
    return sorted(found, key=lambda one: -one.gain)


def _column(record: FloorRecord, hypothesis: Hypothesis, seen: SeenMotion, cause: Cause) -> Real:
    """Whitened response to the law's force for the motion that was seen."""
    assert cause.axis is not None
    lines = record.lines
    force = driven_force(lines, seen.deflection, seen.velocity, cause.law())
    spectrum = scipy.fft.rfft(force, n=lines.padded)
    reach, n = hypothesis.reach_with(cause.axis), len(hypothesis.model.responses)
    receptance = receptance_at(reach.model, lines.padded_frequencies)[:, :n] @ reach.paths[-1].push
    response = -receptance * spectrum[:, None] * lines.padded_kinematic
    return record.column(lines.cut(lines.signal(response)))
