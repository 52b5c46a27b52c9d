"""Gaussian process over postures: kernels, covariance and hyperparameters."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Real

from ..spatial.spatial_robot import SpatialRobot
from .modal_basis import PosturePlace
from .process_rows import DAMPING, FREQUENCY, SHAPE, Rows

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


PARTS = (
    "stiffness",
    "stiffness_over_postures",
    "mass",
    "frequency_over_postures",
    "frequency_scatter",
    "shape_over_postures",
    "shape_scatter",
    "damping",
    "joint_damping",
    "joint_damping_over_postures",
    "damping_scatter",
)
"""Amplitudes (standard deviations of logarithms, shapes as shares) of the covariance's parts."""

SCATTER = {FREQUENCY: 4, SHAPE: 6, DAMPING: 10}
"""Parts that differ from mode to mode and from posture to posture without any order."""


def covariance_parts(first: Rows, second: Rows, distances: SquaredDistances, length: float, same: bool) -> Real:
    """Covariances of two sets of rows for amplitudes of 1, (n_parts, n_first, n_second).

    ``s_1^2 J J^T`` of factors that are the same in every posture; ``s_2^2 sum_j J_j J_j^T k_j(q, q')`` of factors that
    vary; ``s_3^2 (u . u') k(q, q')`` of what no factor explains, where modes are alike in their energies u; and
    scatter.

    Parameters
    ----------
    distances
        Squared distances of the postures of the first list to those of the second.
    length
        Length scale of all kernels.
    same
        Whether both are the same rows: scatter is there on the diagonal alone.
    """
    place = np.ix_(first.posture, second.posture)
    joints = joint_kernels(distances, length)
    whole = whole_kernel(distances, length)[place]
    alike = (first.energy @ second.energy.T) * whole
    parts = np.zeros((len(PARTS), len(first), len(second)))
    parts[0] = first.stiffness @ second.stiffness.T
    parts[2] = first.mass @ second.mass.T
    parts[7] = np.outer(first.damping[:, 0], second.damping[:, 0])
    parts[8] = first.damping[:, 1:] @ second.damping[:, 1:].T
    for k, kernel in enumerate(joints):
        spread = kernel[place]
        parts[1] += np.outer(first.stiffness[:, k], second.stiffness[:, k]) * spread
        parts[9] += np.outer(first.damping[:, 1 + k], second.damping[:, 1 + k]) * spread
    parts[3] = alike * np.outer(first.kind == FREQUENCY, second.kind == FREQUENCY)
    parts[5] = alike * (first.motion @ second.motion.T) * (first.direction @ second.direction.T)
    if same:
        for kind, part in SCATTER.items():
            parts[part] = np.diag((first.kind == kind).astype(float))
    return parts


NAMES = (*PARTS, "length")

MEDIANS = np.array([0.15, 0.05, 0.07, 0.008, 0.004, 0.06, 0.04, 0.35, 0.2, 0.12, 0.06, 0.9])
"""Medians of the priors: what robots' models are off by before anything is measured, shares; and the length scale."""

FACTORS = np.array([2.0, 2.2, 2.0, 2.5, 2.5, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 1.7])
"""Factors of one standard deviation about the medians: with few postures the priors decide."""

DRAWS = 24
"""Draws of the hyperparameters."""

FREEDOM = 5.0
"""Degrees of freedom of the t distribution from which draws are proposed."""


@dataclass(frozen=True)
class Evidence:
    """Measured rows and distances of their postures: what the marginal likelihood is computed from."""

    rows: Rows
    distances: SquaredDistances


def covariance_of(hyper: Real, evidence: Evidence) -> Real:
    """Covariance of the measured rows with their noise, (n, n); ``hyper``: logarithms in the order of ``NAMES``."""
    parts = covariance_parts(evidence.rows, evidence.rows, evidence.distances, float(np.exp(hyper[-1])), True)
    return np.asarray(np.tensordot(np.exp(2 * hyper[:-1]), parts, 1) + np.diag(evidence.rows.noise**2))


def log_posterior(hyper: Real, evidence: Evidence) -> tuple[float, Real]:
    """Logarithm of marginal likelihood times prior, and its gradient, at logarithms of the hyperparameters.

    ``-(r^T A^-1 r + log det A) / 2 - sum ((h - log median) / log factor)^2 / 2`` (Rasmussen & Williams 2006, Eqs. 2.30
    and 5.9).
    """
    rows, step = evidence.rows, 1e-4
    parts = covariance_parts(rows, rows, evidence.distances, float(np.exp(hyper[-1])), True)
    squares = np.exp(2 * hyper[:-1])
    whole = np.tensordot(squares, parts, 1) + np.diag(rows.noise**2)
    factor = scipy.linalg.cho_factor(whole, lower=True)
    pulled = scipy.linalg.cho_solve(factor, rows.value)
    pull = np.outer(pulled, pulled) - scipy.linalg.cho_solve(factor, np.eye(len(rows)))
    longer = covariance_parts(rows, rows, evidence.distances, float(np.exp(hyper[-1] + step)), True)
    slopes = np.append(
        squares * np.tensordot(parts, pull, 2), np.sum(np.tensordot(squares, longer - parts, 1) * pull) / (2 * step)
    )
    away = (hyper - np.log(MEDIANS)) / np.log(FACTORS)
    logarithm = -0.5 * float(rows.value @ pulled) - float(np.sum(np.log(np.diag(factor[0])))) - 0.5 * float(away @ away)
    return logarithm, slopes - away / np.log(FACTORS)


def best_hyperparameters(evidence: Evidence, start: Real, fixed: Sequence[int] = ()) -> Real:
    """Logarithms of the hyperparameters at the largest posterior.

    Parameters
    ----------
    evidence
        Measured rows and the distances of their postures.
    start : (n_hyperparameters,)
        Logarithms to begin with.
    fixed
        Numbers of those that keep their start.
    """

    def negative(hyper: Real) -> tuple[float, Real]:
        value, slope = log_posterior(hyper, evidence)
        return -value, -slope

    spans = [
        (m - 3.5 * f, m + 3.5 * f) for m, f in zip(np.log(MEDIANS).tolist(), np.log(FACTORS).tolist(), strict=True)
    ]
    for k in fixed:
        spans[k] = (float(start[k]), float(start[k]))
    found = scipy.optimize.minimize(negative, start, jac=True, method="L-BFGS-B", bounds=spans, options={"maxiter": 60})
    return np.asarray(found.x)


def drawn_hyperparameters(
    evidence: Evidence, best: Real, seed: int = 0, count: int = DRAWS, fixed: Sequence[int] = ()
) -> Real:
    """Draws of the logarithms, (count, n_hyperparameters): few postures do not tell amplitudes to a point.

    Draws of a t distribution about the best values, with the curvature there, are weighed by the posterior over their
    density and drawn again (sampling, importance resampling: Rubin 1988).

    Parameters
    ----------
    evidence
        Measured rows and the distances of their postures.
    best : (n_hyperparameters,)
        Logarithms at the largest posterior.
    seed
        Seed of the generator that draws.
    count
        Number of draws.
    fixed
        Numbers of those that keep their best value.
    """
    size, rng = len(best), np.random.default_rng(seed)
    step = 0.05
    slopes = [
        (log_posterior(best + step * one, evidence)[1] - log_posterior(best - step * one, evidence)[1]) / (2 * step)
        for one in np.eye(size)
    ]
    curvature = -(np.array(slopes) + np.array(slopes).T) / 2
    values, vectors = np.linalg.eigh(curvature)
    spread = vectors / np.sqrt(np.maximum(values, 0.3 / np.log(FACTORS).max() ** 2))
    spread[list(fixed)] = 0.0
    tried = 6 * count
    wide = np.sqrt(FREEDOM / rng.chisquare(FREEDOM, tried))
    normal = rng.normal(size=(tried, size))
    proposed = best + wide[:, None] * (normal @ spread.T)
    heights = np.array([log_posterior(one, evidence)[0] for one in proposed])
    density = -(FREEDOM + size) / 2 * np.log1p(np.sum((wide[:, None] * normal) ** 2, axis=1) / FREEDOM)
    weights = np.exp(heights - density - (heights - density).max())
    weights = np.minimum(weights, weights.sum() / count * 1.5)  # no single draw may stand for all
    chosen = rng.choice(tried, count, p=weights / weights.sum())
    return np.asarray(proposed[np.sort(chosen)])
