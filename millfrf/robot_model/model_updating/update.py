"""Update of all uncertain parameters of a robot from measurements, and the posture to measure next."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import InputError, Real

from ..kinematics.mechanism import Mechanism, close_loops
from ..settings import UPDATE
from ..spatial.spatial_robot import SpatialRobot
from .changed_structure import UpdateParameter, body_masses, free_parameters
from .matrices import posture_system
from .posed_receptance import PosedReceptance
from .posterior import (
    Posterior,
    Problem,
    added_parts,
    descend,
    laplace_covariance,
    marginal_misfit,
    misfit_of,
    most_probable,
    problem_of,
    sums_at,
    without_insignificant_parts,
)
from .posture_response import PostureResponse


@dataclass(frozen=True)
class NextPosture:
    """The posture to measure next."""

    name: str  # name in the robot's file, or ""
    driven: Real  # (n_active,), rad or m: driven joint values
    gain: float  # expected information gain about the free parameters, nats (Lindley 1956)
    sharpens: tuple[tuple[str, float], ...]  # parameters whose errors fall most, each with error after over before


def next_posture(
    robot: SpatialRobot, poses: Mapping[str, Real], problem: Problem, posterior: Posterior
) -> NextPosture | None:
    """Choose the most informative posture among those of the file and 40 random postures within the joint limits.

    ``gain = ln det(I + F C) / 2`` with Fisher's information F of the candidate and the present covariance C. Return
    None if no posture can be reached.
    """
    candidates = [*poses.items(), *(("", driven) for driven in _random_postures(robot.mechanism, poses))]
    best: NextPosture | None = None
    for name, driven in candidates:
        information = _information(robot, problem, posterior, driven)
        if information is None:
            continue
        after = np.asarray(np.linalg.inv(np.linalg.inv(posterior.covariance) + information))
        gain = 0.5 * float(np.linalg.slogdet(np.eye(len(after)) + information @ posterior.covariance)[1])
        if best is None or gain > best.gain:
            best = NextPosture(name, driven, gain, _sharpened(problem, posterior, after))
    return best


def _sharpened(problem: Problem, posterior: Posterior, after: Real) -> tuple[tuple[str, float], ...]:
    ratio, parameters = np.sqrt(np.diag(after)) / posterior.errors, problem.parameters
    order = [i for i in np.argsort(ratio) if posterior.errors[i] > 0.05 * parameters[i].spread][:3]
    return tuple((parameters[i].name, float(ratio[i])) for i in order)


def _random_postures(mechanism: Mechanism, poses: Mapping[str, Real]) -> list[Real]:
    """Draw random postures within the joint limits and within 60 degrees of the file's first posture."""
    generator = np.random.default_rng(0)
    centre = next(iter(poses.values()), np.zeros(int(mechanism.active.sum())))
    frames = [mechanism.frames[i] for i in mechanism.moving if mechanism.frames[i].active]
    low = np.array([max(frame.lower, c - np.pi / 3) for frame, c in zip(frames, centre, strict=True)])
    high = np.array([min(frame.upper, c + np.pi / 3) for frame, c in zip(frames, centre, strict=True)])
    return [generator.uniform(low, np.maximum(high, low)) for _ in range(40)]


def _information(robot: SpatialRobot, problem: Problem, posterior: Posterior, driven: Real) -> Real | None:
    """Compute Fisher's information of a candidate posture, measured as precisely as the first measured posture."""
    first, n_lines = problem.postures[0][0], 60
    try:
        q = close_loops(robot.mechanism, driven)
    except (InputError, np.linalg.LinAlgError):  # a closed loop does not reach this posture
        return None
    frequencies = np.linspace(first.frequencies[0], first.frequencies[-1], n_lines)
    system = posture_system(robot, problem.parameters, q, first.axes, first.sensor)
    try:
        response = PostureResponse(system, problem.parameters, posterior.x, frequencies, first.rows, first.columns)
        values = response.receptance()
    except np.linalg.LinAlgError:  # the posterior takes off more mass than moves in this posture
        return None
    p, c = len(first.rows), len(first.columns)
    noise = _relative_noise(first) * np.sqrt(np.mean(np.abs(values) ** 2, axis=(1, 2)))
    left = np.eye(p, dtype=complex) / noise[:, None, None]
    right = np.broadcast_to(np.eye(c, dtype=complex), (n_lines, c, c))
    # fewer lines than measured are computed, and their information is scaled up
    share = len(first.frequencies) / n_lines * first.independent
    expected = PosedReceptance(
        "", q, first.axes, frequencies, first.rows, first.columns, values, left, right, independent=share
    )
    sums = sums_at(Problem(problem.parameters, ((expected, system),)), posterior.x)
    return marginal_misfit(sums, posterior.scale, posterior.modes_off)[2]


def _relative_noise(measured: PosedReceptance) -> float:
    """Compute the median over the lines of noise relative to the size of the receptance; 2 % for a modal model."""
    if measured.projection is not None:
        return 0.02
    size = np.sqrt(np.mean(np.abs(measured.values) ** 2, axis=(1, 2)))
    whitened = np.sqrt(np.mean(np.abs(measured.left @ measured.values @ measured.right) ** 2, axis=(1, 2)))
    return float(np.median(size / np.maximum(size * whitened, 1e-300)))


@dataclass(frozen=True)
class OpenDirection:
    """A combination of parameters that the measured postures do not determine."""

    names: tuple[str, ...]  # parameters of the combination, largest first
    parts: tuple[float, ...]  # their components in the unit vector, in units of the prior standard deviations
    left: float  # posterior over prior standard deviation along the direction

    @property
    def sentence(self) -> str:
        """Write a sentence that names the combination."""
        share = f"{100 * self.left:.0f} % of the prior standard deviation is left"
        if len(self.names) == 1:
            return f"not determined here: {self.names[0]} ({share})"
        listed = ", ".join(self.names[:-1]) + f" and {self.names[-1]}"
        return f"determined only in combination here: {listed} ({share})"


def _open_directions(parameters: Sequence[UpdateParameter], covariance: Real) -> tuple[OpenDirection, ...]:
    """Find the combinations of parameters that stay as uncertain as before the measurements.

    They are eigenvectors of ``D^-1 C D^-1`` with a large eigenvalue; C is the posterior covariance, and D contains the
    prior standard deviations.
    """
    spread = np.array([parameter.spread for parameter in parameters])
    values, vectors = np.linalg.eigh(covariance / np.outer(spread, spread))
    directions = []
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        if value < UPDATE.undetermined_ratio**2:
            break
        order = [i for i in np.argsort(-np.abs(vector)) if abs(vector[i]) > 0.35]  # smaller parts are not listed
        names = tuple(parameters[i].name for i in order)
        directions.append(OpenDirection(names, tuple(float(vector[i]) for i in order), float(np.sqrt(value))))
    return tuple(directions)


@dataclass(frozen=True)
class HeldOutPosture:
    """Errors on one measurement that an update did not use, in units of the measurement's noise: 1 is noise alone."""

    name: str
    before: float  # error of the robot as its file has it
    after: float  # error of the robot as updated without this measurement
    expected: float  # error that a correct robot has: noise, undetermined parameters, least errors of the modes
    x: Real  # (n_parameters,): parameters of that update


def _held_out(problem: Problem, posterior: Posterior) -> tuple[HeldOutPosture, ...]:
    """Update without each measurement in turn, and compute the errors on the measurement that was left out.

    Of a single FRF, every second of eight blocks of lines is left out. A single modal model gives an empty result.
    """
    measured, system = problem.postures[0]
    if len(problem.postures) > 1:
        names = [case.name for case, _ in problem.postures]
        splits = [(problem.without(i), problem.only(i)) for i in range(len(names))]
    elif measured.projection is None:
        block = np.arange(len(measured.frequencies)) * 8 // len(measured.frequencies)
        halves = [Problem(problem.parameters, ((measured.selected(block % 2 == s), system),)) for s in (0, 1)]
        names = [f"{measured.name}, half {side + 1} of the lines" for side in (0, 1)]
        splits = [(halves[0], halves[1]), (halves[1], halves[0])]
    else:
        return ()
    # springs and dampers that the update did not add stay at zero
    fixed = np.asarray(added_parts(problem.parameters) & (posterior.x == 0))
    results = []
    for name, (fitted, left_out) in zip(names, splits, strict=True):
        x, _ = descend(fitted, posterior.x, posterior.scale, posterior.modes_off, fixed)
        expected = _expected_error(fitted, left_out, posterior, x)
        before, after = (misfit_of(left_out, 0, values) for values in (np.zeros_like(x), x))
        results.append(HeldOutPosture(name, before, after, expected, x))
    return tuple(results)


def _expected_error(fitted: Problem, left_out: Problem, posterior: Posterior, x: Real) -> float:
    """Compute the error that a correct robot is expected to have, the root of ``1 + (tr(F C) + t^2 tr(G^T G)) / n``.

    It is limited, because otherwise every error would be accepted after a fit that determines nothing.
    """
    covariance = laplace_covariance(fitted, sums_at(fitted, x), posterior.scale, posterior.modes_off)
    sums = sums_at(left_out, x)[0]
    spread = float(np.trace(sums.jj @ covariance)) + UPDATE.least_modes_off**2 * float(np.trace(sums.gg))
    return min(float(np.sqrt(1 + spread / sums.count)), UPDATE.largest_expected_error)


def _determined(parameters: Sequence[UpdateParameter], posterior: Posterior) -> NDArray[np.bool_]:
    """Check for each parameter whether the measurements determine it."""
    determined = posterior.errors < UPDATE.determined_ratio * np.array([p.spread for p in parameters])
    sprung = any(p.kind == "tool" and value > 0 for p, value in zip(parameters, posterior.x, strict=True))
    for i, parameter in enumerate(parameters):
        # the place of a payload exists only where its mass is clearly not zero
        if parameter.kind == "payload" and parameter.axis == 3 and not abs(posterior.x[i]) > 3 * posterior.errors[i]:
            determined[[k for k, p in enumerate(parameters) if p.kind == "payload" and p.axis < 3]] = False
        # and the mass on a tool's spring only where there is a spring
        if parameter.kind == "sprung mass" and not sprung:
            determined[i] = False
    return np.asarray(determined)


def _significant(
    robot: SpatialRobot, problem: Problem, posterior: Posterior, held_out: Sequence[HeldOutPosture]
) -> NDArray[np.bool_]:
    """Check for each parameter whether it certainly differs from the file, (n_parameters,).

    The difference must exceed a multiple of its error (Bonferroni threshold) and the least difference of its kind, in
    every fit. The error is the largest of three: from Laplace's covariance, from Laplace's covariance with the masses
    of the bodies free, and from the jackknife over updates that leave one measurement out.
    """
    parameters = problem.parameters
    with_masses_free, errors = _with_masses_free(robot, problem, posterior)
    errors = np.maximum(np.maximum(errors, posterior.errors), _jackknife(held_out, len(parameters)))
    threshold = float(scipy.stats.norm.isf(UPDATE.significance / (2 * len(parameters))))
    named = _determined(parameters, posterior)
    for x in (posterior.x, with_masses_free, *(case.x for case in held_out)):
        named &= (np.abs(x) > threshold * errors) & (np.sign(x) == np.sign(posterior.x))
    named &= np.abs(posterior.x) > np.array([UPDATE.least_difference[parameter.kind] for parameter in parameters])
    places = [parameter.kind == "payload" and parameter.axis < 3 for parameter in parameters]
    return np.asarray(named & ~np.array(places))


def _with_masses_free(robot: SpatialRobot, problem: Problem, posterior: Posterior) -> tuple[Real, Real]:
    """Compute parameters and errors after one Gauss-Newton step in which the bodies' masses are free, too."""
    n = len(problem.parameters)
    parameters = (*problem.parameters, *body_masses(robot))
    wider = problem_of(robot, parameters, [measured for measured, _ in problem.postures])
    x = np.concatenate([posterior.x, np.zeros(len(parameters) - n)])
    sums = sums_at(wider, x)
    covariance = laplace_covariance(wider, sums, posterior.scale, posterior.modes_off)
    gradient = marginal_misfit(sums, posterior.scale, posterior.modes_off)[1] + wider.precision * x
    shifted = x - covariance @ gradient
    return np.where(posterior.x == 0, 0.0, shifted[:n]), np.sqrt(np.diag(covariance))[:n]


def _jackknife(held_out: Sequence[HeldOutPosture], n: int) -> Real:
    """Compute standard errors from updates that leave one measurement out (Efron & Tibshirani, chapter 11)."""
    if len(held_out) < 2:
        return np.zeros(n)
    x = np.array([case.x for case in held_out])
    return np.asarray(np.sqrt((len(x) - 1) / len(x) * np.sum((x - x.mean(axis=0)) ** 2, axis=0)))


@dataclass(frozen=True)
class RobotUpdate:
    """An update of a robot's parameters by measurements.

    Parameters
    ----------
    parameters
        Parameters that were freed.
    x : (n_parameters,)
        Differences from the file, in the parameters' units; logarithms for stiffnesses, links and damping.
    covariance : (n_parameters, n_parameters)
        Covariance of x; widened by the held-out errors unless the verdict is none or explained.
    determined : (n_parameters,), bool
        Whether the measurements determine the parameter.
    named : (n_parameters,), bool
        Whether the number in the file is certainly wrong.
    verdict
        ``none``, ``explained``, ``partly explained`` or ``unexplained``.
    reason
        Reason of the verdict in one sentence.
    held_out
        Errors on the measurements that were left out.
    fitted : (n_postures,)
        Errors on the fitted measurements, in units of the noise.
    noise, modes_off
        Size of the noise over the stated noise; standard deviation of the modes' relative frequencies from the model.
    open
        Combinations of parameters that the postures do not determine.
    next
        Posture to measure next, or None.
    """

    parameters: tuple[UpdateParameter, ...]
    x: Real
    covariance: Real
    determined: NDArray[np.bool_]
    named: NDArray[np.bool_]
    verdict: str
    reason: str
    held_out: tuple[HeldOutPosture, ...]
    fitted: Real
    noise: float
    modes_off: float
    open: tuple[OpenDirection, ...]
    next: NextPosture | None

    @property
    def errors(self) -> Real:
        """Standard errors of x, (n_parameters,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters that are certainly wrong in the file."""
        return tuple(parameter.name for parameter, named in zip(self.parameters, self.named, strict=True) if named)


def update_robot(
    robot: SpatialRobot,
    measured: Sequence[PosedReceptance],
    poses: Mapping[str, Real] | None = None,
    *,
    plan: bool = True,
) -> RobotUpdate:
    """Update all parameters of a robot together by FRFs and modal models in one posture or more.

    The update minimises ``sum r^T (s^2 I + t^2 G G^T)^-1 r + sum x^2 / spread^2`` over the differences x from the file.
    r are the whitened errors, G their derivatives over errors of the modes, s^2 the variance of r, and t the standard
    deviation of the errors of the modes. s and t are estimated, too.

    Parameters
    ----------
    robot
        The robot as its file has it.
    measured
        Measurements, each in its posture.
    poses
        Postures of the file, driven values, that may be measured next; None: random ones only.
    plan
        Whether a posture to measure next is searched.

    Raises
    ------
    InputError
        No measurement, or a robot without masses.
    """
    if not measured:
        raise InputError("an update needs at least one measurement; give FRFs, modal models or recordings")
    parameters = free_parameters(robot)
    problem = problem_of(robot, parameters, measured)
    posterior = without_insignificant_parts(problem, most_probable(problem))
    held_out = _held_out(problem, posterior)
    fitted = np.array([misfit_of(problem, i, posterior.x) for i in range(len(problem.postures))])
    named = _significant(robot, problem, posterior, held_out)
    spread = np.array([parameter.spread for parameter in parameters])
    verdict, reason = _verdict(held_out, fitted, bool(named.any()), posterior.errors / spread)
    following = next_posture(robot, poses or {}, problem, posterior) if plan else None
    # an update that does not explain everything has the errors that remain on held-out measurements
    worst = max([1.0, *(case.after for case in held_out)]) if verdict not in ("none", "explained") else 1.0
    return RobotUpdate(
        parameters,
        posterior.x if verdict != "unexplained" else np.zeros_like(posterior.x),
        posterior.covariance * worst**2,
        _determined(parameters, posterior),
        named if verdict == "explained" else np.zeros_like(named),
        verdict,
        reason,
        held_out,
        fitted,
        float(np.sqrt(posterior.scale)),
        posterior.modes_off,
        _open_directions(parameters, posterior.covariance),
        following,
    )


def _verdict(held_out: Sequence[HeldOutPosture], fitted: Real, named: bool, errors: Real) -> tuple[str, str]:
    """Return the verdict and its reason; ``errors`` are those of the numbers over their prior standard deviations."""
    if not held_out:
        return (
            "partly explained",
            "one modal model alone does not permit a check of the update; measure a second posture",
        )
    noise = UPDATE.noise_ratio
    before, after, expected = np.array([(case.before, case.after, case.expected) for case in held_out]).T
    if before.max() <= noise and not named:
        return "none", "the robot's file predicts the measurements to their noise: they show no error"
    worse = [case.name for case in held_out if case.after > max(case.before, noise)]
    left, was = np.sum(np.maximum(after**2 - 1, 0)), np.sum(np.maximum(before**2 - 1, 0))
    # a posture left out is allowed what its fit does not determine; in a fitted posture nothing is undetermined
    if (after <= noise * expected).all() and fitted.max() <= noise and not worse:
        return "explained", "the updated robot predicts every posture that was left out to the noise"
    # errors of the numbers grow with the error that remains
    informs = bool((errors * max(1.0, after.max()) < UPDATE.determined_ratio).any())
    if not worse and left <= UPDATE.largest_remaining_share * was and informs:
        return "partly explained", (
            f"the updated robot predicts what was left out to {after.max():.3g} times the noise (before: "
            f"{before.max():.3g}): better, but an error remains that no freed parameter describes"
        )
    if not worse and left <= UPDATE.largest_remaining_share * was:
        return "unexplained", (
            f"the update still leaves {after.max():.3g} times the noise (before: {before.max():.3g}), so that the "
            "measurements determine none of its numbers: check posture, axes and band"
        )
    what = f"raises the error on {', '.join(worse)}" if worse else f"leaves {100 * left / max(was, 1e-300):.0f} % of it"
    return "unexplained", (
        f"the update {what} when left out: no freed parameter describes the error, or these measurements do not show it"
    )
