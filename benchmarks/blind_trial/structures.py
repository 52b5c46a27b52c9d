"""Random robot-like structures, and the nominal model that a lab believes of one."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from millfrf.core import TIP
from modal_fit import ModalModel

HEAD = ("HEAD:+X", "HEAD:+Y", "HEAD:+Z")

LAB_FREQUENCY, LAB_DAMPING, LAB_SHAPE = 0.01, 0.12, 0.03


@dataclass(frozen=True)
class Structure:
    """Linear structure in state-space modes: ``q' = poles q + left F``, tip displacement ``2 Re(tip^T q)``.

    Parameters
    ----------
    poles : (n_modes,), rad/s
        Upper half of the conjugate pairs.
    tip, sensor : (n_modes, 3)
        Right vectors at the tool tip and where the accelerometers sit.
    left : (n_modes, 3)
        Left vectors for forces at the tool tip.
    inner : (2, n_modes), or None
        Right and left vector of a joint inside the structure: its deflection between two points that no channel
        shows, and the modal force of a pair of forces on them. It is the fourth axis of directions.
    """

    poles: NDArray[np.complex128]
    tip: NDArray[np.complex128]
    sensor: NDArray[np.complex128]
    left: NDArray[np.complex128]
    inner: NDArray[np.complex128] | None = None

    @property
    def seen(self) -> NDArray[np.complex128]:
        """Right vectors of all axes that a joint may feel: three at the tip and, if there is one, the inner one."""
        return self.tip if self.inner is None else np.column_stack([self.tip, self.inner[0]])

    @property
    def pushed(self) -> NDArray[np.complex128]:
        """Left vectors of the same axes."""
        return self.left if self.inner is None else np.column_stack([self.left, self.inner[1]])

    def accelerance(self, s: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """``s^2 H(s)`` from tip forces to the accelerometers, shape (n, 3, 3)."""
        direct = np.einsum("kr,rp,rq->kpq", 1 / (s[:, None] - self.poles), self.sensor, self.left, optimize=True)
        mirror = np.einsum(
            "kr,rp,rq->kpq",
            1 / (s[:, None] - self.poles.conj()),
            self.sensor.conj(),
            self.left.conj(),
            optimize=True,
        )
        return np.asarray(s[:, None, None] ** 2 * (direct + mirror))

    def static_stiffness(self, direction: NDArray[np.float64]) -> float:
        """``1 / (d^T H(0) d)`` over the axes of ``seen``, N/m."""
        flexibility = -2 * np.real(np.sum((self.seen @ direction) * (self.pushed @ direction) / self.poles))
        return float(1 / flexibility)

    def with_mode(self, frequency: float, damping: float, shape: NDArray[np.float64]) -> "Structure":
        """Add an uncoupled real mode (Hz, ratio, mass-normalised shape (3,) at the tip); an inner joint rests in it."""
        omega = 2 * np.pi * frequency
        damped = omega * np.sqrt(1 - damping**2)
        row = np.asarray(shape, dtype=complex)[None]
        return Structure(
            np.append(self.poles, -damping * omega + 1j * damped),
            np.vstack([self.tip, row]),
            np.vstack([self.sensor, row]),
            np.vstack([self.left, row / (2j * damped)]),
            None if self.inner is None else np.column_stack([self.inner, np.zeros(2)]),
        )


def draw_structure(rng: np.random.Generator, sensor_away: bool = False, inner_joint: bool = False) -> Structure:
    """Four to seven modes between 5 and 80 Hz; drawn anew until every damping ratio is within 0.7-12 %.

    ``q'' + C q' + K q = B^T F``, ``x = P q``: K may have a skew part (drives that do not act reciprocally), C one
    that is not proportional, so that vectors become complex and left differ from right (Ewins, Modal Testing,
    2nd ed., sections 2.7-2.8). In such a system ``sum 2 Re(tip left^T) = 0`` holds exactly.
    """
    while True:
        structure = _attempt(rng, sensor_away, inner_joint)
        damping = -structure.poles.real / np.abs(structure.poles)
        if damping.min() > 0.007 and damping.max() < 0.12:
            return structure


def _attempt(rng: np.random.Generator, sensor_away: bool, inner_joint: bool) -> Structure:
    omega = 2 * np.pi * _frequencies(rng)
    n = len(omega)
    damping = np.exp(rng.uniform(np.log(0.01), np.log(0.10), n))
    mass = rng.uniform(60, 250, n) * (40 / omega) ** 0.5
    shapes = rng.standard_normal((3, n))
    shapes *= rng.uniform(0.6, 1.3, n) / np.linalg.norm(shapes, axis=0) / np.sqrt(mass)
    viscous, stiffness = np.diag(2 * damping * omega), np.diag(omega**2)
    if rng.random() < 0.5:  # mildly complex shapes
        mix = rng.uniform(0, 0.3) * rng.standard_normal((n, n)) / n
        scale = np.sqrt(np.diag(viscous))
        viscous = viscous + (mix + mix.T) * np.outer(scale, scale)
    if rng.random() < 0.4:  # left and right differ
        skew = rng.uniform(0.005, 0.03) * rng.standard_normal((n, n))
        stiffness = stiffness + (skew - skew.T) * np.outer(omega, omega)
    arms = 0.2 * np.abs(shapes).mean() * rng.standard_normal((3, n)) if sensor_away else np.zeros((3, n))
    sensor = 0.85 * shapes + arms if sensor_away else shapes
    between = np.sqrt(np.mean(shapes**2)) * rng.standard_normal((1, n)) if inner_joint else None
    return _modes(viscous, stiffness, shapes, sensor, between)


def _frequencies(rng: np.random.Generator) -> NDArray[np.float64]:
    """Sorted natural frequencies, Hz: at least 8 % apart, but for one close pair in a third of the draws."""
    n = int(rng.integers(4, 8))
    while True:
        result = np.sort(np.exp(rng.uniform(np.log(5), np.log(80), n)))
        if np.diff(np.log(result)).min() > 0.08:
            break
    if rng.random() < 1 / 3:
        chosen = int(rng.integers(1, n))
        result[chosen] = result[chosen - 1] * rng.uniform(1.02, 1.06)
    return result


def _modes(
    viscous: NDArray[np.float64],
    stiffness: NDArray[np.float64],
    shapes: NDArray[np.float64],
    sensor: NDArray[np.float64],
    between: NDArray[np.float64] | None,
) -> Structure:
    """Eigenvectors of ``[[0, I], [-K, -C]]``: right ones from its columns, left from the inverse's rows."""
    n = len(viscous)
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -viscous]])
    poles, vectors = np.linalg.eig(state)
    rows = np.linalg.inv(vectors)
    upper = np.flatnonzero(poles.imag > 0)
    upper = upper[np.argsort(np.abs(poles[upper]))]
    left = rows[upper, n:] @ shapes.T
    right = vectors[:n, upper].T
    gauge = np.sqrt(np.linalg.norm(left, axis=1) / np.linalg.norm(right @ shapes.T, axis=1))[:, None]
    inner = None
    if between is not None:
        inner = np.vstack([(right @ between.T * gauge).T, (rows[upper, n:] @ between.T / gauge).T])
    return Structure(poles[upper], right @ shapes.T * gauge, right @ sensor.T * gauge, left / gauge, inner)


def nominal_model(structure: Structure, rng: np.random.Generator, off: "LabError", sensor: str) -> ModalModel:
    """What the lab believes: the structure with an error of the stated size.

    Parameters
    ----------
    off
        In units of the lab's usual error, per kind of parameter.
    sensor
        ``tip``: responses at the TCP; ``head``: at the accelerometers' place; ``head_and_tip``: at both.
    """
    n = len(structure.poles)
    omega = np.abs(structure.poles) * (1 + LAB_FREQUENCY * off.frequency * rng.standard_normal(n))
    damping = -structure.poles.real / np.abs(structure.poles)
    damping = damping * np.clip(1 + LAB_DAMPING * off.damping * rng.standard_normal(n), 0.25, 4.0)
    poles = omega * (-damping + 1j * np.sqrt(1 - damping**2))
    shapes = [structure.tip, structure.sensor, structure.left]
    if off.shape:
        shapes = [_disturbed(vectors, LAB_SHAPE * off.shape, rng) for vectors in shapes]
    tip, head, left = shapes
    responses = {"tip": TIP, "head": HEAD, "head_and_tip": HEAD + TIP}[sensor]
    right = {"tip": tip, "head": head, "head_and_tip": np.hstack([head, tip])}[sensor]
    return ModalModel(poles, right, left, responses, TIP)


@dataclass(frozen=True)
class LabError:
    """Error of the nominal model in units of a lab's usual one: 1 % frequency, 12 % damping, 3 % shapes."""

    frequency: float = 0.0
    damping: float = 0.0
    shape: float = 0.0

    @classmethod
    def uniform(cls, size: float) -> "LabError":
        """The same size for all three."""
        return cls(size, size, size)

    def only(self, kind: str) -> "LabError":
        """The same error in one kind of parameter, a usual one in the others."""
        usual = LabError.uniform(1.0)
        return self if kind == "all" else replace(usual, **{kind: getattr(self, kind)})


def _disturbed(vectors: NDArray[np.complex128], size: float, rng: np.random.Generator) -> NDArray[np.complex128]:
    """Add real multiples of each mode's own phase, ``size`` of its length: it keeps a real mode real."""
    length = np.sqrt(np.mean(np.abs(vectors) ** 2, axis=1, keepdims=True))
    largest = np.take_along_axis(vectors, np.abs(vectors).argmax(axis=1)[:, None], axis=1)
    return np.asarray(vectors + size * length * largest / np.abs(largest) * rng.standard_normal(vectors.shape))
