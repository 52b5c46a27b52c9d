"""Tests whether a residual is more than noise: it follows the signal, repeats with the forces, or has bursts."""

from dataclasses import dataclass

import numpy as np
import scipy

from estimation import WindowedSpectrum, repeat_of
from millfrf.core import Complex, Real
from millfrf.core.compilation import compiled

from ..inference.diagnosis import Remainder
from ..models.first_motion import predict_lines
from ..models.hypothesis import Hypothesis
from ..models.misfit import relative_residual_power, through_structure
from ..models.settings import RESIDUAL
from ..records.bands import padded_end

MIN_SEGMENTS = 6  # least number of segments in which the levels of residual and signal are compared


def share_of_response(hypothesis: Hypothesis, lines: list[WindowedSpectrum]) -> float:
    """Return ``sqrt(mean_i sum_k |Y_ik - P_ik|^2 / sum_k |Y_ik|^2)`` over channels i of all recordings and lines k."""
    return float(np.sqrt(np.mean([relative_residual_power(hypothesis, recording) for recording in lines])))


def prediction_and_residual(hypothesis: Hypothesis, lines: WindowedSpectrum) -> tuple[Real, Real]:
    """Return the predicted response and the residual in time, each (n_samples, n_responses), in the responses' units.

    The run-in at the beginning and the end, in which the padding begins, are left out.
    """
    n = len(lines.recording.force)
    predicted = scipy.fft.irfft(predict_lines(hypothesis, lines).spectrum, n=lines.padded, axis=0)[:n]
    used = slice(lines.start, n - padded_end(lines))
    return np.asarray(predicted[used]), np.asarray((lines.recording.response - predicted)[used])


@compiled("(float64[:,::1], float64[:,::1], int64)")
def explained_power(residual: Real, predicted: Real, bins: int) -> float:
    """Return the part of the residual power that follows the predicted power, both (n_bins, n_segments).

    ``P_residual = a + b P_same cell + c P_all frequencies`` with a, b, c >= 0 is fitted by weighted least squares in
    each block of ``bins`` neighbouring bins. The scatter of noise power is proportional to its level. The weights
    therefore use the mean level in the first fit, and the level of the previous fit in two more fits.
    """
    count = residual.shape[1]
    total = np.zeros(count)
    for k in range(len(predicted)):
        total += predicted[k] / len(predicted)
    broad = max(total.mean(), 1e-300)
    explained = 0.0
    for start in range(0, len(residual), bins):
        stop = min(start + bins, len(residual))
        level = max(residual[start:stop].mean(), 1e-300)
        same = max(predicted[start:stop].mean(), 1e-300)
        factors = np.array([level, 0.0, 0.0])
        for turn in range(3):
            matrix, target, column = np.zeros((3, 3)), np.zeros(3), np.ones(3)
            for k in range(start, stop):
                for t in range(count):
                    column[1], column[2] = predicted[k, t] / same, total[t] / broad
                    expected = level if turn == 0 else max(float(np.sum(column * factors)), 0.1 * level)
                    for i in range(3):
                        target[i] += column[i] * residual[k, t] / expected**2
                        for j in range(3):
                            matrix[i, j] += column[i] * column[j] / expected**2
            factors = _not_negative(matrix, target)
        explained += (stop - start) * count * (factors[1] + factors[2])
    return explained


@compiled
def _not_negative(matrix: Real, target: Real) -> Real:
    """Solve three normal equations for factors >= 0.

    The equations are solved for each subset of the factors, and the best solution without negative factors is returned.
    """
    best, lowest = np.zeros(3), 0.0
    for subset in range(1, 8):
        chosen = [k for k in range(3) if subset >> k & 1]
        reduced, right = np.empty((len(chosen), len(chosen))), np.empty(len(chosen))
        for a in range(len(chosen)):
            right[a] = target[chosen[a]]
            for b in range(len(chosen)):
                reduced[a, b] = matrix[chosen[a], chosen[b]]
            # the columns may be almost equal
            reduced[a, a] *= 1.0 + 1e-12
        solution = np.linalg.solve(reduced, right)
        cost = -float(np.sum(solution * right))
        if solution.min() >= 0.0 and cost < lowest:
            lowest = cost
            best[:] = 0.0
            for a in range(len(chosen)):
                best[chosen[a]] = solution[a]
    return best


def remainder_of(hypothesis: Hypothesis, lines: list[WindowedSpectrum]) -> Remainder:
    """Measure how much of the residual follows the predicted response and is therefore not noise.

    In cells of time and frequency the residual's power is regressed, with non-negative factors, on a constant (noise in
    the band), on the predicted power in the same cell, and on the predicted power of all frequencies at the same time,
    to which a nonlinearity spreads. The two predicted terms give the power that follows the signal. Chance is estimated
    by shifting the prediction in time against the residual. If noise was measured, all power above it counts instead.

    The share (0 to 1) of the residual is the part above a high quantile of the power explained by chance. The size is
    the share of the response's power above the median of the power explained by chance. Both are means over channels
    and recordings.
    """
    shares = []
    for recording in lines:
        if recording.noise is not None:
            shares.append(_above_measured_noise(hypothesis, recording))
            continue
        following = _following_signal(hypothesis, recording)
        measured = recording.with_measured_forces()
        # If forces were replaced by estimates of the true forces, only power that follows the signal with both counts:
        # the estimates are too small where the force grows from zero, and the measured forces contain noise.
        if not np.array_equal(measured.force_here, recording.force_here):
            following = np.minimum(following, _following_signal(hypothesis, measured))
        # in a steady test the level of the signal is constant, but the forces repeat
        shares.append(np.maximum(following, _repeating(hypothesis, recording)))
    share, size = np.concatenate(shares).mean(axis=0)
    return Remainder(float(share), float(size))


def _following_signal(hypothesis: Hypothesis, lines: WindowedSpectrum) -> Real:
    """Return the power that follows the signal, divided by the power of the residual and by that of the response.

    The shape is (n_responses, 2).
    """
    predicted, residual = prediction_and_residual(hypothesis, lines)
    bins = 12  # neighbouring bins that share one noise level
    rows = []
    for p in range(residual.shape[1]):
        r, s = _cell_powers(residual[:, p], lines), _cell_powers(predicted[:, p], lines)
        explained = explained_power(r, s, bins)
        # force noise excites lightly damped modes: their few slow changes in level may agree with the signal by chance
        segments = s.shape[1]
        shifts = sorted({max(1, round(segments * share)) for share in np.linspace(0.12, 0.88, 14)})
        by_chance = [explained_power(r, np.roll(s, shift, axis=1), bins) for shift in shifts]
        power, response = float(np.sum(r)), float(np.sum(s))
        share = np.clip(explained - np.quantile(by_chance, RESIDUAL.chance), 0.0, power) / power
        rows.append([share, np.clip(explained - np.median(by_chance), 0.0, power) / response])
    return np.array(rows)


def _cell_powers(signal: Real, lines: WindowedSpectrum) -> Real:
    """Return the power in cells of frequency and time, (n_bins, n_segments), in the compared band."""
    # segments of 2 s have bins half a hertz apart; short recordings are cut into more and shorter ones
    length = 2 * int(min(2.0, lines.recording.duration / MIN_SEGMENTS) * lines.recording.rate / 2)
    transform = scipy.signal.ShortTimeFFT(
        scipy.signal.windows.hann(length, sym=False), length // 2, lines.recording.rate
    )
    power = np.abs(transform.stft(signal, p0=1, p1=len(signal) // (length // 2))) ** 2
    inside = (transform.f >= lines.frequencies[0]) & (transform.f <= lines.frequencies[-1])
    return np.asarray(power[inside])


def _above_measured_noise(hypothesis: Hypothesis, lines: WindowedSpectrum) -> Real:
    """Return the power above measured noise, divided by the power of the residual and by that of the response.

    The shape is (n_responses, 2).
    """
    assert lines.noise is not None
    residual = np.sum(np.abs(lines.measured - predict_lines(hypothesis, lines).response) ** 2, axis=0)
    response = np.sum(np.abs(lines.measured) ** 2, axis=0)
    covariance = lines.noise.covariance(lines.frequencies, through_structure(hypothesis, lines))
    variances = np.einsum("kpp->kp", covariance).real
    noise = variances.sum(axis=0)
    # The variance of the ratio of residual to noise is three times the variance of one line: once from the residual,
    # and twice from the noise, which is measured over at least two periods.
    spread = np.sqrt(3.0 * np.sum(variances**2, axis=0)) / noise
    allowed = noise * (1 + RESIDUAL.noise_errors * spread) + RESIDUAL.modal_error**2 * response
    return np.column_stack([np.clip(1 - allowed / residual, 0.0, 1.0), np.maximum(residual - noise, 0.0) / response])


def _repeating(hypothesis: Hypothesis, lines: WindowedSpectrum) -> Real:
    """Return the power that repeats with the forces, divided by the power of the residual and by that of the response.

    The shape is (n_responses, 2). The share of the residual r is ``<r(t) r(t + T)> / <r^2>`` for the period T of the
    forces. Noise does not repeat, but the effect of a missing cause does. The result is zero if the forces do not
    repeat.
    """
    n_responses = lines.measured.shape[1]
    decay = float((-hypothesis.model.poles.real).min())
    # the response of the slowest mode to earlier noise has decayed after five time constants
    lag = repeat_of(lines.recording.force, int(5.0 / decay * lines.recording.rate), len(lines.window) // 2)
    if lag is None:
        return np.zeros((n_responses, 2))
    residual = lines.measured - predict_lines(hypothesis, lines).response
    spectrum = np.zeros((len(lines.window) // 2 + 1, n_responses), dtype=complex)
    spectrum[lines.band] = residual
    signal = scipy.fft.irfft(spectrum, n=len(lines.window), axis=0)
    first, later = signal[:-lag], signal[lag:]
    power = np.mean(first**2 + later**2, axis=0) / 2
    share = np.mean(first * later, axis=0) / np.maximum(power, 1e-300)
    share = np.where(share > RESIDUAL.repeats, share, 0.0)
    if not share.any():
        return np.zeros((n_responses, 2))
    residual_power = np.sum(np.abs(residual) ** 2, axis=0)
    return np.column_stack([share, share * residual_power / np.sum(np.abs(lines.measured) ** 2, axis=0)])


BLOCK = 0.25  # length of a block, s

ENDS = 2  # blocks at either end that are faded out and do not count


@dataclass(frozen=True)
class Bursts:
    """Bursts in the residual of one recording."""

    name: str
    share: float  # largest share, over the responses, of the bursts in the power of the whitened residual
    # number of blocks of a quarter of a second with bursts, and of all blocks
    count: int
    blocks: int
    at: float  # middle of the strongest burst, s from the start of the recording

    @property
    def sentence(self) -> str:
        """Warning for the reader of a diagnosis."""
        return (
            f"the residual of {self.name} comes in bursts: {self.count} of {self.blocks} quarters of a second hold "
            f"{100 * self.share:.0f} % of its power, the strongest at {self.at:.1f} s. Noise is even: look there for "
            "impacts, dropouts or a loose plug"
        )


def bursts_left(hypothesis: Hypothesis, recordings: list[WindowedSpectrum]) -> tuple[Bursts, ...]:
    """Find recordings whose residual has bursts that the signal does not cause.

    The residual is whitened by the median of its spectra over segments, and its power is averaged over blocks of time.
    The block powers of Gaussian noise with the bandwidth B have a gamma distribution with the shape ``B T`` for the
    block length T. A burst is a block with more power than noise reaches in any block, and without a strong predicted
    response.
    """
    return tuple(bursts for lines in recordings if (bursts := _bursts(hypothesis, lines)) is not None)


def _bursts(hypothesis: Hypothesis, lines: WindowedSpectrum) -> Bursts | None:
    """Return the bursts of the response with the largest share; None if this share is small."""
    rate = lines.recording.rate
    predicted, residual = prediction_and_residual(hypothesis, lines)
    length = max(int(BLOCK * rate), 1)
    if len(residual) // length < 24 + 2 * ENDS:  # too few blocks for a median
        return None
    band = float(lines.frequencies[0]), float(lines.frequencies[-1])
    powers = _block_powers(_whitened(residual, rate, band), length)
    signal = _block_powers(predicted, length)
    quiet_signal = signal <= RESIDUAL.burst_signal * np.median(signal, axis=0)
    bursts = (powers > _largest_noise_power(band, len(powers))) & quiet_signal
    shares = np.sum(np.where(bursts, powers - 1.0, 0.0), axis=0) / powers.sum(axis=0)
    worst = int(np.argmax(shares))
    if shares[worst] < RESIDUAL.burst_share:
        return None
    strongest = int(np.argmax(np.where(bursts[:, worst], powers[:, worst], 0.0)))
    at = (lines.start + (strongest + ENDS + 0.5) * length) / rate
    return Bursts(lines.recording.name, float(shares[worst]), int(bursts[:, worst].sum()), len(powers), at)


def _whitened(residual: Real, rate: float, band: tuple[float, float]) -> Real:
    """Divide the residual (n, n_responses) in the band by the square root of its median spectrum."""
    # bursts do not change a median over segments of 2 s
    axis, density = scipy.signal.welch(
        residual, rate, nperseg=min(int(2.0 * rate), len(residual)), detrend=False, average="median", axis=0
    )
    frequencies = scipy.fft.rfftfreq(len(residual), 1 / rate)
    inside = (frequencies >= band[0]) & (frequencies <= band[1])
    level = np.stack([np.interp(frequencies, axis, column) for column in density.T], axis=1)
    # without fading, sharp ends would leak the unmodelled signal beyond the band into it
    faded = residual * scipy.signal.windows.tukey(len(residual), 2 * ENDS * BLOCK * rate / len(residual))[:, None]
    white = scipy.fft.rfft(faded, axis=0) / np.sqrt(np.maximum(level, 1e-12 * density.max(axis=0)))
    return np.asarray(scipy.fft.irfft(white * inside[:, None], n=len(residual), axis=0))


def _block_powers(signal: Real, length: int) -> Real:
    """Return the power of each block divided by the median over the blocks, (n_blocks, n_responses).

    The blocks at both ends are left out.
    """
    count = len(signal) // length
    powers = np.mean(signal[: count * length].reshape(count, length, -1) ** 2, axis=1)[ENDS : count - ENDS]
    return np.asarray(powers / np.maximum(np.median(powers, axis=0), 1e-300))


def _largest_noise_power(band: tuple[float, float], blocks: int) -> float:
    """Return the largest power of a block of noise in the band, as a multiple of the median block power."""
    shape = max((band[1] - band[0]) * BLOCK, 0.5)
    largest, median = scipy.stats.gamma.isf(RESIDUAL.burst_chance / blocks, shape), scipy.stats.gamma.ppf(0.5, shape)
    return max(float(largest / median), RESIDUAL.burst_power)


WINDOW = 32  # neighbouring lines over which a receptance is taken as constant


def unresolved_modes(hypothesis: Hypothesis, lines: list[WindowedSpectrum]) -> tuple[str, ...]:
    """Return a warning if the longest recording is too short to resolve modes in the compared band.

    A resonance whose half-power bandwidth ``2 zeta f`` is narrower than the distance ``1 / T`` of spectral lines shows
    no damping (Bendat & Piersol, Random Data, 4th ed., section 8.5).
    """
    longest = max(lines, key=lambda recording: len(recording.window) / recording.recording.rate)
    duration = len(longest.window) / longest.recording.rate
    natural, model = hypothesis.model.natural_frequencies, hypothesis.model
    width = 2 * model.damping_ratios * natural
    compared = (natural >= longest.frequencies[0]) & (natural <= longest.frequencies[-1])
    narrow = compared & (width * duration < 1)
    if not narrow.any():
        return ()
    places = ", ".join(f"{frequency:.4g}" for frequency in natural[narrow])
    return (
        f"{longest.recording.name} is too short: {duration:.3g} s are compared, whose lines are {1 / duration:.3g} Hz "
        f"apart, farther than the resonances at {places} Hz are wide. Their damping, and what depends on it, is not "
        f"determined: record {2 / width[narrow].min():.2g} s or more",
    )


def response_outside_modes(hypothesis: Hypothesis, lines: list[WindowedSpectrum]) -> tuple[str, ...]:
    """Return a warning for each side of the modes, below or above, where the model lacks measured response.

    In windows of neighbouring lines the residual is regressed on the forces. The power that the forces explain beyond
    chance is a response of the structure, which a model without modes in this range cannot predict.
    """
    model = hypothesis.model
    if model.band is not None:
        return ()
    natural, ratio = model.natural_frequencies, RESIDUAL.outside_modes
    sides = (
        (0.0, float(natural.min()) / ratio, "below the lowest mode"),
        (float(natural.max()) * ratio, np.inf, "above the highest mode"),
    )
    warnings = (_missing_response(hypothesis, lines, (low, high), place) for low, high, place in sides)
    return tuple(filter(None, warnings))


def _missing_response(
    hypothesis: Hypothesis, lines: list[WindowedSpectrum], edges: tuple[float, float], place: str
) -> str:
    """Return the warning for one side of the modes; empty unless the model lacks response in half of the recordings."""
    missing = []
    for recording in lines:
        inside = (recording.frequencies >= edges[0]) & (recording.frequencies <= edges[1])
        if inside.sum() < 2 * WINDOW:
            return ""
        residual = (recording.measured - predict_lines(hypothesis, recording).response)[inside]
        explained = _power_explained_by_forces(residual, recording.force_here[inside])
        power_inside = np.sum(np.abs(recording.measured[inside]) ** 2, axis=0)
        power = np.sum(np.abs(recording.measured) ** 2, axis=0)
        # a channel counts only if this power is not negligible compared with the channel's total power
        missing.append(float(np.max(np.where(explained > 1e-3 * power, explained / power_inside, 0.0))))
    if np.median(missing) < RESIDUAL.not_modelled:
        return ""
    low, high = max(edges[0], float(lines[0].frequencies[0])), min(edges[1], float(lines[0].frequencies[-1]))
    return (
        f"{place}, from {low:.3g} to {high:.3g} Hz, the forces explain {100 * float(np.median(missing)):.0f} % of the "
        "response's power, and the model does not. It states no band and may have been fitted to a narrower one: fit "
        "it again, or write band_hz into its file and diagnose inside that band"
    )


def _power_explained_by_forces(residual: Complex, force: Complex) -> Real:
    """Return the residual power (n_responses,) that the forces explain beyond chance."""
    total = np.zeros(residual.shape[1])
    count = force.shape[1]
    for rows in np.array_split(np.arange(len(residual)), max(1, len(residual) // WINDOW)):
        unexplained_part = residual[rows] - force[rows] @ np.linalg.lstsq(force[rows], residual[rows], rcond=1e-6)[0]
        power, unexplained = (np.sum(np.abs(values) ** 2, axis=0) for values in (residual[rows], unexplained_part))
        total += np.maximum(power - unexplained * len(rows) / max(len(rows) - count, 1), 0.0)
    return total
