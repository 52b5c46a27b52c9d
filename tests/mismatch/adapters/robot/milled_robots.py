"""Recordings of robots with something concealed, in one or more postures; posture in degrees."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimation import BandRecording, channels_of
from millfrf.mismatch import ROBOT as ROBOT_SETTINGS
from millfrf.mismatch import PosedRecording
from millfrf.mismatch.robot.fit import FitProblem, FitState
from millfrf.mismatch.robot.posed import Changes, PosedRobot
from millfrf.mismatch.robot.receptance import RobotModes, posed
from millfrf.robot_model import SpatialRobot, read_spatial_robot
from millfrf.robot_model.spatial.spatial_modes import frf_at

Real = NDArray[np.float64]

NAME = "kuka_kr90_r3100"
ROBOT = read_spatial_robot(NAME).robot
POSTURES = np.array([[0, -10, 100, 0, 90, 0], [20, 25, 70, 40, 60, 0], [-15, 45, 30, 80, -50, 0]])
BAND = (5.0, 45.0)
RATE = 160.0
TIP = ("TCP:+X", "TCP:+Y", "TCP:+Z")
NOTHING = np.zeros(6)


def milled(
    truth: SpatialRobot,
    posture: np.ndarray,
    seed: int,
    *,
    labels: tuple[str, ...] = TIP,
    seconds: float = 12.0,
    noise: float = 0.02,
) -> BandRecording:
    """Broad forces at the tip and the accelerations they cause, exactly by all modes; noise on both; posture in deg."""
    rng = np.random.default_rng(seed)
    columns = [TIP.index(label) for label in labels]
    n = int(seconds * RATE)
    lines = np.fft.rfftfreq(n, 1 / RATE)
    pushed = np.zeros((len(lines), 3), dtype=complex)
    pushed[:, columns] = np.fft.rfft(200 * rng.normal(size=(n, len(columns))), axis=0)
    pushed[lines > 0.45 * RATE] = 0
    moved = np.einsum("kpq,kq->kp", frf_at(truth, np.radians(posture), lines).values, pushed)
    force = np.fft.irfft(pushed, n=n, axis=0)[:, columns]
    response = np.fft.irfft(moved * (2j * np.pi * lines[:, None]) ** 2, n=n, axis=0)[:, columns]
    noisy = [part + noise * part.std(axis=0) * rng.normal(size=part.shape) for part in (force, response)]
    channels = [
        channels_of(quantity, labels, [quantity[0] + label[-1].lower() for label in labels])
        for quantity in ("force", "acceleration")
    ]
    return BandRecording(f"posture {seed + 1}", RATE, noisy[0], noisy[1], *channels)


def in_postures(
    truth: SpatialRobot, count: int, offset: np.ndarray = NOTHING, seconds: float = 12.0
) -> list[PosedRecording]:
    """Recordings of a robot whose joints stand ``offset`` (deg) beside where they are said to stand."""
    recorded = [milled(truth, posture + offset, i, seconds=seconds) for i, posture in enumerate(POSTURES[:count])]
    return [posed(each, np.radians(q), BAND) for each, q in zip(recorded, POSTURES[:count], strict=True)]


def heavy_elbow() -> SpatialRobot:
    """Something that no candidate stands for: the elbow's body weighs more than twice as much."""
    bodies = list(ROBOT.bodies)
    bodies[1] = replace(bodies[1], mass=2.2 * bodies[1].mass)
    return replace(ROBOT, bodies=tuple(bodies))


def small_case(truth: SpatialRobot = ROBOT, count: int = 1, seconds: float = 6.0) -> PosedRobot:
    """The robot as modelled against short recordings of another, four modes of which may deviate."""
    recordings = tuple(in_postures(truth, count, seconds=seconds))
    return PosedRobot(ROBOT, False, recordings, np.zeros(3), ROBOT_SETTINGS.lab, (4,) * count)


def white_noise(case: PosedRobot) -> list[NDArray[np.complex128]]:
    """Whitening as if noise were three per cent of each response."""
    made = []
    for each in case.recordings:
        level = 0.03 * np.sqrt(np.mean(np.abs(each.spectrum.measured) ** 2, axis=0))
        shape = (len(each.spectrum.frequencies), len(level), len(level))
        made.append(np.broadcast_to(np.diag(1 / level).astype(complex), shape))
    return made


def cost_at(
    case: PosedRobot, changes: Changes, white: list[NDArray[np.complex128]], u: Real, reference: RobotModes
) -> float:
    """Cost at any point, the modes in the order and with the signs of a reference."""
    modes = case.modes(changes)[0].aligned(reference)
    return FitState(FitProblem(case, tuple(white)), changes, (modes,), (u,)).cost


def shifted(changes: Changes, which: int, by: float) -> Changes:
    """One number's coordinate shifted."""
    change, number = changes[which]
    return (*changes[:which], (change, change.from_fit(change.to_fit(number) + by)), *changes[which + 1 :])
