"""Score test of linear causes: what each would gain from where the refitted model stands, without a fit."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..models import Cause, Hypothesis, line_response
from ..physics import ChainPhysics
from .whitened_residual import Floor

Real = NDArray[np.float64]


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
