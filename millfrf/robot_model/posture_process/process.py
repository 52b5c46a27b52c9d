"""Gaussian process over postures: linear forms of its unknowns, kernels, covariance and hyperparameters."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Index, Real

from ..settings import POSTURES
from ..spatial.spatial_robot import SpatialRobot
from .modal_basis import CorrectedModes, MeasuredModes, ModalBasis, Pairs, PosturePlace, shape_slopes

# kinds of rows: logarithm of a frequency or of a damping ratio, a component of a shape, an unknown itself
FREQUENCY, DAMPING, SHAPE, UNKNOWN = range(4)


@dataclass(frozen=True)
class Rows:
    """Numbers of modes as linear forms of the unknowns, one per row (n rows in total).

    The unknowns are the logarithms of factors on stiffness, mass and damping of the robot's parts.
    """

    posture: Index  # (n,): number of the row's posture in its list
    kind: Index  # (n,): FREQUENCY, DAMPING, SHAPE or UNKNOWN
    stiffness: Real  # (n, n_stiffnesses): derivative over the stiffnesses in the posture
    mass: Real  # (n, n_masses): derivative over the masses, which are the same in every posture
    damping: Real  # (n, 1 + n_stiffnesses): derivative over the damping of the robot, then of each elastic part
    energy: Real  # (n, n_stiffnesses): unit vector of the roots of the mode's shares of energy
    motion: Real  # (n, 3): unit vector of the tip's motion in the mode; zero where the row is no shape
    direction: Real  # (n, 3): unit vector of the row's component of the shape; zero where the row is no shape
    value: Real  # (n,): measured number minus the constant of the linear form
    noise: Real  # (n,): its standard error

    def __len__(self) -> int:
        return len(self.value)


def joined(parts: list[Rows]) -> Rows:
    """Concatenate several sets of rows."""
    return Rows(**{field.name: np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Rows)})


def selected(rows: Rows, chosen: NDArray[np.bool_]) -> Rows:
    """Select the rows for which ``chosen`` (n,) is true."""
    return Rows(**{field.name: getattr(rows, field.name)[chosen] for field in fields(Rows)})


def measured_rows(
    posture: int,
    measured: MeasuredModes,
    pairs: Pairs,
    basis: ModalBasis,
    modes: CorrectedModes,
    ratios: Real,
    unknowns: tuple[Real, Real],
) -> Rows:
    """Build rows from the modes measured in one posture, linearised at the ``unknowns`` (stiffness, mass) of ``modes``.

    ``ratios`` (n_modes,) are the damping ratios as modelled.
    """
    directions = measured.directions
    parts = []
    for i, r in pairs:
        rows = linear_mode_rows(posture, basis, modes, r, directions, unknowns)
        computed = directions @ modes.tip[r]
        size = max(float(np.linalg.norm(computed)), 1e-12)
        shape = measured.shapes[i] * (1.0 if measured.shapes[i] @ computed >= 0 else -1.0)
        residuals = [
            np.log(measured.frequencies[i] * 2 * np.pi / modes.natural[r]),
            np.log(measured.damping[i] / ratios[r]),
            *((shape - computed) / size),
        ]
        noise = np.append(measured.errors[i, :2], np.full(len(directions), measured.errors[i, 2]))
        value = np.array(residuals) + rows.stiffness @ unknowns[0] + rows.mass @ unknowns[1]
        parts.append(replace(rows, value=value, noise=noise))
    return joined(parts)


def linear_mode_rows(
    posture: int, basis: ModalBasis, modes: CorrectedModes, mode: int, directions: Real, unknowns: tuple[Real, Real]
) -> Rows:
    """Build rows for frequency, damping and shape of one computed mode; values and noise are left at zero.

    ``d log w = shares . ds / 2 - mass shares . dm / 2``; a shape's components are relative to its size.
    """
    slopes = shape_slopes(basis, modes, *unknowns, mode)
    size = max(float(np.linalg.norm(directions @ modes.tip[mode])), 1e-12)
    shares, masses = modes.shares[mode], modes.masses[mode]
    rows = discrepancy_rows(posture, modes, mode, directions)
    damping = np.zeros_like(rows.damping)
    damping[1] = np.append(1.0, shares)
    return replace(
        rows,
        stiffness=np.vstack([shares / 2, np.zeros_like(shares), directions @ slopes[0] / size]),
        mass=np.vstack([-masses / 2, np.zeros_like(masses), directions @ slopes[1] / size]),
        damping=damping,
    )


def discrepancy_rows(posture: int, modes: CorrectedModes, mode: int, directions: Real) -> Rows:
    """Build rows for the deviations of one mode's frequency, damping and shape that the unknowns do not explain."""
    count = 2 + len(directions)
    n_stiffnesses, n_masses = modes.shares.shape[1], modes.masses.shape[1]
    tip = modes.tip[mode]
    motion, direction = np.zeros((count, 3)), np.zeros((count, 3))
    motion[2:] = tip / max(float(np.linalg.norm(tip)), 1e-30)
    direction[2:] = directions
    energy = np.sqrt(np.maximum(modes.shares[mode], 0.0))
    return Rows(
        np.full(count, posture),
        np.array([FREQUENCY, DAMPING, *[SHAPE] * len(directions)]),
        np.zeros((count, n_stiffnesses)),
        np.zeros((count, n_masses)),
        np.zeros((count, 1 + n_stiffnesses)),
        np.tile(energy / max(float(np.linalg.norm(energy)), 1e-12), (count, 1)),
        motion,
        direction,
        np.zeros(count),
        np.zeros(count),
    )


def unknown_rows(posture: int, n_stiffnesses: int, n_masses: int) -> Rows:
    """Build rows that are the unknowns of a posture: stiffnesses, masses, the robot's damping, the parts' damping."""
    count = 2 * n_stiffnesses + n_masses + 1
    identity = np.eye(count)
    stiffness, mass, damping = np.split(identity, [n_stiffnesses, n_stiffnesses + n_masses], axis=1)
    return Rows(
        np.full(count, posture),
        np.full(count, UNKNOWN),
        stiffness,
        mass,
        damping,
        np.zeros((count, n_stiffnesses)),
        np.zeros((count, 3)),
        np.zeros((count, 3)),
        np.zeros(count),
        np.zeros(count),
    )


# Hyperparameters: median of the log-normal prior, and the factor of one standard deviation about it. With few postures
# the priors decide. Amplitudes are standard deviations of logarithms, or of shapes over their size.
PRIORS = {
    "stiffness": (0.15, 2.0),
    "stiffness_over_postures": (0.05, 2.2),
    "mass": (0.07, 2.0),
    "frequency_over_postures": (0.008, 2.5),
    "frequency_scatter": (0.004, 2.5),
    "shape_over_postures": (0.06, 2.0),
    "shape_scatter": (0.04, 2.0),
    "damping": (0.35, 2.0),
    "joint_damping": (0.2, 2.0),
    "joint_damping_over_postures": (0.12, 2.0),
    "damping_scatter": (0.06, 2.0),
    "length": (0.9, 1.7),  # length scale of the kernels, in units of PostureMetric
}
NAMES = tuple(PRIORS)
MEDIANS, FACTORS = np.array(list(PRIORS.values())).T.copy()

# scatter differs between modes and between postures without any order
SCATTER = {FREQUENCY: "frequency_scatter", SHAPE: "shape_scatter", DAMPING: "damping_scatter"}


@dataclass(frozen=True)
class PostureMetric:
    """Scales of the distance between two postures, so that a length scale of 1 is natural."""

    weights: Real  # (n_active,): arc of the tip per radian (1/m for prismatic joints) over the largest arc
    revolute: NDArray[np.bool_]  # (n_active,): revolute joints, whose angles are periodic
    own_revolute: NDArray[np.bool_]  # (n_stiffnesses,): the same for each elastic part's own joint
    loads: Real  # (n_stiffnesses,), N m or N: scale of the weight's moment at each elastic part


@dataclass(frozen=True)
class SquaredDistances:
    """Squared distances between n and m postures."""

    total: Real  # (n, m): over all joints
    own: Real  # (n_stiffnesses, n, m): over each elastic part's own joint
    load: Real  # (n_stiffnesses, n, m): over the load on it


def squared_distances(metric: PostureMetric, first: list[PosturePlace], second: list[PosturePlace]) -> SquaredDistances:
    """Compute three squared distances for each pair of postures.

    ``total`` is ``sum_i w_i^2 (2 sin(d_i / 2))^2`` over all driven joints i with differences d_i and weights w_i.
    ``own`` is ``(2 sin(d_k / 2))^2`` of the joint of each elastic part k. ``load`` is ``(d tau_k / scale_k)^2``, with
    the difference d tau_k of the weight's moment about that joint. A prismatic joint has d instead of 2 sin(d / 2).
    """
    driven = [np.array([place.driven for place in places]) for places in (first, second)]
    own = [np.array([place.own for place in places]).T for places in (first, second)]
    load = [np.array([place.load for place in places]).T for places in (first, second)]
    steps = _chord(driven[0][:, None] - driven[1][None], metric.revolute)
    own_steps = _chord((own[0][:, :, None] - own[1][:, None, :]).transpose(1, 2, 0), metric.own_revolute)
    load_steps = (load[0][:, :, None] - load[1][:, None, :]) / metric.loads[:, None, None]
    total = np.sum((steps * metric.weights) ** 2, axis=-1)
    return SquaredDistances(total, own_steps.transpose(2, 0, 1) ** 2, load_steps**2)


def _chord(step: Real, revolute: NDArray[np.bool_]) -> Real:
    return np.where(revolute, 2 * np.sin(step / 2), step)


def posture_metric(robot: SpatialRobot, weights: Real, places: list[PosturePlace]) -> PostureMetric:
    """Build the scales of distances for a robot; loads are scaled by their spread over the measured postures."""
    mechanism = robot.mechanism
    frames = {mechanism.frames[index].name: mechanism.frames[index] for index in mechanism.moving}
    revolute = [mechanism.frames[index].motion == "revolute" for index in mechanism.moving]
    own = [joint.frame not in frames or frames[joint.frame].motion == "revolute" for joint in robot.joints]
    own += [True] * (len(places[0].own) - len(own))
    loads = np.array([place.load for place in places])
    scale = np.maximum(loads.std(axis=0), np.maximum(0.3 * np.abs(loads).max(axis=0), POSTURES.least_load))
    return PostureMetric(weights, np.array(revolute)[mechanism.active], np.array(own), scale)


def posture_kernel(distances: SquaredDistances, length: float) -> Real:
    """Compute the kernel ``exp(-d^2 / (2 l^2))`` of the distance d over all joints, (n, m); ``length`` is l."""
    return np.asarray(np.exp(-distances.total / (2 * length**2)))


def joint_kernels(distances: SquaredDistances, length: float) -> Real:
    """Compute a kernel for each elastic part, (n_stiffnesses, n, m).

    It is the mean of three kernels: of the distance over all joints, over the part's joint, and over its load.
    """
    kernels = [np.exp(-squares / (2 * length**2)) for squares in (distances.total[None], distances.own, distances.load)]
    return np.asarray((kernels[0] + kernels[1] + kernels[2]) / 3)


def _covariance_parts(first: Rows, second: Rows, distances: SquaredDistances, length: float, same: bool) -> Real:
    """Compute the covariance of two sets of rows by each amplitude of size 1, (n_amplitudes, n_first, n_second).

    Factors that are equal in all postures give ``J J^T`` with the rows' derivatives J; factors that vary over postures
    give ``sum_j J_j J_j^T k_j(q, q')`` with the kernels k_j. Deviations that no factor explains give
    ``(u . u') k(q, q')`` with the vectors u of :attr:`Rows.energy`. Scatter is added to the diagonal if both sets are
    the ``same`` rows.
    """
    place = np.ix_(first.posture, second.posture)
    similar = (first.energy @ second.energy.T) * posture_kernel(distances, length)[place]
    parts = {name: np.zeros((len(first), len(second))) for name in NAMES[:-1]}
    parts["stiffness"] = first.stiffness @ second.stiffness.T
    parts["mass"] = first.mass @ second.mass.T
    parts["damping"] = np.outer(first.damping[:, 0], second.damping[:, 0])
    parts["joint_damping"] = first.damping[:, 1:] @ second.damping[:, 1:].T
    for k, kernel in enumerate(joint_kernels(distances, length)):
        spread = kernel[place]
        stiffness = np.outer(first.stiffness[:, k], second.stiffness[:, k])
        damping = np.outer(first.damping[:, 1 + k], second.damping[:, 1 + k])
        parts["stiffness_over_postures"] += stiffness * spread
        parts["joint_damping_over_postures"] += damping * spread
    parts["frequency_over_postures"] = similar * np.outer(first.kind == FREQUENCY, second.kind == FREQUENCY)
    parts["shape_over_postures"] = similar * (first.motion @ second.motion.T) * (first.direction @ second.direction.T)
    if same:
        for kind, name in SCATTER.items():
            parts[name] = np.diag((first.kind == kind).astype(float))
    return np.array(list(parts.values()))


def covariance(hyper: Real, first: Rows, second: Rows, distances: SquaredDistances, *, same: bool = False) -> Real:
    """Compute the covariance of two sets of rows without measurement noise, (n_first, n_second).

    ``hyper`` are logarithms in the order of ``NAMES``. ``distances`` are between the postures of the first and of the
    second set. ``same`` says that both sets are the same rows.
    """
    parts = _covariance_parts(first, second, distances, float(np.exp(hyper[-1])), same)
    return np.asarray(np.tensordot(np.exp(2 * hyper[:-1]), parts, 1))


@dataclass(frozen=True)
class Evidence:
    """Measured rows and squared distances of their postures."""

    rows: Rows
    distances: SquaredDistances


def measured_covariance(hyper: Real, evidence: Evidence) -> Real:
    """Compute the covariance of the measured rows including measurement noise, (n, n)."""
    rows = evidence.rows
    return covariance(hyper, rows, rows, evidence.distances, same=True) + np.diag(rows.noise**2)


def log_posterior(hyper: Real, evidence: Evidence) -> tuple[float, Real]:
    """Compute the logarithm of marginal likelihood times prior, and its gradient over ``hyper`` (logarithms h).

    ``-(r^T A^-1 r + log det A) / 2 - sum ((h - log median) / log factor)^2 / 2`` (Rasmussen & Williams 2006, Eqs. 2.30
    and 5.9).
    """
    rows, step = evidence.rows, 1e-4
    parts = _covariance_parts(rows, rows, evidence.distances, float(np.exp(hyper[-1])), True)
    squares = np.exp(2 * hyper[:-1])
    matrix = np.tensordot(squares, parts, 1) + np.diag(rows.noise**2)
    factor = scipy.linalg.cho_factor(matrix, lower=True)
    weights = scipy.linalg.cho_solve(factor, rows.value)
    outer = np.outer(weights, weights) - scipy.linalg.cho_solve(factor, np.eye(len(rows)))
    # the amplitudes enter as squares; the length scale is differentiated by a forward difference
    longer = _covariance_parts(rows, rows, evidence.distances, float(np.exp(hyper[-1] + step)), True)
    slopes = np.append(
        squares * np.tensordot(parts, outer, 2), np.sum(np.tensordot(squares, longer - parts, 1) * outer) / (2 * step)
    )
    prior = (hyper - np.log(MEDIANS)) / np.log(FACTORS)
    half_log_det = float(np.sum(np.log(np.diag(factor[0]))))
    logarithm = -0.5 * float(rows.value @ weights) - half_log_det - 0.5 * float(prior @ prior)
    return logarithm, slopes - prior / np.log(FACTORS)


def best_hyperparameters(evidence: Evidence, start: Real, fixed: Sequence[int] = ()) -> Real:
    """Find the logarithms of the hyperparameters with the largest posterior; indices in ``fixed`` keep their start."""

    def negative(hyper: Real) -> tuple[float, Real]:
        value, slope = log_posterior(hyper, evidence)
        return -value, -slope

    middle, spread = np.log(MEDIANS), np.log(FACTORS)
    bounds = np.column_stack([middle - 3.5 * spread, middle + 3.5 * spread])
    bounds[list(fixed)] = start[list(fixed), None]
    options = {"maxiter": 60}
    optimum = scipy.optimize.minimize(negative, start, jac=True, method="L-BFGS-B", bounds=bounds, options=options)
    return np.asarray(optimum.x)


def drawn_hyperparameters(evidence: Evidence, best: Real, fixed: Sequence[int] = ()) -> Real:
    """Draw logarithms of the hyperparameters from their posterior, (n_draws, n_hyperparameters).

    Draws of a t distribution about the best values, with the curvature there, are weighted by the posterior over their
    density and drawn again (sampling, importance resampling: Rubin 1988). Hyperparameters with an index in ``fixed``
    keep their best value.
    """
    size, count, freedom = len(best), POSTURES.hyperparameter_draws, POSTURES.proposal_freedom
    rng, step = np.random.default_rng(0), 0.05
    slopes = [
        (log_posterior(best + step * unit, evidence)[1] - log_posterior(best - step * unit, evidence)[1]) / (2 * step)
        for unit in np.eye(size)
    ]
    curvature = -(np.array(slopes) + np.array(slopes).T) / 2
    values, vectors = np.linalg.eigh(curvature)
    # no direction is proposed much wider than the prior, not even one without curvature
    spread = vectors / np.sqrt(np.maximum(values, 0.3 / np.log(FACTORS).max() ** 2))
    spread[list(fixed)] = 0.0
    n_proposed = 6 * count
    widening = np.sqrt(freedom / rng.chisquare(freedom, n_proposed))
    normal = rng.normal(size=(n_proposed, size))
    proposed = best + widening[:, None] * (normal @ spread.T)
    heights = np.array([log_posterior(hyper, evidence)[0] for hyper in proposed])
    density = -(freedom + size) / 2 * np.log1p(np.sum((widening[:, None] * normal) ** 2, axis=1) / freedom)
    weights = np.exp(heights - density - (heights - density).max())
    weights = np.minimum(weights, weights.sum() / count * 1.5)  # so that no single draw dominates
    chosen = rng.choice(n_proposed, count, p=weights / weights.sum())
    return np.asarray(proposed[np.sort(chosen)])
