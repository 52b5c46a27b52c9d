"""Measured forces replaced by the estimates of the true forces that they give."""

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
"""Standard deviations by which the power over fewer lines must differ to be believed; from two more on it is believed
fully."""

WIDELY, QUIETEST = 201, 0.05
"""Lines over which chance averages out, and the share of such means whose power bounds the forces' noise."""


def without_force_noise(spectrum: WindowedSpectrum, variance: Real) -> WindowedSpectrum:
    """Replace a recording's measured forces F by estimates of the true ones, ``F_hat = W F``, ``W = (P - S) P^-1``.

    P is the measured forces' spectral matrix around a line and S the variance of their noise (Wiener, 1949). Where a
    spectrum holds little but noise, as between the harmonics of a steady cut or above the band of the cutting force,
    the measured force did not push the structure: a prediction from it would hold a response that was never there, and
    a mode would seem to cancel it. The same holds across forces that rise and fall together. P is averaged as widely as
    the spectrum is smooth: an average over few lines would take those for force that noise makes strong by chance.

    Parameters
    ----------
    spectrum
        Windowed spectrum of the recording; its forces may have been replaced before.
    variance : (n_excitations,)
        Variance of the forces' noise on each line, in the unit of the windowed spectrum's squared lines. The power of
        the quietest lines is its upper bound.
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
    # chance may have added to the power: without this reduction, strong noise would pass for force
    share = 1 - 1 / np.maximum(values / (1 + np.sqrt(chance))[:, None], 1.0)
    # the directions themselves are known from a limited number of lines only
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
    """Return means of matrices over as many neighbours as differ by chance alone, and their relative variances."""
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
    """Return the tapered mean over ``count`` neighbouring lines."""
    flat = power.reshape(len(power), -1)
    return np.asarray(convolve(flat, _weights(count)[:, None], mode="same", method="fft").reshape(power.shape))


def _weights(count: int) -> Real:
    """Return the weights of ``count`` neighbours in a mean."""
    weights = hann(count + 2)[1:-1]
    return np.asarray(weights / weights.sum())
