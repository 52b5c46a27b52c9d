"""Kernels over postures: near in a joint's own angle, near in the load on it, near as a whole."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..spatial import SpatialRobot
from .modes import PosturePlace

Real = NDArray[np.float64]

LEAST_LOAD = 20.0
"""Smallest scale of a weight's turning moment, N m: below it, its changes do not matter."""


@dataclass(frozen=True)
class PostureMetric:
    """How far two postures are apart, in units in which a length scale of 1 is natural.

    Parameters
    ----------
    weights : (n_active,)
        Arc of the tip a radian (1/m for prismatic joints) over the largest arc.
    turns : (n_active,), bool
        Revolute joints, whose angles return after a turn.
    own_turns : (n_stiffnesses,), bool
        The same of each elastic part's own joint.
    loads : (n_stiffnesses,), N m or N
        Scale of the weight's turning moment at each elastic part.
    """

    weights: Real
    turns: NDArray[np.bool_]
    own_turns: NDArray[np.bool_]
    loads: Real


@dataclass(frozen=True)
class SquaredDistances:
    """Squared distances of postures: as a whole (n, m), by own angle and by load (n_stiffnesses, n, m)."""

    whole: Real
    own: Real
    load: Real


def squared_distances(metric: PostureMetric, first: list[PosturePlace], second: list[PosturePlace]) -> SquaredDistances:
    """``sum_i w_i^2 (2 sin(d_i / 2))^2`` over the joints, its own joint's term alone, and ``(d tau / scale)^2``."""
    driven = [np.array([place.driven for place in places]) for places in (first, second)]
    own = [np.array([place.own for place in places]).T for places in (first, second)]
    load = [np.array([place.load for place in places]).T for places in (first, second)]
    steps = _chord(driven[0][:, None] - driven[1][None], metric.turns)
    own_steps = _chord((own[0][:, :, None] - own[1][:, None, :]).transpose(1, 2, 0), metric.own_turns)
    pulls = (load[0][:, :, None] - load[1][:, None, :]) / metric.loads[:, None, None]
    return SquaredDistances(np.sum((steps * metric.weights) ** 2, axis=-1), own_steps.transpose(2, 0, 1) ** 2, pulls**2)


def whole_kernel(distances: SquaredDistances, length: float) -> Real:
    """``exp(-d^2 / (2 l^2))`` of whole postures, (n, m)."""
    return np.asarray(np.exp(-distances.whole / (2 * length**2)))


def joint_kernels(distances: SquaredDistances, length: float) -> Real:
    """Mean of the three kernels for each elastic part, (n_stiffnesses, n, m)."""
    parts = [np.exp(-one / (2 * length**2)) for one in (distances.whole[None], distances.own, distances.load)]
    return np.asarray((parts[0] + parts[1] + parts[2]) / 3)


def posture_metric(robot: SpatialRobot, weights: Real, places: list[PosturePlace]) -> PostureMetric:
    """Metric of a robot; loads are scaled by their spread over the measured postures."""
    mechanism = robot.mechanism
    frames = {mechanism.frames[index].name: mechanism.frames[index] for index in mechanism.moving}
    turns = [mechanism.frames[index].motion == "revolute" for index in mechanism.moving]
    own = [joint.frame not in frames or frames[joint.frame].motion == "revolute" for joint in robot.joints]
    own += [True] * (len(places[0].own) - len(own))
    loads = np.array([place.load for place in places])
    scale = np.maximum(loads.std(axis=0), np.maximum(0.3 * np.abs(loads).max(axis=0), LEAST_LOAD))
    return PostureMetric(weights, np.array(turns)[mechanism.active], np.array(own), scale)


def _chord(step: Real, turns: NDArray[np.bool_]) -> Real:
    return np.where(turns, 2 * np.sin(step / 2), step)
