"""The spindle's angle during a recording, found from the recording itself."""

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Real

LARGEST_ERROR = 0.012
"""Relative error of the stated speed up to which the true one is looked for."""
LARGEST_DRIFT = 0.01
"""Relative change of speed from begin to end up to which it is followed."""
_ORDERS = 32  # highest spindle order that is compared
_BLOCK = 24  # revolutions a block, at least
_BLOCKS = (1, 4, 10)  # blocks a recording, at most; the best of all is taken
_STARTS = 3  # trials of each number of blocks
_SETTLED = 2  # of these that are refined
_REFINED = 10  # orders that refine the angle
_SINGLE = 1e-3  # power beside an order's line that counts as floor, as share of the strongest line


@dataclass(frozen=True)
class SpindleTrack:
    """Angle of the spindle over time, a cubic polynomial.

    Parameters
    ----------
    coefficients : (4,)
        Revolutions at the time t (s): ``c0 t + c1 t^2 + c2 t^3 + c3 t^4``, c0 in Hz.
    duration : s
        Time that the track covers.
    """

    coefficients: Real
    duration: float

    def revolutions(self, times: Real) -> Real:
        """Angle at ``times`` (s), in revolutions."""
        powers = np.arange(1, len(self.coefficients) + 1)
        return np.asarray(sum(c * times**p for c, p in zip(self.coefficients, powers, strict=True)))

    @property
    def mean_frequency(self) -> float:
        """Revolutions a second over the whole recording, Hz."""
        return float(self.revolutions(np.array([self.duration]))[0] / self.duration)

    @property
    def drift(self) -> float:
        """Change of speed from begin to end over the mean."""
        powers = np.arange(1, len(self.coefficients) + 1)
        first = self.coefficients[0]
        last = float(np.sum(self.coefficients * powers * self.duration ** (powers - 1)))
        return float((last - first) / self.mean_frequency)


def track_spindle(data: Real, sample_rate: float, stated: float) -> SpindleTrack:
    """Find the spindle's angle near a stated frequency (Hz) from the comb of its orders.

    In blocks, the logarithms of the spectrum at all orders of a trial frequency are added; the line over time with the
    largest sum is taken. The logarithm keeps one strong line of chatter from passing for an order. The phases of the
    strongest orders then refine the angle (Fyfe & Munck, Mech. Syst. Signal Process. 11, 1997, for order tracking).

    Parameters
    ----------
    data : (n_samples, n_channels)
        Samples without mean, channels scaled to like size.
    sample_rate : Hz
        Samples a second.
    stated : Hz
        Stated frequency of the spindle, right within 1 %.
    """
    data, sample_rate = _thinned(data, sample_rate, stated)
    floors = _floors(data, sample_rate, stated)
    starts = _starts(data, sample_rate, stated)
    starts.sort(key=lambda track: -_comb(data, sample_rate, track, floors))
    settled = [_settled(data, sample_rate, track, floors) for track in starts[:_SETTLED]]
    return max(settled, key=lambda track: _comb(data, sample_rate, track, floors))


def _thinned(data: Real, sample_rate: float, stated: float) -> tuple[Real, float]:
    """The samples at as low a rate as the compared orders need."""
    factor = int(sample_rate / (2.5 * _ORDERS * stated * (1 + LARGEST_ERROR)))
    if factor < 2:
        return data, sample_rate
    return np.asarray(scipy.signal.decimate(data, factor, ftype="fir", axis=0)), sample_rate / factor


def _floors(data: Real, sample_rate: float, stated: float) -> Real:
    """Median power of the windowed recording about each order, (n_orders,)."""
    window = np.hanning(len(data) + 2)[1:-1]
    power = _power(data, window, len(data))
    bins = len(data) / sample_rate * stated
    orders = range(1, highest_order(sample_rate, stated) + 1)
    medians = [np.median(power[int((k - 0.5) * bins) : int((k + 0.5) * bins)]) for k in orders]
    return np.asarray(np.array(medians) + _SINGLE**2 * power.max() + 1e-300)


def _power(data: Real, window: Real, length: int) -> Real:
    """Power of all channels together, (n_lines,); one channel after the other, as long cuts fill the memory."""
    power = np.zeros(length // 2 + 1)
    for column in data.T:
        power += np.abs(np.fft.rfft(column * window, length)) ** 2
    return power


def _starts(data: Real, sample_rate: float, stated: float) -> list[SpindleTrack]:
    """Tracks to begin with: the best of a few numbers of blocks."""
    duration = len(data) / sample_rate
    counts = {int(np.clip(duration * stated // _BLOCK, 1, most)) for most in _BLOCKS}
    pairs = [pair for count in sorted(counts) for pair in _coarse(data, sample_rate, stated, count)]
    return [
        SpindleTrack(np.array([mean - slope / 2, slope / (2 * duration), 0.0, 0.0]), duration) for mean, slope in pairs
    ]


def _settled(data: Real, sample_rate: float, track: SpindleTrack, floors: Real) -> SpindleTrack:
    """The track with its angle refined as long as that strengthens the orders."""
    for n_powers in (2, 2, 4):
        refined = _refined(data, sample_rate, track, n_powers)
        if _comb(data, sample_rate, refined, floors) <= _comb(data, sample_rate, track, floors):
            continue
        track = refined
    return track


def highest_order(sample_rate: float, frequency: float) -> int:
    """Highest spindle order that is compared."""
    return max(1, min(_ORDERS, int(0.4 * sample_rate / frequency)))


def _coarse(data: Real, sample_rate: float, stated: float, n_blocks: int) -> list[tuple[float, float]]:
    """Mean frequency and its change from begin to end (Hz), the best few."""
    length = len(data) // n_blocks
    orders = np.arange(1, highest_order(sample_rate, stated * (1 + LARGEST_ERROR)) + 1)
    fineness = sample_rate / length / (4 * orders[-1])
    trials = np.arange(
        stated * (1 - LARGEST_ERROR - LARGEST_DRIFT / 2), stated * (1 + LARGEST_ERROR + LARGEST_DRIFT / 2), fineness
    )
    scores = np.array(
        [_score(data[k * length : (k + 1) * length], sample_rate, trials, orders, stated) for k in range(n_blocks)]
    )
    means = trials[np.abs(trials / stated - 1) <= LARGEST_ERROR]
    slopes = np.array([0.0])
    if n_blocks > 1:
        half = math.ceil(LARGEST_DRIFT * stated / (2 * fineness))
        slopes = 2 * fineness * np.arange(-half, half + 1)
    places = (np.arange(n_blocks) + 0.5) / n_blocks - 0.5
    totals = np.zeros((len(slopes), len(means)))
    for number, slope in enumerate(slopes):
        for score, place in zip(scores, places, strict=True):
            totals[number] += np.interp(means + slope * place, trials, score)
    found = []
    for _ in range(_STARTS):
        row, column = np.unravel_index(int(np.argmax(totals)), totals.shape)
        found.append((float(means[column]), float(slopes[row])))
        totals[max(row - 3, 0) : row + 4, max(column - 8, 0) : column + 9] = -np.inf
    return found


def _score(block: Real, sample_rate: float, trials: Real, orders: NDArray[np.int64], stated: float) -> Real:
    """Sum over orders of the logarithm of power over floor at each trial frequency."""
    window = np.hanning(len(block) + 2)[1:-1]
    room = 4 * 2 ** math.ceil(math.log2(len(block)))
    power = _power(block, window, room)
    bins = room / sample_rate
    least = _SINGLE**2 * power.max() + 1e-300
    total = np.zeros(len(trials))
    for order in orders:
        low, high = int((order - 0.5) * stated * bins), int((order + 0.5) * stated * bins)
        floor = float(np.median(power[low:high])) + least
        total += np.log1p(np.interp(order * trials * bins, np.arange(len(power)), power) / floor)
    return total


def _strongest_orders(data: Real, sample_rate: float, track: SpindleTrack) -> tuple[NDArray[np.int64], Real]:
    """Orders and complex amplitudes over time in blocks (n_blocks, n_orders, n_channels), the strongest orders."""
    turns = track.revolutions(np.arange(len(data)) / sample_rate)
    n_blocks = int(np.clip(turns[-1] // 12, 4, 32))
    length = len(data) // n_blocks
    window = np.hanning(length + 2)[1:-1]
    orders = np.arange(1, highest_order(sample_rate, track.mean_frequency) + 1)
    amplitudes = np.empty((n_blocks, len(orders), data.shape[1]), dtype=complex)
    first = np.exp(-2j * np.pi * turns)
    wave = np.ones_like(first)
    for number in range(len(orders)):
        wave = wave * first
        turned = (data * wave[:, None])[: n_blocks * length].reshape(n_blocks, length, -1)
        amplitudes[:, number] = np.einsum("btc,t->bc", turned, window) / window.sum()
    steady = np.linalg.norm(amplitudes.mean(axis=0), axis=1) / np.maximum(
        np.sqrt(np.mean(np.sum(np.abs(amplitudes) ** 2, axis=2), axis=0)), 1e-300
    )
    size = np.sqrt(np.mean(np.sum(np.abs(amplitudes) ** 2, axis=2), axis=0))
    chosen = np.argsort(-size * steady**2)[:_REFINED]
    return orders[chosen], amplitudes[:, chosen]


def _refined(data: Real, sample_rate: float, track: SpindleTrack, n_powers: int) -> SpindleTrack:
    """The track whose orders keep their phases: weighted least squares on the phases of the strongest orders."""
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
        basis[:, n_powers + number] = 1.0
        rows.append(basis * w[:, None])
        right.append(angles[:, number] * w)
    solution = np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=None)[0][:n_powers]
    coefficients = track.coefficients.copy()
    coefficients[:n_powers] += solution / track.duration ** np.arange(1, n_powers + 1)
    return SpindleTrack(coefficients, track.duration)


def _comb(data: Real, sample_rate: float, track: SpindleTrack, floors: Real) -> float:
    """Sum of the logarithms of power over floor at all orders of the whole recording."""
    turns = track.revolutions(np.arange(len(data)) / sample_rate)
    window = np.hanning(len(data) + 2)[1:-1]
    first = np.exp(-2j * np.pi * turns)
    wave = window.astype(complex)
    total = 0.0
    for floor in floors:
        wave = wave * first
        total += math.log1p(float(np.sum(np.abs(wave @ data) ** 2)) / float(floor))
    return total
