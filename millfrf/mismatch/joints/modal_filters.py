"""Modal filters ``1 / (s - p)`` and their derivatives in time, on band-limited forces: no transform for each of them.

A step of ``y' = p y + F`` adds ``int_0^h exp(p (h - t)) F(t) dt``. With Legendre polynomials over the step and modified
spherical Bessel functions i_l this is ``h exp(p h / 2) sum_l (2 l + 1) (-1)^l i_l(p h / 2) m_l``, where ``m_l`` is the
force filtered by ``i_l(s h / 2)``, its l-th moment over the step. The moments are the same for all modes.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Complex
from millfrf.core.compilation import compiled

from .time_loops import MOMENTS

Columns = NDArray[np.float32]


@dataclass(frozen=True)
class ModalFilters:
    """Signals that are modal filters of few forces, as a compiled loop takes them.

    The signals of a complex state y are 2 Re y and -2 Im y, and change as the two parts of a vector that turns. Behind
    the states that are signals stand those that only drive others, one for each mode.

    Parameters
    ----------
    sources : (n, n_sources MOMENTS + n_direct)
        Moments of the forces over the step before each instant, force by force, then some forces at the instant, N.
    turns : (4, n_states)
        Real and imaginary part of ``exp(p h)``, and of p.
    inputs : (n_sources MOMENTS, 2 n_states)
        What each moment adds to the first, then to the second part of each state.
    start : (2 n_states,)
        States at the first instant.
    direct : (n_direct, n_signals / 2)
        What each force adds to the rates of the signals' first parts; no rows where rates are not wanted.
    n_modes
        Number of states that only drive others.
    step
        Time of a step, s.
    """

    sources: Columns
    turns: Columns
    inputs: Columns
    start: Columns
    direct: Columns
    n_modes: int
    step: float

    @property
    def signals(self) -> int:
        """Number of signals."""
        return 2 * (int(self.turns.shape[1]) - self.n_modes)


def modal_filters(
    force: Complex, size: tuple[int, float], modes: tuple[Complex, Complex, Complex], wanted: tuple[int, bool]
) -> ModalFilters:
    """Signals of each mode: ``F_q / (s - p)`` for the first forces, and ``rho (l . F) / (s - p)^2``.

    Parameters
    ----------
    force : (n_lines, n_sources), N
        Spectra of the forces, from 0 Hz on, for the length and step of the signals.
    size
        Number of instants after which all repeats, and time between two, s.
    modes
        Poles p (n_modes,), push l of each force (n_modes, n_sources), and what a mode is seen by, rho (n_modes,).
    wanted
        Number of forces F_q, and whether rates are wanted.

    Returns
    -------
    filters
        Order of the states that are signals: mode by mode those of the forces, then one for each mode.
    """
    (padded, step), (fitted, rates) = size, wanted
    poles, left, ahead = modes
    count, n = len(poles), force.shape[1]
    own = np.tile(np.eye(n, dtype=complex)[None, :fitted], (count, 1, 1)).reshape(count * fitted, n)
    pushes = np.vstack([own, ahead[:, None] * left, ahead[:, None] * left])
    of = np.concatenate([np.repeat(np.arange(count), fitted), np.arange(count), np.arange(count)])
    twice = np.zeros(len(of), dtype=bool)
    twice[count * fitted : count * fitted + count] = True
    gains, slopes = _gains(poles, step)
    weights = np.where(twice[:, None], slopes[of], gains[of])
    inputs = (pushes[:, :, None] * weights[:, None, :]).reshape(len(of), -1)
    first, second = _starts(force, poles, padded, step)
    start = np.sum(pushes * np.where(twice[:, None], second[of], first[of]), axis=1)
    direct = np.zeros((fitted if rates else 0, len(of) - count), dtype=np.float32)
    for q in range(len(direct)):
        direct[q, q : count * fitted : fitted] = 2.0
    turn = np.exp(poles * step)[of]
    return ModalFilters(
        _sources(force, padded, len(direct)),
        np.array([turn.real, turn.imag, poles[of].real, poles[of].imag], dtype=np.float32),
        np.ascontiguousarray(_two_parts(inputs).T),
        _two_parts(start[:, None])[:, 0].copy(),
        direct,
        count,
        step,
    )


def _two_parts(values: Complex) -> Columns:
    """Parts 2 Re and -2 Im of complex rows (n, m), the second below the first."""
    return np.concatenate([2 * values.real, -2 * values.imag]).astype(np.float32)


def _sources(force: Complex, padded: int, direct: int) -> Columns:
    """Moments of forces over the step before each instant, then the first forces themselves, (padded, n_rows)."""
    filters, n = _moment_filters(len(force), padded), force.shape[1]
    spectra = np.zeros((n * MOMENTS + direct, padded // 2 + 1), dtype=np.complex64)
    own = np.ascontiguousarray(force.T, dtype=np.complex64)
    for row in range(MOMENTS):
        np.multiply(own, filters[row], out=spectra[row : n * MOMENTS : MOMENTS, : len(force)])
    spectra[n * MOMENTS :, : len(force)] = own[:direct]
    return np.ascontiguousarray(scipy.fft.irfft(spectra, n=padded, axis=1).T)


@lru_cache(maxsize=4)
def _moment_filters(count: int, padded: int) -> NDArray[np.complex64]:
    """Filters (MOMENTS, count) from a force to its moments over the step before an instant. A fit asks often."""
    half = np.asarray(1j * np.pi * np.arange(count) / padded, dtype=complex)
    filters = np.array([_bessel(half, order) for order in range(MOMENTS)]) * np.exp(-half)
    result: NDArray[np.complex64] = filters.astype(np.complex64)
    result.flags.writeable = False
    return result


def _gains(poles: Complex, step: float) -> tuple[Complex, Complex]:
    """What each moment adds to a mode's state, and the derivative of that by the pole, each (n_modes, MOMENTS)."""
    half = 0.5 * step * poles
    bessel = np.array([_bessel(half, order) for order in range(MOMENTS + 1)])
    gains, slopes = [], []
    for order in range(MOMENTS):
        sign = (2 * order + 1) * (-1) ** order * step * np.exp(half)
        below = order * bessel[order - 1] if order else 0.0
        rise = (below + (order + 1) * bessel[order + 1]) / (2 * order + 1)
        gains.append(sign * bessel[order])
        slopes.append(0.5 * step * sign * (bessel[order] + rise))
    return np.array(gains).T, np.array(slopes).T


def _bessel(z: Complex, order: int) -> Complex:
    """Modified spherical Bessel function of the first kind, by its series: the arguments are small."""
    term = np.ones_like(z) / float(np.prod(np.arange(1, 2 * order + 2, 2)))
    total = term.copy()
    for k in range(1, 9):
        term = term * (0.5 * z * z) / (k * (2 * order + 2 * k + 1))
        total += term
    return np.asarray(z**order * total)


def _starts(force: Complex, poles: Complex, padded: int, step: float) -> tuple[Complex, Complex]:
    """First instant of ``F / (s - p)`` and of ``F / (s - p)^2``, periodic, each (n_modes, n_sources)."""
    s = np.asarray(2j * np.pi * np.arange(len(force)) / (padded * step), dtype=complex)
    first: Complex = np.zeros((len(poles), force.shape[1]), dtype=complex)
    second: Complex = np.zeros_like(first)
    _add_lines(s, poles, np.ascontiguousarray(force), first, second)
    return np.asarray(first / padded), np.asarray(second / padded)


@compiled
def _add_lines(s: Complex, poles: Complex, force: Complex, first: Complex, second: Complex) -> None:
    """Sum both halves of spectra through ``1 / (s - p)`` and its square."""
    for k in range(len(s)):
        for r in range(len(poles)):
            above, below = s[k] - poles[r], -s[k] - poles[r]
            up = above.conjugate() * (1.0 / (above.real**2 + above.imag**2))
            down = below.conjugate() * (1.0 / (below.real**2 + below.imag**2)) if k else 0.0j
            for q in range(force.shape[1]):
                here, back = up * force[k, q], down * force[k, q].conjugate()
                first[r, q] += here + back
                second[r, q] += up * here + down * back
