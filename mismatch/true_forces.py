"""Measured forces replaced by what they say of the true ones."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft
from scipy.signal import convolve
from scipy.signal.windows import hann

from .windowed_lines import WindowedLines, padded_force

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

NEIGHBOURS = 61
"""Lines over which the spectral matrix of the forces is averaged."""

CLOSEST = 7
"""The same, to see where there is less force than around."""

WIDELY, QUIETEST = 201, 0.05
"""The same, so wide that chance hardly counts, to find the share of lines whose power bounds the forces' noise."""

LEAST_POWER = 2.0
"""Power over noise below which a direction of force is taken for noise alone, as chance leaves that much."""


def without_force_noise(lines: WindowedLines, variance: Real) -> WindowedLines:
    """Replace a trial's measured forces by what they say of the true ones, ``F_hat = W F``, ``W = (P - S) P^-1``.

    P is the measured forces' spectral matrix around a line and S the variance of their noise (Wiener, 1949). Where a
    spectrum holds little but noise, as between the harmonics of a steady cut or above the band of the cutting force,
    the structure was not pushed by what was measured: predicted from it, a response would be missing and a mode would
    seem to cancel it. The same holds across forces that rise and fall together.

    Parameters
    ----------
    lines
        Prepared trial, its forces replaced already or not.
    variance : (n_excitations,)
        Of the forces' noise a line; no more of it is believed than what the quietest lines hold.
    """
    n = lines.start + len(lines.window)
    spectrum = rfft(lines.trial.force[lines.start : n] * lines.window[:, None], axis=0)
    products = spectrum[:, :, None] * spectrum[:, None, :].conj()
    own = np.einsum("kqq->kq", products).real
    wide = min(WIDELY, len(own) // 5)
    quiet = np.quantile(_around(own, wide)[wide:-wide], QUIETEST, axis=0)
    deviation = np.sqrt(np.maximum(np.minimum(variance, quiet), 1e-12 * own.mean(axis=0)))
    count = min(NEIGHBOURS, wide)
    whitened = products / np.outer(deviation, deviation)
    total = np.einsum("kqq->kq", whitened).real.sum(axis=1)
    # beside a harmonic or the end of a band, less is there than around
    less = np.minimum(_around(total, CLOSEST) / np.maximum(_around(total, count), 1e-300), 1.0)
    values, vectors = np.linalg.eigh(np.maximum(less, 0.0)[:, None, None] * _around(whitened, count))
    share = np.where(values > LEAST_POWER, 1 - 1 / np.maximum(values, 1.0), 0.0)
    # which directions these are is itself known from some lines only
    unsure = np.maximum(1 - 1 / np.maximum(values, 1.0), np.sum(_weights(count) ** 2))
    whole, root = (
        deviation[:, None] * (vectors * weight[:, None, :]) @ vectors.conj().swapaxes(1, 2) / deviation
        for weight in (share, np.sqrt(unsure))
    )
    place = lines.padded_frequencies * len(lines.window) / lines.trial.rate
    low = np.minimum(place.astype(int), len(whole) - 2)
    high = (place - low)[:, None, None]
    padded = (1 - high) * whole[low] + high * whole[low + 1]
    return replace(
        lines,
        force_lines=np.einsum("kij,kj->ki", padded, padded_force(lines)),
        force_here=np.einsum("kij,kj->ki", whole[lines.band], spectrum[lines.band]),
        trust=root[lines.band],
    )


def _around(power: Complex, count: int) -> Complex:
    """Mean over ``count`` neighbouring lines, tapered."""
    flat = power.reshape(len(power), -1)
    return np.asarray(convolve(flat, _weights(count)[:, None], mode="same", method="fft").reshape(power.shape))


def _weights(count: int) -> Real:
    """Of neighbours in a mean."""
    weights = hann(count + 2)[1:-1]
    return np.asarray(weights / weights.sum())
