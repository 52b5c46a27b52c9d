"""The compared band, parts held out from fits, measured noise, and estimates of the true forces."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from estimation import (
    BandRecording,
    WindowedSpectrum,
    find_repeats,
    noise_of_periods,
    padded_force,
    steady_periods,
    windowed_spectrum,
)
from millfrf.core import Band, Complex, InputError, Real
from modal_fit import ModalModel

# shares between which one or two recordings are held out, and smallest number of lines of the rest
HELD_OUT_SPAN, MIN_PART_LINES = (0.25, 0.75), 24


@dataclass(frozen=True)
class Recordings:
    """The same recordings repaired and as measured, weakest first."""

    repaired: list[WindowedSpectrum]  # recordings without tones and with repaired clipping, to which causes are fitted
    measured: list[WindowedSpectrum]
    # index of the recording with the largest error of modal parameters alone, in which a law that acts at only one of
    # two levels must appear
    worst: int = 0
    chosen: int | None = None  # index of a recording that is held out instead of the usual one
    # whether the middle half of each recording is held out however many there are, as each has numbers of its own
    own_numbers: bool = False

    @property
    def held_out_place(self) -> int:
        """Index of the held-out recording: the middle level, or the worst of two recordings."""
        if self.chosen is not None:
            return self.chosen
        return self.worst if len(self.repaired) == 2 else (len(self.repaired) - 1) // 2

    @property
    def in_part(self) -> bool:
        """Whether only the middle half of a recording is held out.

        It is if each recording has numbers of its own, or if there are fewer than three recordings.
        """
        recording, (begin, end) = self.measured[self.held_out_place], HELD_OUT_SPAN
        long = (1 - (end - begin)) * len(recording.frequencies) > MIN_PART_LINES
        return (self.own_numbers or len(self.repaired) < 3) and long

    @property
    def tested(self) -> bool:
        """Whether data can be held out; False for a short recording that is the only one or has numbers of its own."""
        return self.in_part or (len(self.repaired) > 1 and not self.own_numbers)

    def others(self, which: list[WindowedSpectrum]) -> list[WindowedSpectrum]:
        """Return the data for fits: all other recordings, or the first and last quarter of each recording.

        The same parts of all recordings are used, so that the levels keep their weights.
        """
        if self.in_part:
            return [
                part
                for recording in which
                for part in (recording.between(0.0, HELD_OUT_SPAN[0]), recording.between(HELD_OUT_SPAN[1], 1.0))
            ]
        return [recording for k, recording in enumerate(which) if k != self.held_out_place] or which

    def held_out(self, which: list[WindowedSpectrum]) -> WindowedSpectrum:
        """Return the held-out data: the held-out recording, or its middle half."""
        recording = which[self.held_out_place]
        return recording.between(*HELD_OUT_SPAN) if self.in_part else recording

    def held_out_elsewhere(self, which: list[WindowedSpectrum]) -> dict[int, WindowedSpectrum]:
        """Return the held-out parts of the other recordings, by their indices."""
        if not self.in_part:
            return {}
        return {k: recording.between(*HELD_OUT_SPAN) for k, recording in enumerate(which) if k != self.held_out_place}


# basis of the noise if forces do not repeat
INFERRED = "What the model leaves, of one smooth colour: what is unexplained may count as noise."


def with_measured_noise(lines: WindowedSpectrum) -> WindowedSpectrum:
    """Return the lines with the noise between repeated periods; unchanged if forces do not repeat.

    Silent stretches are not used, as they lack the noise that the force causes.
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
    """Return the entry of a file on the noise of one recording: its share of the response, and its basis.

    ``covariance``: covariance of its noise at the lines, (n_lines, n_responses, n_responses).
    """
    own = np.einsum("kpp->p", covariance).real
    power = np.sum(np.abs(lines.measured) ** 2, axis=0)
    share = float(np.sqrt(own.sum() / power.sum()))
    kind = "inferred" if lines.noise is None else lines.noise.kind
    basis = INFERRED if lines.noise is None else lines.noise.statement
    return {
        "recording": lines.recording.name,
        "kind": kind,
        "share": share,
        "responses": [float(ratio) for ratio in np.sqrt(own / power)],
        "rests_on": basis,
        "sentence": f"Noise of {lines.recording.name}: {100 * share:.2g} %, {kind}. {basis}",
    }


AVERAGES = (301, 101, 31, 11)  # lines over which the spectral matrix of the forces is averaged, from wide to narrow

# standard deviations by which the power over fewer lines must differ to be used; from two more on it is used fully
SIGNIFICANT = 3.0

# lines of an average without much scatter, and share of such averages whose power bounds the noise of the forces
WIDE_AVERAGE, QUIET_SHARE = 201, 0.05


def without_force_noise(spectrum: WindowedSpectrum, variance: Real) -> WindowedSpectrum:
    """Replace the measured forces F by estimates of the true ones, ``F_hat = W F``, ``W = (P - S) P^-1``.

    P is the spectral matrix of the measured forces around a line and S the variance of their noise (Wiener, 1949).
    Between the harmonics of a steady cut, or above the band of the cutting force, the measured spectrum is mainly
    noise, which did not act on the structure. A prediction from it contains a response that did not occur, and an added
    mode could seem to cancel it. The same is true for combinations of forces that are nearly proportional. P is
    averaged over as many lines as the spectrum is smooth: over few lines, noise may be taken for force by chance.

    ``variance`` (n_excitations,): variance of the forces' noise on each line, in the unit of the windowed spectrum's
    squared lines. The power of the quietest lines is its upper bound.
    """
    forces = scipy.fft.rfft(spectrum.windowed(spectrum.recording.force), axis=0)
    products = forces[:, :, None] * forces[:, None, :].conj()
    own = np.einsum("kqq->kq", products).real
    wide = min(WIDE_AVERAGE, len(own) // 5)
    quietest = np.quantile(_around(own, wide)[wide:-wide], QUIET_SHARE, axis=0)
    size = own.mean(axis=0)
    # a silent force has no noise, and its lines remain zero whatever they are divided by
    least = 1e-12 * np.where(size > 0, size, size.max())
    deviation = np.sqrt(np.maximum(np.minimum(variance, quietest), least))
    power, chance = _smoothed(products / np.outer(deviation, deviation))
    values, vectors = np.linalg.eigh(power)
    # the estimated power may be too large by chance: without this reduction, noise would be taken for force
    share = 1 - 1 / np.maximum(values / (1 + np.sqrt(chance))[:, None], 1.0)
    # the directions are estimated from a limited number of lines
    uncertain = np.maximum(1 - 1 / np.maximum(values, 1.0), chance[:, None])
    gain, root = (
        deviation[:, None] * (vectors * weight[:, None, :]) @ vectors.conj().swapaxes(1, 2) / deviation
        for weight in (share, np.sqrt(uncertain))
    )
    place = spectrum.padded_frequencies * len(spectrum.window) / spectrum.recording.rate
    low = np.minimum(place.astype(int), len(gain) - 2)
    high = (place - low)[:, None, None]
    padded = (1 - high) * gain[low] + high * gain[low + 1]
    return replace(
        spectrum,
        force_lines=np.einsum("kij,kj->ki", padded, padded_force(spectrum)),
        force_here=np.einsum("kij,kj->ki", gain[spectrum.band], forces[spectrum.band]),
        trust=root[spectrum.band],
    )


def _smoothed(products: Complex) -> tuple[Complex, Real]:
    """Return means of matrices over as many neighbours as differ only by chance, and the means' relative variances."""
    widest = min(AVERAGES[0], len(products) // 5)
    mean, chance = _around(products, widest), np.full(len(products), float(np.sum(_weights(widest) ** 2)))
    for count in AVERAGES[1:]:
        if count >= widest:
            continue
        closer, variance = _around(products, count), float(np.sum(_weights(count) ** 2))
        power, around = (np.maximum(np.einsum("kqq->k", matrices).real, 1e-300) for matrices in (closer, mean))
        beyond = np.abs(np.log(power / around)) / np.sqrt(variance) - SIGNIFICANT
        weight = np.clip(beyond / 2.0, 0.0, 1.0)
        mean = mean + weight[:, None, None] * (closer - mean)
        chance = chance + weight * (variance - chance)
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


# lowest mode over the lower edge, and upper edge over the highest mode, if a model states no band
BELOW_LOWEST, ABOVE = 3.0, 3.0

RATE_SHARE = 0.42  # highest frequency that is compared, as a share of the sample rate

MIN_MARGIN = 1.1  # smallest ratio of the upper edge to the highest mode


@dataclass(frozen=True)
class ComparedBand:
    """Band of frequencies in which a model and a recording are compared."""

    # lower and upper edge of the band, Hz
    low: float
    high: float
    why: str  # origin of the edges, as the end of a sentence that begins with the band
    # whether the lower edge follows the power of each recording, as neither the model nor the user states a band
    follows: bool = False

    @property
    def edges(self) -> tuple[float, float]:
        """Both edges, Hz."""
        return self.low, self.high

    @property
    def sentence(self) -> str:
        """Band and its reason as text.

        Examples
        --------
        >>> ComparedBand(13.0, 25.0, "the band in which the model holds").sentence
        'compared from 13 to 25 Hz: the band in which the model holds'
        """
        return f"compared from {self.low:.3g} to {self.high:.3g} Hz: {self.why}"


def compared_band(model: ModalModel, rate: float, requested: Band | None = None) -> ComparedBand:
    """Return the band in which a model and a recording are compared.

    It is the requested band, or else the band in which the model is valid, as modes outside it would look like missing
    physics. A model that states no band is compared from a third of its lowest mode to three times its highest mode.

    ``rate``: sample rate of the recording, Hz. ``requested``: lowest and highest frequency, Hz; None: the band of
    the model.

    Examples
    --------
    >>> import numpy as np
    >>> from modal_fit import ModalModel
    >>> model = ModalModel(np.array([-1 + 100j]), np.ones((1, 1)), np.ones((1, 1)), ("T:+X",), ("T:+X",), band=(12, 24))
    >>> compared_band(model, 512.0).edges
    (12.0, 24.0)
    """
    edges = reach_of(model, rate)
    if requested is not None:
        return _requested_band(model, rate, requested)
    if model.band is None:
        return ComparedBand(
            *edges, "a third of the lowest to three times the highest mode, as the model states no band", True
        )
    low, high = model.band
    if high <= RATE_SHARE * rate:
        return ComparedBand(low, high, "the band in which the model holds")
    high = RATE_SHARE * rate
    if low >= high:
        raise InputError(
            f"sampled at {rate:g} Hz, too slowly for a model that holds from {low:g} Hz on; "
            f"record at {2.5 * model.band[1]:.0f} Hz or more"
        )
    return ComparedBand(low, high, f"the model holds to {model.band[1]:g} Hz, and {rate:g} samples a second end there")


def _requested_band(model: ModalModel, rate: float, requested: Band) -> ComparedBand:
    """Return the band that a user requests, with a note on what the model states."""
    low, high = requested
    if not 0 <= low < high:
        raise InputError(f"band {low:g} to {high:g} Hz is empty; give 0 <= low < high")
    if high > RATE_SHARE * rate:
        raise InputError(
            f"band up to {high:g} Hz: recordings sampled at {rate:g} Hz are compared up to {RATE_SHARE * rate:.4g} Hz; "
            "lower the upper edge"
        )
    natural = model.natural_frequencies
    if not ((natural >= low) & (natural <= high)).any():
        raise InputError(
            f"band {low:g} to {high:g} Hz holds no mode of the model, which has "
            f"{natural.min():.4g} to {natural.max():.4g} Hz; give a band around one"
        )
    why = "the band that was asked for"
    if model.band is None:
        why += ", as the model states none"
    elif low < model.band[0] or high > model.band[1]:
        why += f", beyond the {model.band[0]:.3g} to {model.band[1]:.3g} Hz in which the model holds"
    return ComparedBand(low, high, why)


def reach_of(model: ModalModel, rate: float) -> tuple[float, float]:
    """Return the band from a third of the lowest to three times the highest mode, as far as ``rate`` allows, Hz."""
    natural = model.natural_frequencies
    high = min(ABOVE * float(natural.max()), RATE_SHARE * rate)
    if high < MIN_MARGIN * natural.max():
        raise InputError(
            f"sampled at {rate:g} Hz, too slowly for a mode at {natural.max():.4g} Hz; "
            f"record at {4 * natural.max():.0f} Hz or more"
        )
    return float(natural.min()) / BELOW_LOWEST, high


# Share of the power of the forces and of the motion that may lie below the default band. A modal model holds down to 0
# Hz; the default band leaves out low frequencies only because sensors drift there.
LEFT_BELOW = 0.05


def powers(recording: BandRecording) -> tuple[Real, Real, Real]:
    """Return the frequencies (n,), Hz, and the shares of the power of forces and of motion at each, (n,).

    The power of each channel is relative to its power without its mean.
    """
    window = scipy.signal.windows.tukey(len(recording.force), 0.08)[:, None]
    shares = []
    for signals in (recording.force, recording.response):
        power = np.abs(scipy.fft.rfft((signals - signals.mean(axis=0)) * window, axis=0)) ** 2
        power[0] = 0.0
        shares.append(np.mean(power / np.maximum(power.sum(axis=0), 1e-300), axis=1))
    return scipy.fft.rfftfreq(len(recording.force), 1 / recording.rate), shares[0], shares[1]


def driven_band(recording: BandRecording, band: ComparedBand) -> ComparedBand:
    """Return the default band with its lower edge where both forces and motion begin to have power.

    A structure that is driven below its modes, by a slow sine or along a trajectory, shows its friction there.
    """
    if not band.follows:
        return band
    frequencies, force, motion = powers(recording)
    below = np.minimum(np.cumsum(force), np.cumsum(motion))
    # a tone leaks through the window to two lines on each side, which are wider in the compared part
    low = float(frequencies[max(int(np.argmax(below > LEFT_BELOW)) - 3, 1)])
    if low >= band.low:
        return band
    why = "from where forces and motion have power to three times the highest mode, as the model states no band"
    return replace(band, low=low, why=why)


def compared_power(lines: WindowedSpectrum) -> tuple[float, float]:
    """Return the shares of the power of the forces and of the motion of a recording within the compared lines."""
    frequencies, force, motion = powers(lines.recording)
    slack = 0.5 * lines.recording.rate / len(lines.window)
    inside = (frequencies >= lines.frequencies[0] - slack) & (frequencies <= lines.frequencies[-1] + slack)
    return float(force[inside].sum()), float(motion[inside].sum())


# Power of a force at a line over its measured noise from which the line is excited. Noise alone exceeds it at one line
# in e^100, and the leakage of a force that begins suddenly stays below it.
EXCITED = 100.0

# smallest noise of a force over the power of its largest line: rounding errors of a sum of sines
ROUNDING = 1e-12


def excited_band(lines: WindowedSpectrum, band: ComparedBand) -> ComparedBand:
    """Return the compared band from the lowest to the highest line that a force excites.

    A line k is excited if ``|F_k|^2 > 100 S_k`` with the measured noise S of the force. At other lines the measured
    force is only noise ``n_F``. The residual ``x - G (F + n_F)`` then contains ``G n_F``, so that a model with a
    smaller response is likelier. Without this limit, a mode that did not exist was reported with an evidence of 1251:
    it cancelled the response above the highest line of a multisine.

    ``band``: band of the model, or requested band, Hz.
    The band stays the same if the noise of the forces was not measured, or every force is below it.
    """
    if lines.noise is None:
        return band
    power = np.abs(lines.force_here) ** 2
    noise = np.maximum(np.einsum("kqq->kq", lines.noise.forces).real, ROUNDING * power.max(axis=0))
    excited = np.flatnonzero((power > EXCITED * noise).any(axis=1))
    if not len(excited):
        return band
    frequencies, spacing = lines.frequencies, float(lines.frequencies[1] - lines.frequencies[0])
    low = max(band.low, float(frequencies[excited[0]]) - spacing)
    high = min(band.high, float(frequencies[excited[-1]]) + spacing)
    # there may be no lines at the edges of the band
    if low - band.low < 2 * spacing and band.high - high < 2 * spacing:
        return band
    return replace(band, low=low, high=high, why=f"{band.why}, as far as the forces stand out of their noise")


def padded_end(lines: WindowedSpectrum) -> int:
    """Return the number of samples at the end of a recording that the beginning of the padding changes.

    They are at most half a second, and a twentieth of a short recording.
    """
    recording = lines.recording
    return max(1, min(int(recording.rate) // 2, len(recording.force) // 20))


def compared_lines(recording: BandRecording, band: ComparedBand, decay: float) -> tuple[WindowedSpectrum, ComparedBand]:
    """Return the compared lines of one recording with the noise of its periods, and their band.

    ``band``: band of the model, or requested band, Hz. ``decay``: decay rate of the slowest mode, 1/s.
    """
    band = driven_band(recording, band)
    lines = with_measured_noise(windowed_spectrum(recording, band.edges, decay, first_motion=True))
    narrower = excited_band(lines, band)
    if narrower == band:
        return lines, band
    return with_measured_noise(windowed_spectrum(recording, narrower.edges, decay, first_motion=True)), narrower
