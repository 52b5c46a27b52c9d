"""Recordings of robots with something concealed, in one or more postures; posture in degrees."""

from dataclasses import replace

import numpy as np

from mismatch import BandRecording
from mismatch.adapters.robot import ROBOT as ROBOT_SETTINGS
from mismatch.adapters.robot import PosedRecording, PosedRobot, posed
from robot_model import SpatialRobot, frf_at, read_spatial_robot

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
    names = tuple(kind + label[-1].lower() for kind in "fa" for label in labels)
    return BandRecording(f"posture {seed + 1}", RATE, *noisy, np.full(len(columns), 2), names)


def in_postures(
    truth: SpatialRobot, count: int, offset: np.ndarray = NOTHING, seconds: float = 12.0
) -> list[PosedRecording]:
    """Recordings of a robot whose joints stand ``offset`` (deg) beside where they are said to stand."""
    recorded = [milled(truth, posture + offset, i, seconds=seconds) for i, posture in enumerate(POSTURES[:count])]
    return [posed(one, np.radians(q), BAND) for one, q in zip(recorded, POSTURES[:count], strict=True)]


def heavy_elbow() -> SpatialRobot:
    """Something that no candidate stands for: the elbow's body weighs more than twice as much."""
    bodies = list(ROBOT.bodies)
    bodies[1] = replace(bodies[1], mass=2.2 * bodies[1].mass)
    return replace(ROBOT, bodies=tuple(bodies))


def small_case(truth: SpatialRobot = ROBOT, count: int = 1, seconds: float = 6.0) -> PosedRobot:
    """The robot as modelled against short recordings of another, four modes of which may deviate."""
    recordings = tuple(in_postures(truth, count, seconds=seconds))
    return PosedRobot(ROBOT, False, recordings, np.zeros(3), ROBOT_SETTINGS.lab, (4,) * count)
