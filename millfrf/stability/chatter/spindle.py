"""The spindle's angle during a recording, samples at equal angles, and the size of a line over the recording."""

import math
from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import Complex, Index, Real

from ..settings import THRESHOLDS

_ORDERS = 32  # highest spindle order that is compared
_SINGLE = 1e-3  # power next to an order's line that counts as floor, as share of the strongest line


@dataclass(frozen=True)
class SpindleTrack:
    """Angle of the spindle over time, a polynomial of fourth degree."""

    coefficients: Real  # (4,): revolutions at the time t (s): ``c0 t + c1 t^2 + c2 t^3 + c3 t^4``, c0 in Hz
    duration: float  # s

    def revolutions(self, times: Real) -> Real:
        """Compute the spindle's angle at ``times`` (s), in revolutions."""
        powers = np.arange(1, len(self.coefficients) + 1)
        return np.asarray(sum(c * times**p for c, p in zip(self.coefficients, powers, strict=True)))

    @property
    def mean_frequency(self) -> float:
        """Return the mean spindle frequency over the whole recording, Hz."""
        return float(self.revolutions(np.array([self.duration]))[0] / self.duration)

    @property
    def drift(self) -> float:
        """Return the change of speed from beginning to end of the recording, over the mean speed."""
        powers = np.arange(1, len(self.coefficients) + 1)
        first = self.coefficients[0]
        last = float(np.sum(self.coefficients * powers * self.duration ** (powers - 1)))
        return float((last - first) / self.mean_frequency)


def track_spindle(data: Real, sample_rate: float, stated: float) -> SpindleTrack:
    """Find the spindle's angle near a stated frequency from its orders.

    In blocks of the recording, the logarithms of the spectrum at all orders of a trial frequency are added. The
    frequency that changes linearly over time and has the largest sum is chosen. The logarithm prevents that a single
    strong line of chatter is taken for an order. The phases of the strongest orders then refine the angle (Fyfe &
    Munck, Mech. Syst. Signal Process. 11, 1997, for order tracking).

    Parameters
    ----------
    data : (n_samples, n_channels)
        Samples without mean, channels scaled to similar size.
    sample_rate : Hz
        Samples per second.
    stated : Hz
        Stated frequency of the spindle, right within 1 %.
    """
    data, sample_rate = _for_orders(data, sample_rate, stated)
    floors = _floors(data, sample_rate, stated)
    tracks = _first_tracks(data, sample_rate, stated)
    tracks.sort(key=lambda track: -_order_score(data, sample_rate, track, floors))
    refined = [_refined(data, sample_rate, track, floors) for track in tracks[:2]]
    return max(refined, key=lambda track: _order_score(data, sample_rate, track, floors))


def _for_orders(data: Real, sample_rate: float, stated: float) -> tuple[Real, float]:
    """Decimate samples as far as the compared orders allow."""
    factor = int(sample_rate / (2.5 * _ORDERS * stated * (1 + THRESHOLDS.speed_error)))
    if factor < 2:
        return data, sample_rate
    return np.asarray(scipy.signal.decimate(data, factor, ftype="fir", axis=0)), sample_rate / factor


def follow_spindle(data: Real, sample_rate: float, stated: float) -> SpindleTrack:
    """Find the spindle's angle from its frequency (Hz) shortly before, by the phases of the strongest orders.

    The parameters are those of :func:`track_spindle`. The frequency must be right within a fifth of a revolution over
    the recording at the highest order that is strong.
    """
    duration = len(data) / sample_rate
    start = SpindleTrack(np.array([stated, 0.0, 0.0, 0.0]), duration)
    data, sample_rate = _for_orders(data, sample_rate, stated)
    track = _phase_fit(data, sample_rate, start, 2)
    is_near = abs(track.mean_frequency / stated - 1) < THRESHOLDS.speed_error / 4
    return track if is_near else start


def _floors(data: Real, sample_rate: float, stated: float) -> Real:
    """Compute the median power of the windowed recording around each order, (n_orders,)."""
    power = _power(data, np.hanning(len(data) + 2)[1:-1], len(data))
    bins = len(data) / sample_rate * stated
    orders = range(1, _highest_order(sample_rate, stated) + 1)
    medians = [np.median(power[int((k - 0.5) * bins) : int((k + 0.5) * bins)]) for k in orders]
    return np.asarray(np.array(medians) + _SINGLE**2 * power.max() + 1e-300)


def _power(data: Real, window: Real, length: int) -> Real:
    """Add the power spectra of all channels, (n_lines,), one channel at a time to save memory."""
    power = np.zeros(length // 2 + 1)
    for column in data.T:
        power += np.abs(np.fft.rfft(column * window, length)) ** 2
    return power


def _first_tracks(data: Real, sample_rate: float, stated: float) -> list[SpindleTrack]:
    """Find the best tracks with linear speed, for one, up to four and up to ten blocks of 24 or more revolutions."""
    duration = len(data) / sample_rate
    counts = {int(np.clip(duration * stated // 24, 1, largest)) for largest in (1, 4, 10)}
    pairs = [pair for count in sorted(counts) for pair in _coarse(data, sample_rate, stated, count)]
    return [
        SpindleTrack(np.array([mean - slope / 2, slope / (2 * duration), 0.0, 0.0]), duration) for mean, slope in pairs
    ]


def _refined(data: Real, sample_rate: float, track: SpindleTrack, floors: Real) -> SpindleTrack:
    """Refine the angle of a track; keep a refinement only if it strengthens the orders."""
    for n_powers in (2, 2, 4):
        refined = _phase_fit(data, sample_rate, track, n_powers)
        if _order_score(data, sample_rate, refined, floors) > _order_score(data, sample_rate, track, floors):
            track = refined
    return track


def _highest_order(sample_rate: float, frequency: float) -> int:
    return max(1, min(_ORDERS, int(0.4 * sample_rate / frequency)))


def _coarse(data: Real, sample_rate: float, stated: float, n_blocks: int) -> list[tuple[float, float]]:
    """Find the three best pairs of mean frequency and change of frequency from beginning to end, Hz."""
    length = len(data) // n_blocks
    error, drift = THRESHOLDS.speed_error, THRESHOLDS.speed_drift
    orders = np.arange(1, _highest_order(sample_rate, stated * (1 + error)) + 1)
    step = sample_rate / length / (4 * orders[-1])
    trials = np.arange(stated * (1 - error - drift / 2), stated * (1 + error + drift / 2), step)
    scores = np.array(
        [_score(data[k * length : (k + 1) * length], sample_rate, trials, orders, stated) for k in range(n_blocks)]
    )
    means = trials[np.abs(trials / stated - 1) <= error]
    slopes = np.array([0.0])
    if n_blocks > 1:
        half = math.ceil(drift * stated / (2 * step))
        slopes = 2 * step * np.arange(-half, half + 1)
    places = (np.arange(n_blocks) + 0.5) / n_blocks - 0.5
    totals = np.zeros((len(slopes), len(means)))
    for number, slope in enumerate(slopes):
        for score, place in zip(scores, places, strict=True):
            totals[number] += np.interp(means + slope * place, trials, score)
    pairs = []
    for _ in range(3):
        row, column = np.unravel_index(int(np.argmax(totals)), totals.shape)
        pairs.append((float(means[column]), float(slopes[row])))
        # the next maximum is sought outside this peak
        totals[max(row - 3, 0) : row + 4, max(column - 8, 0) : column + 9] = -np.inf
    return pairs


def _score(block: Real, sample_rate: float, trials: Real, orders: Index, stated: float) -> Real:
    """Sum the logarithm of power over floor over all orders, at each trial frequency."""
    length = 4 * 2 ** math.ceil(math.log2(len(block)))
    power = _power(block, np.hanning(len(block) + 2)[1:-1], length)
    bins = length / sample_rate
    least = _SINGLE**2 * power.max() + 1e-300
    total = np.zeros(len(trials))
    for order in orders:
        low, high = int((order - 0.5) * stated * bins), int((order + 0.5) * stated * bins)
        floor = float(np.median(power[low:high])) + least
        total += np.log1p(np.interp(order * trials * bins, np.arange(len(power)), power) / floor)
    return total


def _strongest_orders(data: Real, sample_rate: float, track: SpindleTrack) -> tuple[Index, Complex]:
    """Find the ten strongest orders and their amplitudes in blocks over time, (n_blocks, n_orders, n_channels)."""
    turns = track.revolutions(np.arange(len(data)) / sample_rate)
    n_blocks = int(np.clip(turns[-1] // 12, 4, 32))
    length = len(data) // n_blocks
    window = np.hanning(length + 2)[1:-1]
    orders = np.arange(1, _highest_order(sample_rate, track.mean_frequency) + 1)
    amplitudes = np.empty((n_blocks, len(orders), data.shape[1]), dtype=complex)
    first = np.exp(-2j * np.pi * turns)
    wave = np.ones_like(first)
    blocks = data[: n_blocks * length].reshape(n_blocks, length, -1)
    for number in range(len(orders)):
        wave *= first
        weighted = wave[: n_blocks * length].reshape(n_blocks, length) * window
        amplitudes[:, number] = _inner(weighted, blocks) / window.sum()
    size = np.sqrt(np.mean(np.sum(np.abs(amplitudes) ** 2, axis=2), axis=0))
    steady = np.linalg.norm(amplitudes.mean(axis=0), axis=1) / np.maximum(size, 1e-300)
    chosen = np.argsort(-size * steady**2)[:10]
    return orders[chosen], amplitudes[:, chosen]


def _phase_fit(data: Real, sample_rate: float, track: SpindleTrack, n_powers: int) -> SpindleTrack:
    """Correct the track so that the strongest orders keep their phases, by weighted least squares on the phases."""
    orders, amplitudes = _strongest_orders(data, sample_rate, track)
    n_blocks = len(amplitudes)
    places = (np.arange(n_blocks) + 0.5) / n_blocks
    mean = amplitudes.mean(axis=0)
    products = np.sum(amplitudes * mean.conj(), axis=2)
    angles = np.unwrap(np.angle(products), axis=0) / (2 * np.pi)
    weights = np.abs(products) / np.maximum(np.abs(products).max(axis=0), 1e-300)
    size = np.linalg.norm(mean, axis=1)
    rows, right = [], []
    for number, order in enumerate(orders):
        w = (size[number] / size.max()) ** 0.5 * weights[:, number]
        basis = np.zeros((n_blocks, n_powers + len(orders)))
        basis[:, :n_powers] = order * places[:, None] ** np.arange(1, n_powers + 1)
        basis[:, n_powers + number] = 1.0  # unknown phase of the order
        rows.append(basis * w[:, None])
        right.append(angles[:, number] * w)
    solution = np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=None)[0][:n_powers]
    coefficients = track.coefficients.copy()
    coefficients[:n_powers] += solution / track.duration ** np.arange(1, n_powers + 1)
    return SpindleTrack(coefficients, track.duration)


def _order_score(data: Real, sample_rate: float, track: SpindleTrack, floors: Real) -> float:
    """Sum the logarithms of power over floor at all orders of the whole recording."""
    turns = track.revolutions(np.arange(len(data)) / sample_rate)
    window = np.hanning(len(data) + 2)[1:-1]
    first = np.exp(-2j * np.pi * turns)
    wave = window.astype(complex)
    total = 0.0
    for floor in floors:
        wave *= first
        total += math.log1p(float(np.sum(np.abs(_inner(wave, data)) ** 2)) / float(floor))
    return total


def _inner(waves: Complex, data: Real) -> Complex:
    """Multiply waves (..., n_samples) with real samples (..., n_samples, n_channels) without a complex copy of them."""
    parts = np.ascontiguousarray(waves).view(float).reshape(*waves.shape, 2)
    real, imaginary = np.moveaxis(np.swapaxes(parts, -1, -2) @ data, -2, 0)
    return np.asarray(real + 1j * imaginary)


PARTS = 8  # equal parts of a recording in which the size of a line is measured


@dataclass(frozen=True)
class Revolutions:
    """A recording cut into revolutions of the spindle."""

    samples: Real  # (n_revolutions, n_places, n_channels), at equal angles; n_places is a multiple of the teeth
    teeth: int
    highest_order: float  # orders above it are attenuated by the resampling, or above half the sample rate
    steady: int = 0  # number of revolutions over which the orders change at most linearly; 0: all

    def part(self, first: int, last: int) -> "Revolutions":
        """Return the revolutions from ``first`` to before ``last``."""
        steady = min(self.steady, last - first)
        return Revolutions(self.samples[first:last], self.teeth, self.highest_order, steady)

    @property
    def count(self) -> int:
        """Number of revolutions."""
        return len(self.samples)

    @property
    def size(self) -> Real:
        """Standard deviation of each channel, (n_channels,)."""
        return np.asarray(self.samples.reshape(-1, self.samples.shape[2]).std(axis=0))

    @property
    def mean_turn(self) -> Real:
        """Return the mean revolution minus its mean over the angle: all spindle orders, (n_places, n_channels)."""
        turn = self.samples.mean(axis=0)
        return np.asarray(turn - turn.mean(axis=0))

    @property
    def residual(self) -> Real:
        """Samples without the orders of the spindle, (n_revolutions * n_places, n_channels).

        At each angle a straight line over the revolutions is subtracted in each steady part, so that orders may grow or
        fall slowly.
        """
        parts = np.array_split(self.samples, max(1, round(self.count / (self.steady or self.count))))
        residual = np.concatenate([_without_line(part) for part in parts])
        return residual.reshape(self.count * self.samples.shape[1], -1)


def _without_line(samples: Real) -> Real:
    """Subtract the mean and a straight line over the revolutions at each angle."""
    line = np.linspace(-1.0, 1.0, len(samples))
    slope = np.tensordot(line, samples, axes=1) / np.sum(line**2)
    return np.asarray(samples - samples.mean(axis=0) - line[:, None, None] * slope)


def to_revolutions(data: Real, sample_rate: float, track: SpindleTrack, teeth: int) -> Revolutions:
    """Resample a recording (n_samples, n_channels) at equal angles of the spindle."""
    # a band-limited filter doubles the samples: cubic splines are accurate only well below the Nyquist frequency
    times = np.arange(2 * len(data)) / (2 * sample_rate)
    turns = track.revolutions(times)
    count = int(turns[len(data) * 2 - 2])
    places = max(32, int(np.ceil(sample_rate / track.mean_frequency)))
    places = -(-places // (2 * teeth)) * 2 * teeth
    angles = np.arange(count * places) / places
    instants = np.interp(angles, turns, times)
    for _ in range(2):  # Newton's steps invert the angle over time
        speed = np.gradient(turns, times, edge_order=2)
        instants = instants - (track.revolutions(instants) - angles) / np.interp(instants, times, speed)
    samples = np.empty((len(instants), data.shape[1]))
    for number, column in enumerate(data.T):  # a spline takes many times the memory of its samples
        samples[:, number] = scipy.interpolate.CubicSpline(times, scipy.signal.resample_poly(column, 2, 1))(instants)
    return Revolutions(
        samples.reshape(count, places, -1), teeth, THRESHOLDS.highest_line * sample_rate / track.mean_frequency
    )


@dataclass(frozen=True)
class Course:
    """Size of a line in eight equal parts of a recording."""

    sizes: Real  # (8,): root mean square, all channels together

    @property
    def growth(self) -> float:
        """Return the size in the last eighth of the recording over the size in the first eighth."""
        return float(self.sizes[-1] / max(self.sizes[0], 1e-300))

    @property
    def dies_out(self) -> bool:
        """Check whether the size falls by 30 % or more in the first half of the recording, and again in the second."""
        first, middle, last = self.sizes[0], self.sizes[3:5].mean(), self.sizes[-1]
        return bool(middle < 0.7 * first and last < 0.7 * middle)

    @property
    def grows(self) -> bool:
        """Check whether the size rises threefold or more, nearly exponentially."""
        logarithm = np.log(np.maximum(self.sizes, 1e-300))
        if logarithm.std() < 1e-9:
            return False
        along = np.arange(PARTS)
        rise = float(np.polyfit(along, logarithm, 1)[0]) * (PARTS - 1)
        # eight sizes of noise correlate by more than 0.97 with time once in 30000 recordings
        return bool(rise > np.log(3.0) and np.corrcoef(along, logarithm)[0, 1] > 0.97)

    @property
    def steadiness(self) -> float:
        """Return the standard deviation of the power over its mean, after the first quarter of the recording.

        It is 1 for noise and 0 for a limit cycle.
        """
        power = self.sizes[PARTS // 4 :] ** 2
        return float(power.std() / max(power.mean(), 1e-300))


def course_of(revolutions: Revolutions, order: float) -> Course:
    """Compute the size of the line at an order in eight equal parts of the recording."""
    residual = revolutions.residual.reshape(revolutions.samples.shape)
    length = revolutions.count // PARTS
    return Course(np.array([size_of_line(residual[k * length : (k + 1) * length], order) for k in range(PARTS)]))


def size_of_line(samples: Real, order: float) -> float:
    """Return the size of a line in revolutions (n_revolutions, n_places, n_channels), all channels together."""
    flat = samples.reshape(-1, samples.shape[2])
    window = np.hanning(len(flat) + 2)[1:-1]
    turns = np.arange(len(flat)) / samples.shape[1]
    # one and a half lines of resolution on either side count too, as the frequency of chatter may wander
    shifts = np.arange(-1.5, 1.5 + 0.25, 0.5) / len(samples)
    waves = np.exp(-2j * np.pi * np.outer(order + shifts, turns)) * window
    return float(np.sqrt(np.sum(np.abs(waves @ flat) ** 2)) / window.sum())
