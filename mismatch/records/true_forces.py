"""Measured forces replaced by what they say of the true ones."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft
from scipy.signal import convolve
from scipy.signal.windows import hann

from estimation import WindowedSpectrum, padded_force

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

SCALES = (301, 101, 31, 11)
"""Lines over which the spectral matrix of the forces is averaged, from wide to narrow."""

CHANCE = 3.0
"""Standard deviations by which the power over fewer lines must differ to be believed; wholly so at two more."""

WIDELY, QUIETEST = 201, 0.05
"""Lines so many that chance hardly counts, and the share of them whose power bounds the forces' noise."""


def without_force_noise(spectrum: WindowedSpectrum, variance: Real) -> WindowedSpectrum:
    """Replace a recording's measured forces by what they say of the true ones, ``F_hat = W F``, ``W = (P - S) P^-1``.

    P is the measured forces' spectral matrix around a line and S the variance of their noise (Wiener, 1949). Where a
    spectrum holds little but noise, as between the harmonics of a steady cut or above the band of the cutting force,
    the structure was not pushed by what was measured: predicted from it, a response would be missing and a mode would
    seem to cancel it. The same holds across forces that rise and fall together. P is averaged as widely as the spectrum
    is smooth: from few lines, those that noise makes strong by chance would be taken for force.

    Parameters
    ----------
    spectrum
        Its forces replaced already or not.
    variance : (n_excitations,)
        Of the forces' noise a line; no more of it is believed than what the quietest lines hold.
    """
    n = spectrum.start + len(spectrum.window)
    forces = rfft(spectrum.recording.force[spectrum.start : n] * spectrum.window[:, None], axis=0)
    products = forces[:, :, None] * forces[:, None, :].conj()
    own = np.einsum("kqq->kq", products).real
    wide = min(WIDELY, len(own) // 5)
    quiet = np.quantile(_around(own, wide)[wide:-wide], QUIETEST, axis=0)
    deviation = np.sqrt(np.maximum(np.minimum(variance, quiet), 1e-12 * own.mean(axis=0)))
    power, chance = _smoothed(products / np.outer(deviation, deviation))
    values, vectors = np.linalg.eigh(power)
    # less by what chance may have added, or noise that looks strong passes for force
    share = 1 - 1 / np.maximum(values / (1 + np.sqrt(chance))[:, None], 1.0)
    # which directions these are is itself known from some lines only
    unsure = np.maximum(1 - 1 / np.maximum(values, 1.0), chance[:, None])
    whole, root = (
        deviation[:, None] * (vectors * weight[:, None, :]) @ vectors.conj().swapaxes(1, 2) / deviation
        for weight in (share, np.sqrt(unsure))
    )
    place = spectrum.padded_frequencies * len(spectrum.window) / spectrum.recording.rate
    low = np.minimum(place.astype(int), len(whole) - 2)
    high = (place - low)[:, None, None]
    padded = (1 - high) * whole[low] + high * whole[low + 1]
    return replace(
        spectrum,
        force_lines=np.einsum("kij,kj->ki", padded, padded_force(spectrum)),
        force_here=np.einsum("kij,kj->ki", whole[spectrum.band], forces[spectrum.band]),
        trust=root[spectrum.band],
    )


def _smoothed(products: Complex) -> tuple[Complex, Real]:
    """Mean of matrices over as many neighbours as differ by no more than chance does, and its relative variance."""
    widest = min(SCALES[0], len(products) // 5)
    mean, chance = _around(products, widest), np.full(len(products), float(np.sum(_weights(widest) ** 2)))
    for count in SCALES[1:]:
        if count >= widest:
            continue
        closer, variance = _around(products, count), float(np.sum(_weights(count) ** 2))
        power, around = (np.maximum(np.einsum("kqq->k", one).real, 1e-300) for one in (closer, mean))
        beyond = np.abs(np.log(power / around)) / np.sqrt(variance) - CHANCE
        believed = np.clip(beyond / 2.0, 0.0, 1.0)
        mean = mean + believed[:, None, None] * (closer - mean)
        chance = chance + believed * (variance - chance)
    return mean, chance


def _around(power: Complex, count: int) -> Complex:
    """Mean over ``count`` neighbouring lines, tapered."""
    flat = power.reshape(len(power), -1)
    return np.asarray(convolve(flat, _weights(count)[:, None], mode="same", method="fft").reshape(power.shape))


def _weights(count: int) -> Real:
    """Of neighbours in a mean."""
    weights = hann(count + 2)[1:-1]
    return np.asarray(weights / weights.sum())
