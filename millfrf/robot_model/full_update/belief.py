"""Most probable parameters of a robot, their uncertainty, and the posture to measure next."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Real

from ..kinematics.mechanism import Mechanism, close_loops
from ..spatial.spatial_robot import SpatialRobot
from .changed_structure import UpdateParameter
from .matrices import posture_system
from .misfit import Problem, Sums, sums_at, weighed
from .posed_receptance import PosedReceptance
from .posture_response import receptance_of

STAGES = (0.05, 0.02, 0.02, 0.01, 0.005)
"""How far modes may be off while the numbers are sought: from a coarse likelihood without traps to a fine one."""

LEAST_OFF = 7e-4
"""Deviation of a right model's modes that is always left: one beam element a link shifts them by 0.02 to 0.15 %."""

NOISE_LIKE = 1.3
"""Errors over the noise from which further starts are tried."""

MODES_OFF = np.geomspace(LEAST_OFF, 0.2, 25)
"""Values of the modes' deviation among which the most probable one is chosen."""


@dataclass(frozen=True)
class Belief:
    """What the measurements say of the freed numbers.

    Parameters
    ----------
    x : (n_parameters,)
        Most probable differences.
    covariance : (n_parameters, n_parameters)
        Laplace's covariance about them.
    scale
        Variance of the whitened errors: 1 where the stated noise holds.
    modes_off
        Standard deviation of the modes' relative frequencies about the robot's, as the measurements show it.
    """

    x: Real
    covariance: Real
    scale: float
    modes_off: float

    @property
    def errors(self) -> Real:
        """Standard errors, (n_parameters,)."""
        return np.sqrt(np.diag(self.covariance))


def sought(problem: Problem) -> Belief:
    """Seek the most probable numbers from the file's; from further starts too where that leaves more than noise.

    Each stage takes the misfit of the one before as its noise, so that the belief holds the numbers until the
    measurements are near enough to lead them.
    """
    best, least = _staged(problem, np.zeros(len(problem.parameters)))
    if least > NOISE_LIKE:
        for start in _further_starts(problem.parameters):
            x, misfit = _staged(problem, start)
            if misfit < least:
                best, least = x, misfit
            if least < NOISE_LIKE:
                break
    if least > NOISE_LIKE:
        for start in _other_side(problem.parameters, best):
            x, misfit = _staged(problem, start)
            if misfit < least:
                best, least = x, misfit
    return settled(problem, best)


def _other_side(parameters: Sequence[UpdateParameter], x: Real) -> list[Real]:
    """The same numbers with the payload on the other side of the tool's axis: near no mass, its place has no slope."""
    starts = []
    for axes in ((0, 1), (0,), (1,)):
        turned = np.array([one.kind == "payload" and one.axis in axes for one in parameters])
        starts.append(np.where(turned, -x, x))
    return starts


def _staged(problem: Problem, x: Real) -> tuple[Real, float]:
    """Numbers after all stages, and the root mean square of the errors that they leave, in units of the noise."""
    for off in STAGES:
        scale = max(1.0, _mean_square(problem, x))
        x, _ = descended(problem, x, scale, off, steps=10)
    return x, float(np.sqrt(_mean_square(problem, x)))


def _mean_square(problem: Problem, x: Real) -> float:
    try:
        sums = sums_at(problem, x)
    except (scipy.linalg.LinAlgError, np.linalg.LinAlgError):
        return np.inf
    return sum(one.rr for one in sums) / sum(one.count for one in sums)


def _further_starts(parameters: Sequence[UpdateParameter]) -> list[Real]:
    """Stiffer and softer joints, a lighter and a heavier end, and a tool that gives way."""
    starts = []
    for kind, axis, size in (
        ("payload", 3, -8.0),
        ("tool", 0, 1e-7),
        ("stiffness", 0, -0.3),
        ("stiffness", 0, 0.3),
        ("payload", 3, 8.0),
        ("base", 0, 1e-8),
    ):
        starts.append(np.array([size if (one.kind, one.axis) == (kind, axis) else 0.0 for one in parameters]))
    return starts


def settled(problem: Problem, x: Real, held: NDArray[np.bool_] | None = None, rounds: int = 3) -> Belief:
    """Refine numbers near the best, with the noise's size and the modes' deviation estimated in turn.

    Parameters
    ----------
    held : (n_parameters,), bool, or None
        Numbers that stay where they are.
    """
    scale, off = 1.0, STAGES[-1]
    for _ in range(rounds):
        x, _ = descended(problem, x, scale, off, held)
        sums = sums_at(problem, x)
        scale = noise_scale(sums)
        off = modes_deviation(problem, sums, scale)
    x, _ = descended(problem, x, scale, off, held)
    return Belief(x, covariance_of(problem, sums_at(problem, x), scale, off), scale, off)


def covariance_of(problem: Problem, sums: Sequence[Sums], scale: float, off: float) -> Real:
    """Laplace's covariance: the inverse of Fisher's information and the belief before."""
    root = np.sqrt(problem.precision)
    matrix = weighed(sums, scale, off)[2] / np.outer(root, root) + np.eye(len(root))
    return np.asarray(np.linalg.inv(matrix) / np.outer(root, root))


def noise_scale(sums: Sequence[Sums]) -> float:
    """Variance of the whitened errors, at least 1, with what neighbouring lines share counted once."""
    spare = float(np.mean([one.outside for one in sums]))
    shared = max(1 + 2 * one.likeness for one in sums)
    return max(spare, 1.0) * shared


def modes_deviation(problem: Problem, sums: Sequence[Sums], scale: float) -> float:
    """The modes' deviation with most evidence (restricted likelihood, Patterson & Thompson 1971)."""
    return float(min(MODES_OFF, key=lambda off: _evidence_against(problem, sums, scale, float(off))))


def _evidence_against(problem: Problem, sums: Sequence[Sums], scale: float, off: float) -> float:
    misfit, gradient, matrix = weighed(sums, scale, off)
    whole = matrix + np.diag(problem.precision)
    value = misfit - float(gradient @ np.linalg.solve(whole, gradient)) + float(np.linalg.slogdet(whole)[1])
    for one in sums:
        value += float(np.linalg.slogdet(np.eye(len(one.gg)) + off**2 * one.gg / scale)[1])
    return value


def descended(
    problem: Problem, x: Real, scale: float, off: float, held: NDArray[np.bool_] | None = None, steps: int = 25
) -> tuple[Real, float]:
    """Levenberg-Marquardt descent of misfit plus belief (Nocedal & Wright, section 10.3); numbers and their value."""
    free = np.ones(len(x), dtype=bool) if held is None else ~np.asarray(held, dtype=bool)
    precision = problem.precision
    lift, current = 1e-3, _at(problem, x, scale, off)
    if current is None:
        return x, np.inf
    for _ in range(steps):
        value, gradient, matrix = current
        whole = (matrix + np.diag(precision))[np.ix_(free, free)]
        slope = (gradient + precision * x)[free]
        step = np.zeros_like(x)
        step[free] = -np.linalg.solve(whole + lift * np.diag(np.diag(whole)), slope)
        step /= max(1.0, float(np.max(np.abs(step) * np.sqrt(precision))) / 0.7)
        trial = _at(problem, x + step, scale, off)
        if trial is None or trial[0] > value:
            lift *= 8
            if lift > 1e6:
                break
            continue
        x, current, lift = x + step, trial, max(lift / 5, 1e-9)
        if value - trial[0] < 1e-3 + 1e-7 * value:
            break
    return x, current[0]


def _at(problem: Problem, x: Real, scale: float, off: float) -> tuple[float, Real, Real] | None:
    """Misfit plus belief, and the misfit's gradient and matrix; None where the numbers leave no robot."""
    try:
        misfit, gradient, matrix = weighed(sums_at(problem, x), scale, off)
    except (scipy.linalg.LinAlgError, np.linalg.LinAlgError):
        return None
    return misfit + float(problem.precision @ x**2), gradient, matrix


def added_parts(parameters: Sequence[UpdateParameter]) -> NDArray[np.bool_]:
    """Whether a number stands for a part that the file does not have, and that cannot be negative."""
    return np.array([one.kind in ("tool", "base", "joint damping") for one in parameters], dtype=bool)


def without_doubtful_parts(problem: Problem, found: Belief) -> Belief:
    """Put added springs and dampers that are not above twice their error at zero, and settle the others anew.

    A tool or a base that gives way, and a joint's own damper, are parts of their own in the file: they are added where
    they are seen. Their errors stay.
    """
    springs = added_parts(problem.parameters)
    held = np.zeros(len(found.x), dtype=bool)
    for _ in range(3):
        low = springs & ~held & (found.x < 2 * found.errors)
        if not low.any():
            break
        held |= low
        x = np.where(held, 0.0, found.x)
        found = replace(settled(problem, x, held, rounds=2))
    return found


CANDIDATES = 40
"""Postures within the joints' limits that are weighed beside those of the file."""

LINES = 60
"""Lines on which a candidate's information is computed; it is scaled to the measured number of lines."""


@dataclass(frozen=True)
class NextPosture:
    """The posture to measure next.

    Parameters
    ----------
    name
        Name in the robot's file, or "".
    driven : (n_active,), rad or m
        Driven joint values.
    gain : float
        Expected information gain about the freed numbers, nats (Lindley 1956).
    sharpens
        The numbers whose errors fall most, each with the factor that is left of its error.
    """

    name: str
    driven: Real
    gain: float
    sharpens: tuple[tuple[str, float], ...]


def next_posture(
    robot: SpatialRobot, poses: Mapping[str, Real], problem: Problem, found: Belief, seed: int = 0
) -> NextPosture | None:
    """Weigh the postures of the file and random ones within the limits; None where none can be reached.

    ``gain = ln det(I + F C) / 2`` with Fisher's information F of the candidate and the covariance C now.

    Parameters
    ----------
    robot
        The robot as its file has it.
    poses
        Postures of its file, driven joint values.
    problem, found
        What was measured, and the belief after it.
    seed
        Seed of the random postures.
    """
    candidates = [(name, driven) for name, driven in poses.items()]
    candidates += [("", driven) for driven in _random_postures(robot.mechanism, poses, seed)]
    best: NextPosture | None = None
    for name, driven in candidates:
        information = _information(robot, problem, found, driven)
        if information is None:
            continue
        after = np.asarray(np.linalg.inv(np.linalg.inv(found.covariance) + information))
        gain = 0.5 * float(np.linalg.slogdet(np.eye(len(after)) + information @ found.covariance)[1])
        if best is None or gain > best.gain:
            best = NextPosture(name, driven, gain, _sharpened(problem.parameters, found, after))
    return best


def _sharpened(parameters: Sequence[UpdateParameter], found: Belief, after: Real) -> tuple[tuple[str, float], ...]:
    left = np.sqrt(np.diag(after)) / found.errors
    order = [i for i in np.argsort(left) if found.errors[i] > 0.05 * parameters[i].spread][:3]
    return tuple((parameters[i].name, float(left[i])) for i in order)


def _random_postures(mechanism: Mechanism, poses: Mapping[str, Real], seed: int) -> list[Real]:
    generator = np.random.default_rng(seed)
    centre = next(iter(poses.values()), np.zeros(int(mechanism.active.sum())))
    frames = [mechanism.frames[i] for i in mechanism.moving if mechanism.frames[i].active]
    low = np.array([max(frame.lower, c - np.pi / 3) for frame, c in zip(frames, centre, strict=True)])
    high = np.array([min(frame.upper, c + np.pi / 3) for frame, c in zip(frames, centre, strict=True)])
    return [generator.uniform(low, np.maximum(high, low)) for _ in range(CANDIDATES)]


def _information(robot: SpatialRobot, problem: Problem, found: Belief, driven: Real) -> Real | None:
    """Fisher's information of a candidate, measured as well as the first posture was."""
    first = problem.postures[0][0]
    try:
        q = close_loops(robot.mechanism, driven)
    except Exception:  # a posture that a closed loop does not reach is no candidate
        return None
    frequencies = np.linspace(first.frequencies[0], first.frequencies[-1], LINES)
    system = posture_system(robot, problem.parameters, q, first.axes, first.sensor)
    try:
        values = receptance_of(system, problem.parameters, found.x, frequencies, first.rows, first.columns)
    except np.linalg.LinAlgError:  # what was found takes more mass away than moves in this posture
        return None
    p, c = len(first.rows), len(first.columns)
    noise = _relative_noise(first) * np.sqrt(np.mean(np.abs(values) ** 2, axis=(1, 2)))
    left = np.eye(p, dtype=complex) / noise[:, None, None]
    right = np.broadcast_to(np.eye(c, dtype=complex), (LINES, c, c))
    many = len(first.frequencies) / LINES * first.independent
    asked = PosedReceptance(
        "", q, first.axes, frequencies, first.rows, first.columns, values, left, right, independent=many
    )
    sums = sums_at(Problem(problem.parameters, ((asked, system),)), found.x)
    return weighed(sums, found.scale, found.modes_off)[2]


def _relative_noise(measured: PosedReceptance) -> float:
    """Noise of a line over the size of its matrix, in the median; 2 % for a modal model."""
    if measured.projection is not None:
        return 0.02
    size = np.sqrt(np.mean(np.abs(measured.values) ** 2, axis=(1, 2)))
    whitened = np.sqrt(np.mean(np.abs(measured.left @ measured.values @ measured.right) ** 2, axis=(1, 2)))
    return float(np.median(size / np.maximum(size * whitened, 1e-300)))
