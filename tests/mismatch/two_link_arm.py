"""A hanging arm of two links with dry friction in both joints, linearised in its joint angles and integrated alone.

Masses, lengths and inertias are of the size of a table-top double pendulum.
"""

import numpy as np
from numpy.typing import NDArray

from acquisition import Channel
from estimation import BandRecording
from modal_fit import ModalModel

Real = NDArray[np.float64]

MASS = np.array([[0.151, 0.0855], [0.0855, 0.0557]])  # kg m^2, for the angle of the first joint and of the second
STIFFNESS = np.array([[3.86, 1.61], [1.61, 1.61]])  # N m/rad, by gravity
DAMPING = 0.03  # N m s/rad, in each joint
SUBSTEPS = 20

LABELS = ("J1:+RZ", "J2:+RZ")


def arm_model(damping: float = DAMPING) -> ModalModel:
    """The arm without friction."""
    inverse = np.linalg.inv(MASS)
    system = np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ STIFFNESS, -damping * inverse]])
    poles, shapes = np.linalg.eig(system)
    kept = np.flatnonzero(poles.imag > 0)
    left = (np.linalg.inv(shapes) @ np.vstack([np.zeros((2, 2)), inverse]))[kept]
    return ModalModel(poles[kept], shapes[:2, kept].T, left, LABELS, LABELS, "receptance", "rad/(N m)")


def torques(rate: float, seconds: float, level: float = 1.0, seed: int = 1) -> Real:
    """Sums of slow sines around both modes, (n_samples, 2), N m."""
    time, rng = np.arange(int(rate * seconds)) / rate, np.random.default_rng(seed)
    sines = [
        0.12 * np.sin(2 * np.pi * hz * time + rng.uniform(0, 6.28, 2)[:, None]) for hz in (0.4, 0.7, 1.1, 1.6, 2.3)
    ]
    return level * np.sum(sines, axis=0).T * np.minimum(time / 0.5, 1.0)[:, None]


def integrated(torque: Real, rate: float, friction: tuple[float, float], damping: float = DAMPING) -> Real:
    """Angles (n_samples, 2) from rest, by Moreau's midpoint rule: friction is an impulse of at most h times its moment.

    The impulses of both joints are balanced in turn until they agree.
    """
    h = 1 / (SUBSTEPS * rate)
    inverse = np.linalg.inv(MASS + h * damping * np.eye(2))
    angles, x, v, impulse = np.zeros_like(torque), np.zeros(2), np.zeros(2), np.zeros(2)
    for k in range(len(torque) - 1):
        for sub in range(SUBSTEPS):
            share = (sub + 0.5) / SUBSTEPS
            drive = torque[k] * (1 - share) + torque[k + 1] * share
            free = inverse @ (MASS @ v + h * (drive - STIFFNESS @ (x + 0.5 * h * v)))
            for _ in range(10 if any(friction) else 0):
                for i in range(2):
                    rest = free[i] - inverse[i] @ impulse + inverse[i, i] * impulse[i]
                    impulse[i] = min(max(rest / inverse[i, i], -h * friction[i]), h * friction[i])
            after = free - inverse @ impulse
            x, v = x + 0.5 * h * (v + after), after
        angles[k + 1] = x
    return angles


def arm_recording(name: str, rate: float, torque: Real, angles: Real) -> BandRecording:
    """Moments and angles of both joints, each (n_samples, 2), as a recording."""
    moments, turned = (
        tuple(Channel(f"{letter}{k}", quantity, unit, f"J{k}", "+RZ") for k in (1, 2))
        for letter, quantity, unit in (("M", "moment", "N m"), ("q", "angle", "rad"))
    )
    return BandRecording(name, rate, torque, angles, moments, turned)
