"""Which posture to measure next: the one with most expected information about the freed numbers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..kinematics import Mechanism, close_loops
from ..spatial import SpatialRobot
from .belief import Belief
from .misfit import Problem, sums_at, weighed
from .posed_receptance import PosedReceptance
from .response import UpdateParameter, posture_system, receptance_of

Real = NDArray[np.float64]

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
