"""What an identification is worth: its error at postures that it has not seen."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..spatial import SpatialRobot
from .elastic_parameters import ElasticParameter
from .stiffness_identification import Deflection, apply_elastic, identify_elastic, predicted_deflections

Real = NDArray[np.float64]

FEWEST = 10
"""Fewest postures of which some can be held out."""

_EVERY = 5


@dataclass(frozen=True)
class HeldOut:
    """Errors of predicted deflections at postures that were held out.

    Parameters
    ----------
    postures
        How many postures were held out.
    deflections, before, after : (n,), m
        Length of each measured deflection there, and of what the start and the identified model miss of it.
    """

    postures: int
    deflections: Real
    before: Real
    after: Real

    def times(self, error: float) -> float:
        """Root mean square of what is left, over the standard error of a displacement in three directions."""
        return float(np.sqrt(np.mean(self.after**2) / 3) / error)


def verify_elastic(
    robot: SpatialRobot,
    measured: Sequence[Deflection],
    error: float,
    parameters: Sequence[ElasticParameter],
    *,
    prior: float = 1.0,
) -> HeldOut | None:
    """Identify from four fifths of the postures and predict the rest (Belchior et al. 2013 hold out a second load).

    All deflections of a posture are held out together. None: fewer than ten postures, of which none can be spared.

    Parameters
    ----------
    robot, measured, error, parameters, prior
        As in :func:`robot_model.identify_elastic`.
    """
    keys = [np.asarray(case.q).tobytes() for case in measured]
    distinct = list(dict.fromkeys(keys))
    if len(distinct) < FEWEST:
        return None
    order = np.random.default_rng(0).permutation(len(distinct))
    held = {distinct[index] for index in order[::_EVERY]}
    seen = [case for case, key in zip(measured, keys, strict=True) if key not in held]
    unseen = [case for case, key in zip(measured, keys, strict=True) if key in held]
    found = identify_elastic(robot, seen, error, parameters, prior=prior)
    real = np.array([case.displacement for case in unseen])
    missed = [
        np.linalg.norm(predicted_deflections(model, unseen) - real, axis=1)
        for model in (robot, apply_elastic(robot, parameters, found.values))
    ]
    return HeldOut(len(held), np.linalg.norm(real, axis=1), missed[0], missed[1])
