"""Small rigs, what a modal test says of them, and the forces that drive them."""

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from modal_fit import ModalModel

Real = NDArray[np.float64]
RATE, FINE, LEAD, SECONDS = 2048.0, 4, 3.0, 20.0  # Hz, Runge-Kutta steps a sample, run-in (s), recording (s)
MODAL_ERROR = (0.01, 0.10, 0.05)  # frequency, damping, shapes


@dataclass(frozen=True)
class Rig:
    """Undamped modes with modal damping: ``q'' + 2 z w q' + w^2 q = push^T F - joint g``, motion ``shown q``."""

    kind: str
    omega: Real
    zeta: Real
    shown: Real  # (n_responses, n_modes)
    push: Real  # (n_excitations, n_modes)
    joint: Real  # (2, n_modes): participation of the hidden force, and of a second one that it may depend on
    responses: tuple[str, ...]
    excitations: tuple[str, ...]
    drive: str = "force"
    response: str = "acceleration"

    @property
    def band(self) -> tuple[float, float]:
        """Band of the modes, Hz."""
        return 0.35 * self.omega.min() / 2 / np.pi, 2.2 * self.omega.max() / 2 / np.pi

    def stiffness(self, place: int) -> float:
        """Static stiffness at a joint, N/m."""
        return float(1 / np.sum(self.joint[place] ** 2 / self.omega**2))


def draw_rig(rng: np.random.Generator, kind: str) -> Rig:
    """Draw one of the four rigs."""
    if kind == "beam":  # pinned at both ends, driven at 0.3 of its length
        places, n = np.array([0.3, 0.5, rng.choice([0.5, 0.22]), 0.4]), 3
        omega = np.asarray(2 * np.pi * rng.uniform(6, 9) * np.arange(1.0, n + 1) ** 2, dtype=float)
        shapes = np.sin(np.pi * places[:, None] * np.arange(1, n + 1)) / np.sqrt(rng.uniform(5, 30))
        first = 1 if rng.random() < 0.4 else 0  # one response at the middle, or one at the force too
        names = ("AT:+Z", "MID:+Z")[first:]
        return Rig(kind, omega, rng.uniform(0.006, 0.03, n), shapes[first:2], shapes[:1], shapes[2:], names, ("AT:+Z",))
    if kind == "arm":
        n = int(rng.integers(2, 5))
        omega = np.asarray(50 * np.cumprod(np.r_[rng.uniform(1, 1.6), rng.uniform(1.2, 1.9, n - 1)]), dtype=float)
        shapes = rng.standard_normal((6, n)) / np.sqrt(rng.uniform(20, 120, n))
        tip, elbow = ("TCP:+X", "TCP:+Y", "TCP:+Z"), ("ELBOW:+X", "ELBOW:+Y", "ELBOW:+Z")
        driven = [[0, 1, 2], [0, 1], [0, 3]][rng.integers(3)]
        seen = [[0, 1, 2], [0, 1], [0, 3]][rng.integers(3)] if rng.random() < 0.3 else driven
        points = (*tip, *elbow)
        direction = rng.standard_normal(3)
        inside = rng.standard_normal(n) / np.sqrt(rng.uniform(20, 120, n))
        joint = inside if rng.random() < 0.3 else direction / np.linalg.norm(direction) @ shapes[:3]
        joints = np.array([joint, shapes[int(rng.integers(6))]])
        labels = tuple(points[p] for p in seen), tuple(points[p] for p in driven)
        return Rig(kind, omega, rng.uniform(0.01, 0.05, n), shapes[seen], shapes[driven], joints, *labels)
    n = int(rng.integers(1, 3))
    omega = 2 * np.pi * rng.uniform(5, 14) * np.array([1.0, rng.uniform(2.2, 4)])[:n]
    shape = np.array([[1.0, rng.uniform(0.3, 0.8)]])[:, :n]
    joints, zeta = np.vstack([shape, np.ones(n)]), rng.uniform(0.01, 0.06, n)
    if kind == "base":
        labels = ("MASS:+X",), ("BASE:+X",)
        push = -shape * np.array([1.0, 0.4])[:n]  # the motion is relative to the base
        return Rig(kind, omega, zeta, shape, push, joints, *labels, "acceleration", "displacement")
    shape, joints = shape / np.sqrt(40.0), joints / np.sqrt(40.0)
    quantity = str(rng.choice(["acceleration", "displacement"]))
    return Rig(kind, omega, zeta, shape, shape, joints, ("SLIDE:+X",), ("SLIDE:+X",), "force", quantity)


def nominal_model(rig: Rig, off: float, rng: np.random.Generator, stated: bool) -> ModalModel:
    """Return what a modal test gives, with ``off`` times the errors of ``MODAL_ERROR``."""
    e, n = off * np.array(MODAL_ERROR), len(rig.omega)
    omega, zeta = rig.omega * (1 + e[0] * rng.standard_normal(n)), rig.zeta * (1 + e[1] * rng.standard_normal(n))
    damped = omega * np.sqrt(1 - zeta**2)
    shown, push = (s * (1 + e[2] * rng.standard_normal(s.shape)) for s in (rig.shown, rig.push))
    quantity, unit = ("transfer", "m/m/s^2") if rig.drive == "acceleration" else ("receptance", "m/N")
    poles, left = -zeta * omega + 1j * damped, push.T / (2j * damped[:, None])
    right, band = shown.T.astype(complex), rig.band if stated else None
    return ModalModel(poles, right, left, rig.responses, rig.excitations, quantity, unit, band=band)


def excitation(kind: str, rig: Rig, run: int, rng: np.random.Generator) -> tuple[Real, Real]:
    """Return forces (n_samples, n_excitations) of unit size, and the course of the spindle speed about its mean."""
    n, m = int((LEAD + SECONDS) * RATE), len(rig.excitations)
    t, (low, high) = np.arange(n) / RATE, rig.band
    share = np.linspace(0, 1, n)
    ramp = share if run % 2 == 0 else 1 - share
    course = np.zeros(n)
    if kind in ("random", "slow drive"):
        axis, spectrum = np.fft.rfftfreq(n, 1 / RATE), np.fft.rfft(rng.standard_normal((n, m)), axis=0)
        force = np.fft.irfft(spectrum * ((axis > low) & (axis < high))[:, None], n=n, axis=0)
        force /= force.std(axis=0)
        if kind == "slow drive":
            force = 0.5 * force + 3 * np.sin(2 * np.pi * rng.uniform(0.15, 0.3) * low * t + 6 * rng.random())[:, None]
    elif kind == "multisine":
        lines = np.arange(math.ceil(low * 4), int(high * 4)) / 4.0  # period of 4 s
        force = np.zeros((n, m))
        for f in lines:
            force += np.cos(2 * np.pi * (f * t[:, None] + rng.random(m)))
    elif kind == "sweep":
        phase = 2 * np.pi * np.cumsum(low + (high - low) * ramp) / RATE
        force = np.cos(phase[:, None] + 6 * rng.random(m)) * (0.6 + 0.4 * np.sin(rng.uniform(0.5, 2, m) * t[:, None]))
    elif kind == "hammer":
        force, width = np.zeros((n, m)), max(int(RATE / high / 1.6), 6)
        for start in np.arange(LEAD + 0.5, LEAD + SECONDS - 1, 2.0):
            pulse = rng.uniform(0.7, 1.3) * np.sin(np.pi * np.arange(width) / width)
            place = int((start + 0.6 * rng.random()) * RATE)
            force[place : place + width, rng.integers(m)] += pulse
    elif kind == "steps":
        hold = np.cumsum(rng.uniform(0.4, 1.2, (80, m)), axis=0)
        values = rng.standard_normal((81, m))
        force = np.column_stack([values[np.searchsorted(hold[:, j], t), j] for j in range(m)])
        force = scipy.ndimage.gaussian_filter1d(force, RATE / 4 / high, axis=0)
    else:  # teeth of a cutter in a spindle whose speed changes
        start, end = np.sort(rng.uniform(0.5 * low / 0.35, 1.05 * high / 2.2, 2))
        speed = start + (max(end, 1.4 * start) - start) * ramp
        angle, course = 2 * np.pi * np.cumsum(speed) / RATE, speed / speed.mean() - 1
        force = np.zeros((n, m))
        for order, size in ((1, 1.0), (2, 0.5), (3, 0.3), (1 / 3, 0.25)):
            force += size * rng.uniform(0.5, 1, m) * np.cos(order * angle[:, None] + 6 * rng.random(m))
    force = force / np.sqrt(np.mean(force**2)) * np.clip(np.minimum(t, t[::-1]) / 0.3, 0, 1)[:, None]
    return force, course
