"""A mode that the nominal model lacks: found by a scan over poles, fitted as one more mode."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..models import Hypothesis
from ..physics import ModePhysics
from .whitened_residual import Floor, FloorRecord

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

DAMPINGS = (0.015, 0.05)
FREQUENCIES = 48
EVERY = 3
"""Step between the lines that the scan takes; the scan needs no precision."""


@dataclass(frozen=True)
class SightedMode:
    """A further pole with a residue of rank one, and the misfit that it would gain.

    Parameters
    ----------
    physics
        The cause that adds it.
    pole
        Its pole, rad/s.
    right : (n_responses,)
        Right vector of the residue ``right left^T``, m/(N s).
    left : (n_excitations,)
        Left vector of that residue.
    gain
        Misfit that it would gain.
    """

    physics: ModePhysics
    pole: complex
    right: Complex
    left: Complex
    gain: float


def find_mode(floor: Floor, hypothesis: Hypothesis, physics: ModePhysics) -> SightedMode:
    """The pole and residue that explain most of the residual.

    For poles over the band a residue of full rank is fitted by linear least squares after the modal parameters have
    adapted; the best is brought to rank one by its singular value decomposition.
    """
    low = min(record.lines.frequencies[0] for record in floor.records)
    high = max(record.lines.frequencies[-1] for record in floor.records)
    best: tuple[float, complex, Real] | None = None
    thin = _thinned(floor, hypothesis)
    for frequency in np.geomspace(1.3 * low, 0.95 * high, FREQUENCIES):
        for damping in DAMPINGS:
            pole = 2 * np.pi * frequency * (-damping + 1j * np.sqrt(1 - damping**2))
            gain, residue = _residue(thin, pole)
            if best is None or gain > best[0]:
                best = gain, pole, residue
    assert best is not None
    gain, pole, numbers = best
    n, m = floor.records[0].through.shape[1:]
    parts = numbers.reshape(2, n, m)
    u, s, vh = np.linalg.svd(parts[0] + 1j * parts[1])
    scale = np.sqrt(s[0] * np.linalg.norm(hypothesis.model.left) / np.linalg.norm(hypothesis.model.right))
    return SightedMode(physics, pole, u[:, 0] * s[0] / scale, vh[0] * scale, gain * s[0] ** 2 / np.sum(s**2))


@dataclass(frozen=True)
class _Thin:
    """Every few lines of a floor: derivative and residual of each recording, and their own normal equations."""

    records: tuple[tuple[FloorRecord, Real, Real], ...]
    inverse: Real
    gradient: Real


def _thinned(floor: Floor, hypothesis: Hypothesis) -> _Thin:
    size = len(floor.gradient)
    matrix, gradient = np.diag(np.full(size, 1e-6)), np.zeros(size)
    shape = hypothesis.shape
    matrix[np.arange(shape.size), np.arange(shape.size)] = shape.belief
    gradient[: shape.size] = -shape.belief * hypothesis.u
    records = []
    for record in floor.records:
        chosen = _chosen(record)
        slope, rest = record.slope[chosen], record.rest[chosen]
        matrix += 2 * EVERY * slope.T @ slope
        gradient += 2 * EVERY * slope.T @ rest
        records.append((record, slope, rest))
    return _Thin(tuple(records), np.asarray(np.linalg.inv(matrix), dtype=float), gradient)


def _residue(thin: _Thin, pole: complex) -> tuple[float, Real]:
    """Gain and residue numbers (real parts, then imaginary parts) of a pole."""
    through = thin.records[0][0].through
    count = 2 * through.shape[1] * through.shape[2]
    own, shared, pull = np.zeros((count, count)), np.zeros((len(thin.gradient), count)), np.zeros(count)
    for record, slope, rest in thin.records:
        columns = _columns(record, pole)
        own += 2 * EVERY * columns.T @ columns
        shared += 2 * EVERY * slope.T @ columns
        pull += 2 * EVERY * columns.T @ rest
    solved = thin.inverse @ shared
    left, drive = own - shared.T @ solved, pull - solved.T @ thin.gradient
    answer = np.asarray(np.linalg.lstsq(left, drive, rcond=1e-8)[0], dtype=float)
    return float(drive @ answer), answer


def _chosen(record: FloorRecord) -> NDArray[np.int64]:
    """Rows of the real system that belong to every EVERYth line."""
    n_lines, n = record.residual.shape
    rows = (np.arange(0, n_lines, EVERY)[:, None] * n + np.arange(n)).ravel()
    return np.concatenate([rows, rows + n_lines * n])


def _columns(record: FloorRecord, pole: complex) -> Real:
    """Whitened response to each real number of a residue, (n_rows, 2 n m)."""
    lines = record.lines
    frequencies = lines.frequencies[::EVERY]
    force = lines.force_here[::EVERY]
    s = 2j * np.pi * frequencies
    up, down = 1 / (s - pole), 1 / (s - np.conj(pole))
    kinematic = lines.kinematic[::EVERY]
    white = record.white[::EVERY] * kinematic[:, None, :]
    n, m = record.through.shape[1:]
    result = np.empty((len(s), white.shape[1], 2, n, m), dtype=complex)
    for part, factor in enumerate((up + down, 1j * (up - down))):
        result[:, :, part] = white[:, :, :, None] * (factor[:, None] * force)[:, None, None, :]
    flat = result.reshape(len(s) * white.shape[1], -1)
    return np.concatenate([flat.real, flat.imag])
