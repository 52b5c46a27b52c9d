"""Maps of residual power over noise power: frequency, channel, time and spindle order."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from acquisition import RecordingFile, opened
from estimation import WindowedSpectrum
from millfrf.core import Complex, Real, tables_of_setup

from ..models.first_motion import predict_lines
from ..models.fitting import Fit
from ..models.hypothesis import Hypothesis
from ..models.misfit import fitted_noise, through_structure
from ..records.bands import padded_end
from ..records.noise_model import whitening


def band_means(frequencies: Real, power: Real, edges: Real) -> tuple[Real, Real]:
    """Return the mean power in each band, (n_bands, n), and its number of lines, (n_bands,).

    A line on an edge belongs to the upper band; lines beyond the first and the last edge belong to the first and the
    last band. The mean of a band without lines is nan. ``power`` is (n_lines, n), the rising ``edges`` (n_bands + 1,),
    Hz.

    Examples
    --------
    >>> power = np.array([[4.0], [2.0], [8.0]])
    >>> means, counts = band_means(np.array([1.0, 2.0, 3.0]), power, np.array([1.0, 3.0, 4.0]))
    >>> means.tolist(), counts.tolist()
    ([[3.0], [8.0]], [2.0, 1.0])
    """
    place = np.digitize(frequencies, edges[1:-1])
    counts = np.bincount(place, minlength=len(edges) - 1).astype(float)
    sums = np.array([np.bincount(place, column, len(counts)) for column in power.T]).T
    return np.where(counts[:, None] > 0, sums / np.maximum(counts, 1)[:, None], np.nan), counts


BANDS_PER_OCTAVE = 6  # number of bands per octave of the residual maps
MIN_LINES = 12  # smallest number of lines of a band in every recording


@dataclass(frozen=True)
class ResidualMap:
    """Mean of ``|residual|^2`` over noise variance in cells; 1 for noise alone.

    Parameters
    ----------
    edges : (n_bands + 1,), Hz
        Edges of the frequency bands.
    channels
        Names of the responses.
    recordings
        Names of the recordings, weakest force first.
    ratio : (n_recordings, n_bands, n_responses)
        Residual power of each channel over the variance of the channel's noise.
    joint : (n_recordings, n_bands)
        Mean residual power of all channels together, whitened.
    count : (n_recordings, n_bands)
        Independent complex lines of a cell of one channel.
    """

    edges: Real
    channels: tuple[str, ...]
    recordings: tuple[str, ...]
    ratio: Real
    joint: Real
    count: Real

    def pooled(self, axis: tuple[int, ...]) -> tuple[Real, Real]:
        """Return the means of ``ratio`` over ``axis``, weighted by the lines of the cells, and the number of lines."""
        weight = np.broadcast_to(self.count[:, :, None], self.ratio.shape)
        total = weight.sum(axis=axis)
        return np.asarray((self.ratio * weight).sum(axis=axis) / np.maximum(total, 1e-9)), np.asarray(total)

    def pooled_joint(self, axis: int) -> tuple[Real, Real]:
        """Return the weighted means of ``joint`` over ``axis``, and the number of lines of all channels."""
        total = self.count.sum(axis=axis)
        ratio = (self.joint * self.count).sum(axis=axis) / np.maximum(total, 1e-9)
        return np.asarray(ratio), np.asarray(total * len(self.channels))


def overlap(window: Real) -> float:
    """Return the number of neighbouring lines per independent line of a window, ``N sum w^4 / (sum w^2)^2``."""
    return float(len(window) * np.sum(window**4) / np.sum(window**2) ** 2)


def band_edges(lines: Sequence[WindowedSpectrum], per_octave: int = BANDS_PER_OCTAVE, least: int = MIN_LINES) -> Real:
    """Return edges (Hz) of bands evenly wide on a logarithmic axis, each with ``least`` lines in every recording."""
    low = max(float(recording.frequencies[0]) for recording in lines)
    high = min(float(recording.frequencies[-1]) for recording in lines)
    fine = np.geomspace(low, high, max(2, round(per_octave * np.log2(high / low)) + 1))
    step = max(recording.recording.rate / len(recording.window) for recording in lines)
    edges = [fine[0]]
    for edge in fine[1:]:
        if edge - edges[-1] >= least * step:
            edges.append(edge)
    if len(edges) < 2:
        return np.array([low, high])
    edges[-1] = fine[-1]
    return np.array(edges)


def normalised(
    hypothesis: Hypothesis, reference: Fit, number: int, lines: WindowedSpectrum
) -> tuple[Complex, Complex, Real]:
    """Return the residual lines of one recording in units of the noise, and the variance of the noise.

    In the first result each channel is divided by its noise, in the second all channels are whitened together. All
    three results are (n_lines, n_responses). ``number`` is the index of the recording in the fit ``reference``.
    """
    residual = lines.measured - predict_lines(hypothesis, lines).response
    through = through_structure(reference.hypothesis, lines)
    covariance = fitted_noise(lines, through, reference.noises[number])
    variance = np.real(np.einsum("kii->ki", covariance))
    return residual / np.sqrt(variance), np.einsum("kij,kj->ki", whitening(covariance), residual), variance


def residual_map(hypothesis: Hypothesis, reference: Fit, lines: Sequence[WindowedSpectrum], edges: Real) -> ResidualMap:
    """Return the map of one hypothesis's residual over all recordings, with the noise of ``reference``."""
    ratio, joint, count = [], [], []
    for number, recording in enumerate(lines):
        single, white, _ = normalised(hypothesis, reference, number, recording)
        channel_means, counts = band_means(recording.frequencies, np.abs(single) ** 2, edges)
        joint_means, _ = band_means(recording.frequencies, np.abs(white) ** 2, edges)
        ratio.append(np.where(counts[:, None] > 0, channel_means, 1.0))
        joint.append(np.where(counts[:, None] > 0, joint_means, 1.0).mean(axis=1))
        count.append(counts / overlap(recording.window))
    first = lines[0]
    names = first.recording.channels[-first.measured.shape[1] :]
    return ResidualMap(
        edges,
        names,
        tuple(recording.recording.name for recording in lines),
        np.array(ratio),
        np.array(joint),
        np.array(count),
    )


BLOCKS = 24  # most blocks of a recording

MIN_PERIODS = 6.0  # least length of a block, in periods of the lowest frequency


@dataclass(frozen=True)
class BlockResidual:
    """Short spectra of one recording's residual, whitened by the noise.

    Parameters
    ----------
    recording
        Name of the recording.
    times : (n_blocks + 1,), s
        Edges of the blocks, from the beginning of the recording.
    frequencies : (n_lines,), Hz
        Frequencies of the lines of a block.
    power : (n_blocks, n_lines)
        Mean residual power over the responses, 1 for noise alone.
    channels
        Number of responses.
    overlap
        Number of neighbouring lines with the information of an independent line.
    """

    recording: str
    times: Real
    frequencies: Real
    power: Real
    channels: int
    overlap: float

    def banded(self, edges: Real) -> Real:
        """Return the mean power in bands, (n_blocks, n_bands); nan in a band without lines."""
        return band_means(self.frequencies, self.power.T, edges)[0].T


def block_residual(hypothesis: Hypothesis, reference: Fit, number: int, lines: WindowedSpectrum) -> BlockResidual:
    """Return the residual of a hypothesis in blocks of time, without the lines of a removed tone.

    ``number``: index of the recording in the fit ``reference``.
    """
    rate, n = lines.recording.rate, len(lines.recording.force)
    residual = _without_gaps(lines, lines.recording.response - lines.signal(predict_lines(hypothesis, lines).spectrum))
    residual = residual[lines.start : n - padded_end(lines)]
    length = int(rate * max(len(residual) / rate / BLOCKS, MIN_PERIODS / lines.frequencies[0]))
    length = max(16, min(length, len(residual)))
    count = len(residual) // length
    window = scipy.signal.windows.hann(length, sym=False)
    window /= np.sqrt(np.sum(window**2))
    axis = np.arange(length // 2 + 1) * rate / length
    in_band = (axis >= lines.frequencies[0]) & (axis <= lines.frequencies[-1])
    blocks = residual[: count * length].reshape(count, length, -1)
    spectra = scipy.fft.rfft(blocks * window[:, None], axis=1)[:, in_band]
    white = _whitening_at(reference, number, lines, axis[in_band])
    small = np.einsum("kij,bkj->bki", white, spectra)
    times = (lines.start + length * np.arange(count + 1)) / rate
    power = np.mean(np.abs(small) ** 2, axis=2)
    return BlockResidual(lines.recording.name, times, axis[in_band], power, residual.shape[1], overlap(window))


def _without_gaps(lines: WindowedSpectrum, residual: Real) -> Real:
    """Return the residual without the frequencies in gaps between the compared lines."""
    step = lines.recording.rate / len(lines.window)
    if not (np.diff(lines.frequencies) > 1.5 * step).any():
        return residual
    axis = np.arange(len(residual) // 2 + 1) * lines.recording.rate / len(residual)
    right = np.clip(np.searchsorted(lines.frequencies, axis), 1, len(lines.frequencies) - 1)
    gap = lines.frequencies[right] - lines.frequencies[right - 1]
    in_gap = (gap > 1.5 * step) & (axis > lines.frequencies[right - 1]) & (axis < lines.frequencies[right])
    return np.asarray(scipy.fft.irfft(scipy.fft.rfft(residual, axis=0) * ~in_gap[:, None], n=len(residual), axis=0))


def _whitening_at(reference: Fit, number: int, lines: WindowedSpectrum, axis: Real) -> Complex:
    """Return the whitening at the frequencies ``axis``, from the mean noise covariance of the nearest lines."""
    through = through_structure(reference.hypothesis, lines)
    covariance = fitted_noise(lines, through, reference.noises[number])
    nearest = np.clip(np.searchsorted(0.5 * (axis[1:] + axis[:-1]), lines.frequencies), 0, len(axis) - 1)
    counts = np.maximum(np.bincount(nearest, minlength=len(axis)), 1)
    mean = np.zeros((len(axis), *covariance.shape[1:]), dtype=complex)
    np.add.at(mean, nearest, covariance)
    mean /= counts[:, None, None]
    empty = np.bincount(nearest, minlength=len(axis)) == 0
    if empty.any():
        known = np.flatnonzero(~empty)
        mean[empty] = mean[known[np.argmin(np.abs(known[None] - np.flatnonzero(empty)[:, None]), axis=1)]]
    return whitening(mean)


SPEED = "spindle_speed_rpm"
MOST_ORDERS = 24  # spindle orders that are tested
NEAR = 1.5  # distance from an order within which lines belong to it, in spacings of a block's lines
# gap between two values of the speed, in s and in median gaps, above which its sensor is assumed to have failed
MAX_GAP, USUAL_GAPS = 2.0, 20.0


@dataclass(frozen=True)
class SpindleSpeed:
    """Speed of the spindle over time, from the events or the set-up of a recording.

    Parameters
    ----------
    time : (n,), s
        Times of the values, from the beginning of the recording.
    rpm : (n,)
        Speed at these times, revolutions a minute.
    """

    time: Real
    rpm: Real

    def hertz(self, start: float, stop: float) -> tuple[float, float]:
        """Return the mean speed between two times, and its range there, revolutions a second.

        Both are NaN within a gap so long that the sensor must have failed.
        """
        steps = np.diff(self.time)
        if len(steps) and self._has_gap(steps, start, stop):
            return float("nan"), float("nan")
        at = np.interp(np.linspace(start, stop, 9), self.time, self.rpm) / 60
        return float(at.mean()), float(np.ptp(at))

    def _has_gap(self, steps: Real, start: float, stop: float) -> bool:
        """Return whether a gap between values that is much longer than usual overlaps the time span."""
        gaps = steps > max(MAX_GAP, USUAL_GAPS * float(np.median(steps)))
        return bool((gaps & (self.time[:-1] < stop) & (self.time[1:] > start)).any())


def spindle_speed(path: RecordingFile) -> SpindleSpeed | None:
    """Return the speed from a recording's events, or a constant speed from its set-up; None if neither states it."""
    with opened(path) as recording:
        if SPEED in recording.events:
            time, rpm = recording.events[SPEED].read()
            good = np.isfinite(time) & np.isfinite(rpm)
            if good.any():
                return SpindleSpeed(time[good], rpm[good])
        setup = recording.setup
    for table in tables_of_setup(setup).values():
        stated = table.get(SPEED)
        if isinstance(stated, int | float) and table.get("speed_profile", "constant") == "constant":
            return SpindleSpeed(np.zeros(1), np.array([float(stated)]))
    return None


def order_powers(blocks: BlockResidual, speed: SpindleSpeed) -> tuple[Real, Real, Real]:
    """Return residual power at each order, reference power and number of independent lines, each (MOST_ORDERS,).

    Blocks in which the speed changes the order frequency by more than the resolution are left out. The reference power
    is the power of the lines midway between neighbouring orders.
    """
    step = float(blocks.frequencies[1] - blocks.frequencies[0])
    sums = np.zeros((3, MOST_ORDERS))
    for row, start, stop in zip(blocks.power, blocks.times[:-1], blocks.times[1:], strict=True):
        rotation, change = speed.hertz(float(start), float(stop))
        if not rotation >= 4 * NEAR * step:  # too slow, or unknown (NaN)
            continue
        for k in range(MOST_ORDERS):
            order = k + 1
            if order * change > 2 * NEAR * step:
                break
            on = np.abs(blocks.frequencies - order * rotation) <= NEAR * step
            off = np.abs(np.abs(blocks.frequencies - order * rotation) - rotation / 2) <= NEAR * step
            if on.any() and off.any():
                sums[:, k] += row[on].sum(), row[off].mean() * on.sum(), on.sum()
    counts = np.maximum(sums[2], 1)
    return sums[0] / counts, sums[1] / counts, sums[2] * blocks.channels / blocks.overlap
