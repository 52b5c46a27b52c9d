"""Noise of a simulated set: white in the measured quantity or proportional to the FRF, and what is told of it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
KINDS = ("rms of each FRF", "rms of the set", "peak of each FRF", "size of the FRF")
TOLD = ("nothing", "covariance", "coherence", "nothing", "estimated covariance", "coherence, averages unknown")
_MAX_COVARIANCE = 6_000_000  # numbers; the matrix over the responses is told on each line
_FULL = 12  # responses; beyond, an estimated covariance scatters on its diagonal only


@dataclass(frozen=True)
class Noise:
    """Variance of the noise, and what the engine is told of it.

    Parameters
    ----------
    variance : (n_lines, n_responses, n_excitations)
        Expected squared error of each FRF, ``E|dH|^2``.
    response, excitation
        Covariance in product form as told, or None.
    averages
        Behind each FRF where a coherence is told, or None.
    told
        One of :data:`TOLD`.
    """

    variance: Real
    response: Complex | None = None
    excitation: Complex | None = None
    averages: int | None = None
    told: str = "nothing"

    def sample(self, rng: np.random.Generator) -> Complex:
        """One draw, circular and independent between lines and entries."""
        parts = rng.standard_normal((2, *self.variance.shape))
        return np.asarray(np.sqrt(self.variance / 2) * (parts[0] + 1j * parts[1]))

    def coherence(self, rng: np.random.Generator, measured: Complex) -> Real | None:
        """As the averages gave it together with the mean ``measured``; None where none is told.

        With N taps of unit force, responses ``x_n = H + e_n`` and ``E|e_n|^2 = N variance``, the estimate
        ``|mean x|^2 / mean |x|^2`` has the numerator ``|measured|^2``, and its denominator is larger by
        ``variance chi^2 / 2`` with 2 (N - 1) degrees of freedom.
        """
        if self.averages is None:
            return None
        power = np.abs(measured) ** 2
        scatter = self.variance * rng.chisquare(2 * (self.averages - 1), power.shape) / 2
        return np.asarray(power / (power + scatter))


def draw_noise(
    rng: np.random.Generator, values: Complex, inside: NDArray[np.bool_], level: float, kind: str, told: str
) -> Noise:
    """Noise of ``level`` times ``kind`` (one of :data:`KINDS`), rms and peak taken over the band.

    With a covariance the variance is a product over responses and excitations, as the form of the covariance asks: the
    rms or peak of each *response*, times 0.5 to 2 an excitation. Noise proportional to the FRF has none: there, and
    where the covariance would not fit into 100 MB, nothing is told.
    """
    n_lines, n_responses, _ = values.shape
    large = n_lines * n_responses**2 > _MAX_COVARIANCE
    if "covariance" in told and (large or kind == "size of the FRF"):
        told = "nothing"
    if "covariance" in told:
        return _with_covariance(rng, values, inside, level, kind, told)
    variance = level**2 * _size(values, inside, kind)
    averages = int(np.exp(rng.uniform(np.log(3), np.log(41)))) if told.startswith("coherence") else None
    return Noise(np.asarray(variance), averages=averages, told=told)


def _size(values: Complex, inside: NDArray[np.bool_], kind: str) -> Real:
    """Square of what the noise is a share of, in the shape of ``values``."""
    power = np.abs(values) ** 2
    mean = power[inside].mean(axis=0)
    if kind == "rms of each FRF":
        square = mean
    elif kind == "rms of the set":
        square = np.full(mean.shape, mean.mean())
    elif kind == "peak of each FRF":
        square = power[inside].max(axis=0)
    else:
        return np.asarray(power + 0.01 * mean)
    return np.broadcast_to(square, values.shape)


def _with_covariance(
    rng: np.random.Generator, values: Complex, inside: NDArray[np.bool_], level: float, kind: str, told: str
) -> Noise:
    n_lines, n_responses, n_excitations = values.shape
    rows = level**2 * np.sqrt(np.mean(_size(values, inside, kind)[0] ** 2, axis=1))
    columns = np.exp(rng.uniform(np.log(0.5), np.log(2.0), n_excitations))
    variance = np.broadcast_to(rows[:, None] * columns, values.shape)
    response = np.broadcast_to(np.diag(rows).astype(complex), (n_lines, n_responses, n_responses))
    excitation = np.broadcast_to(np.diag(columns).astype(complex), (n_lines, n_excitations, n_excitations))
    if told == "estimated covariance":
        response = _estimated(rng, rows, n_lines, int(rng.integers(16, 41)))
    return Noise(variance, np.array(response), np.array(excitation), told=told)


def _estimated(rng: np.random.Generator, rows: Real, n_lines: int, averages: int) -> Complex:
    """As from ``averages`` repetitions: a complex Wishart matrix, of many responses its diagonal only."""
    n = len(rows)
    if n > _FULL:
        scatter = rng.chisquare(2 * averages, (n_lines, n)) / (2 * averages)
        return np.asarray(np.einsum("kp,pu->kpu", scatter * rows, np.eye(n)).astype(complex))
    parts = rng.standard_normal((2, n_lines, n, averages)) * np.sqrt(rows / 2)[:, None]
    draws = parts[0] + 1j * parts[1]
    return np.asarray(draws @ draws.conj().transpose(0, 2, 1) / averages)
