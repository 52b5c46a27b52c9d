"""Quick ranking of joint laws along an axis: each is driven by the motion that was seen and fitted linearly."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft

from ..joints import JointAxis, driven_force
from ..models import Cause, Hypothesis, receptance_at
from ..physics import JointPhysics
from .joint_direction import SeenMotion, motion_of, seen_motion
from .whitened_residual import Floor, FloorRecord

Real = NDArray[np.float64]


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
    spectrum = rfft(force, n=lines.padded)
    reach, n = hypothesis.reach_with(cause.axis), len(hypothesis.model.responses)
    receptance = receptance_at(reach.model, lines.padded_frequencies)[:, :n] @ reach.paths[-1].push
    response = -receptance * spectrum[:, None] * lines.padded_kinematic
    return record.column(lines.cut(lines.signal(response)))
