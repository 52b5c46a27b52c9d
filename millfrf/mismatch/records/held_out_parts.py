"""Parts held out from fits, measured noise, and estimates of the true forces."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from estimation import WindowedSpectrum, find_repeats, noise_of_periods, padded_force, steady_periods
from millfrf.core import Complex, InputError, Real

PARTS, PART_LINES = (0.25, 0.75), 24
"""Share of a recording between which it is held out where there are two or fewer; lines at least of what is left."""


@dataclass(frozen=True)
class Recordings:
    """The same recordings twice, weakest first.

    Parameters
    ----------
    mended
        Recordings without tones and with clipped samples put back, to which causes are fitted.
    measured
        Recordings as they were measured, on which errors are counted.
    worst
        Number of the recording of which modal parameters alone, fitted to all, leave most: a law that is felt at one
        of two levels must show there.
    chosen
        Number of a recording that is held out instead of the usual one.
    """

    mended: list[WindowedSpectrum]
    measured: list[WindowedSpectrum]
    worst: int = 0
    chosen: int | None = None

    @property
    def held_out_place(self) -> int:
        """Number of the recording held out: the middle level, so that the others bracket it; of two the worst."""
        if self.chosen is not None:
            return self.chosen
        return self.worst if len(self.mended) == 2 else (len(self.mended) - 1) // 2

    @property
    def in_part(self) -> bool:
        """Whether only the middle half is held out: of two levels one alone says little of a law at the other."""
        here = self.measured[self.held_out_place]
        return len(self.mended) < 3 and PARTS[0] * len(here.frequencies) > PART_LINES

    @property
    def tested(self) -> bool:
        """Whether anything can be held out: not of a single recording that is too short to be parted."""
        return len(self.mended) > 1 or self.in_part

    def others(self, which: list[WindowedSpectrum]) -> list[WindowedSpectrum]:
        """What fits may see: all recordings but the one held out, or the first and last quarter of each.

        Levels keep their weights if all are seen in the same parts.
        """
        if self.in_part:
            return [part for one in which for part in (one.between(0.0, PARTS[0]), one.between(PARTS[1], 1.0))]
        return [one for k, one in enumerate(which) if k != self.held_out_place] or which

    def held_out(self, which: list[WindowedSpectrum]) -> WindowedSpectrum:
        """What fits may not see and errors are told of: a recording, or its middle half."""
        here = which[self.held_out_place]
        return here.between(*PARTS) if self.in_part else here

    def held_out_elsewhere(self, which: list[WindowedSpectrum]) -> dict[int, WindowedSpectrum]:
        """What fits may not see of other recordings than :meth:`held_out`, by their numbers."""
        if not self.in_part:
            return {}
        return {k: one.between(*PARTS) for k, one in enumerate(which) if k != self.held_out_place}


INFERRED = "What the model leaves, of one smooth colour: what is unexplained may count as noise."
"""On what the noise rests where forces do not repeat."""


def with_measured_noise(lines: WindowedSpectrum) -> WindowedSpectrum:
    """The lines with the noise that their periods show; as they are where forces do not repeat.

    Silent stretches are not taken: they lack the noise that comes with the force.

    Parameters
    ----------
    lines
        Windowed lines of one recording.
    """
    repeated = find_repeats(lines.recording.force)
    if repeated is None:
        return lines
    band = float(lines.frequencies[0]), float(lines.frequencies[-1])
    try:
        noise = noise_of_periods(steady_periods([lines.recording], repeated).within(band))
        return replace(lines, noise=noise.at(lines.frequencies, lines.recording.rate))
    except InputError:
        # too few steady periods, or too few lines of them in the band
        return lines


def noise_content(lines: WindowedSpectrum, covariance: Complex) -> dict[str, Any]:
    """What the file says of one recording's noise: its share of the response, and on what it rests.

    Parameters
    ----------
    lines
        Windowed lines of the recording.
    covariance : (n_lines, n_responses, n_responses)
        Covariance of its noise at the lines.
    """
    own = np.einsum("kpp->p", covariance).real
    whole = np.sum(np.abs(lines.measured) ** 2, axis=0)
    share = float(np.sqrt(own.sum() / whole.sum()))
    kind = "inferred" if lines.noise is None else lines.noise.kind
    rests_on = INFERRED if lines.noise is None else lines.noise.statement
    return {
        "recording": lines.recording.name,
        "kind": kind,
        "share": share,
        "responses": [float(one) for one in np.sqrt(own / whole)],
        "rests_on": rests_on,
        "sentence": f"Noise of {lines.recording.name}: {100 * share:.2g} %, {kind}. {rests_on}",
    }


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
    forces = scipy.fft.rfft(spectrum.recording.force[spectrum.start : n] * spectrum.window[:, None], axis=0)
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
    return np.asarray(
        scipy.signal.convolve(flat, _weights(count)[:, None], mode="same", method="fft").reshape(power.shape)
    )


def _weights(count: int) -> Real:
    """Return the weights of ``count`` neighbours in a mean."""
    weights = scipy.signal.windows.hann(count + 2)[1:-1]
    return np.asarray(weights / weights.sum())
