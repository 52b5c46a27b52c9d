"""Evidence in the recording of a cut: variation of lines in time, irregular motion, differences between teeth."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from millfrf.core import Complex, Index, Real

from ..settings import THRESHOLDS
from .cutting_span import span_in_cut, unrepeated_elsewhere
from .lines import Family, Line, Spectrum, families_of, lines_of, skirt_power, spectrum_of, steady_length
from .noise import motion_of, noise_of, wide_floor
from .spindle import PARTS, Course, Revolutions, SpindleTrack, size_of_line, to_revolutions, track_spindle

Tracking = Callable[[Real, float, float], SpindleTrack]
"""Of samples (n_samples, n_channels), sample rate (Hz) and frequency of the spindle (Hz), the spindle's angle."""


@dataclass(frozen=True)
class Evidence:
    """Spindle, spectrum and lines of a recording."""

    track: SpindleTrack
    revolutions: Revolutions  # the part in the cut, each channel divided by its scale
    late: Revolutions  # second half of the recording, on which the verdict is based
    idle: Revolutions | None  # the longest part out of the cut; None where there is none
    spectrum: Spectrum  # of the motion in the second half that does not repeat with the revolution
    families: tuple[Family, ...]  # significant lines, grouped by the tooth passing, strongest first
    order_p_value: float  # probability that noise alone resembles orders of the spindle as much as the recording
    sample_rate: float  # Hz
    judged: slice  # samples of the recording on which the verdict is based
    elsewhere: slice | None  # samples of another part that cuts and does not repeat; None where there is none
    scales: Real  # (n_channels,): standard deviation of the samples of each channel
    weights: Real  # (n_quantities, n_channels), see :func:`share_of`; the noise is no motion
    noise: Real  # (n_channels,): mean square of the noise, see :func:`noise_of`

    @property
    def shows_orders(self) -> bool:
        """Check whether the orders of the spindle are above the noise."""
        return self.order_p_value <= THRESHOLDS.order_p_value

    @property
    def alternation_p_value(self) -> float:
        """Return the p-value of the orders at odd multiples of half the tooth passing (even number of teeth)."""
        teeth = self.late.teeth
        return _order_p_value(self.late, self.spectrum, teeth // 2, teeth)

    def absent_when_idle(self, line: Line) -> bool:
        """Check whether a line is far smaller out of the cut than in it; unknown counts as no."""
        if self.idle is None:
            return False
        size = float(np.linalg.norm(line.amplitude))
        return size_of_line(self.idle.samples, line.order) < THRESHOLDS.absent * size

    @property
    def deviation(self) -> float:
        """Return the size of what does not repeat over the size of everything, in the best quantity; noise included."""
        size = self.late.size**2
        chosen = self.weights > 0
        return float(np.sqrt(np.min((chosen @ self.late.residual.var(axis=0)) / (chosen @ size))))

    @property
    def irregular(self) -> float:
        """Return the size of irregular motion over the size of all motion, in the best quantity.

        It is what does not repeat, without noise, and without what lies symmetrically next to the orders: forced
        vibration that varies.
        """
        forced = skirt_power(self.spectrum.power, self.late, self.spectrum.per_order)
        power = self.late.residual.var(axis=0) - self.noise - forced
        return float(np.sqrt(np.min(self.weights @ np.maximum(power, 0.0))))

    @property
    def least_share(self) -> float:
        """Return the share of the motion above which a line is significant even where the noise floor is highest."""
        floor = np.where(self.spectrum.searched[:, None], self.spectrum.floor, 0.0)
        needed = self.spectrum.significant(THRESHOLDS.line_p_value)
        return float(np.min(np.sqrt(needed * floor.max(axis=0) / motion_of(self.late, self.noise))))


def gather_evidence(
    samples: Real,
    sample_rate: float,
    spindle_speed: float,
    teeth: int,
    quantities: Sequence[str] = (),
    tracking: Tracking = track_spindle,
) -> Evidence:
    """Track the spindle, subtract its orders, and find the remaining lines.

    Parameters
    ----------
    samples : (n_samples, n_channels)
        Samples of the recording, without channels that hold no motion.
    sample_rate : Hz
        Samples per second.
    spindle_speed : rad/s
        Stated spindle speed, right within 1 %.
    teeth
        Number of teeth.
    quantities : (n_channels,)
        Measured quantity of each channel; empty: all channels measure the same.
    tracking
        How the spindle's angle is found: near a stated frequency, or near that of shortly before.
    """
    data = samples - samples.mean(axis=0)
    scales = np.maximum(data.std(axis=0), 1e-300)
    data = data / scales
    track = tracking(data, sample_rate, spindle_speed / (2 * math.pi))
    revolutions = to_revolutions(data, sample_rate, track, teeth)
    of_cut = _Signal(track, sample_rate, scales, tuple(quantities or ("",) * data.shape[1]))
    span = span_in_cut(revolutions)
    if teeth == 1 and span == (0, revolutions.count):
        # an edge that never leaves the cut, as in turning, causes no orders: there the size of all motion shows the cut
        span = span_in_cut(revolutions, of_orders=False)
    return _evidence_of(revolutions, of_cut, *span)


@dataclass(frozen=True)
class _Signal:
    """What belongs to a recording besides its revolutions."""

    track: SpindleTrack
    sample_rate: float  # Hz
    scales: Real  # (n_channels,): standard deviation of the samples of each channel
    quantities: tuple[str, ...]


def _evidence_of(whole: Revolutions, of_cut: _Signal, first: int, last: int) -> Evidence:
    """Gather the evidence in the part of a recording between two revolutions."""
    track, sample_rate, scales = of_cut.track, of_cut.sample_rate, of_cut.scales
    idle = max(whole.part(0, first), whole.part(last, whole.count), key=lambda part: part.count)
    other = unrepeated_elsewhere(whole, first, last)
    elsewhere = None if other is None else _samples_of(track, *other, sample_rate)
    revolutions = whole.part(first, last)
    # the second half alone is judged, as the entry into the cut dies out in the first
    late = revolutions.part(revolutions.count // 2, revolutions.count)
    length = steady_length(late)
    revolutions, late = replace(revolutions, steady=length), replace(late, steady=length)
    spectrum = spectrum_of(late)
    lines = lines_of(spectrum, track.mean_frequency)
    noise = noise_of(spectrum)
    weights = _weights(of_cut.quantities, scales * np.sqrt(motion_of(late, noise))) * scales**2
    return Evidence(
        track,
        revolutions,
        late,
        idle if idle.count >= THRESHOLDS.shortest_segment else None,
        spectrum,
        families_of(lines, revolutions.teeth, spectrum.resolution, weights),
        _order_p_value(late, spectrum),
        sample_rate,
        _samples_of(track, (first + last) // 2, last, sample_rate),
        elsewhere,
        scales,
        weights,
        noise,
    )


def _samples_of(track: SpindleTrack, first: int, last: int, sample_rate: float) -> slice:
    """Return the samples between two revolutions."""
    times = np.arange(int(track.duration * sample_rate) + 1) / sample_rate
    begin, end = np.searchsorted(track.revolutions(times), (first, last))
    return slice(int(begin), int(end))


def _weights(quantities: Sequence[str], sizes: Real) -> Real:
    """Return one row per quantity: 1 over the power of its channels; 0 for channels of other quantities."""
    names = np.array(quantities)
    chosen = names == np.unique(names)[:, None]
    return np.asarray(chosen / np.maximum(chosen @ sizes**2, 1e-300)[:, None])


def _order_p_value(late: Revolutions, spectrum: Spectrum, first: int = 1, step: int = 1) -> float:
    """Compute the family-wise p-value of the strongest order among ``first, first + step, ...`` against its floor."""
    amplitudes = np.fft.rfft(late.mean_turn, axis=0) / late.mean_turn.shape[0]
    orders = np.arange(first, int(spectrum.orders[spectrum.searched][-1]) + 1, step)
    power = 2 * np.abs(amplitudes[orders]) ** 2
    ratio = float((power / floor_of_mean_turn(late, spectrum, orders)).max())
    # Bonferroni's correction counts about 100 frequencies that were tried for the spindle
    return min(1.0, float(power.size * 100 * math.exp(-min(ratio, 700.0))))


def floor_of_mean_turn(late: Revolutions, spectrum: Spectrum, orders: Index) -> Real:
    """Return the mean square that noise causes at orders of the mean revolution, (n_orders, n_channels)."""
    return np.asarray(spectrum.floor[orders * spectrum.per_order] * spectrum.per_order / late.count)


@dataclass(frozen=True)
class Envelope:
    """Size and phase over time of lines that belong together.

    ``fluctuation`` is the standard deviation of the power over its mean: 1 for noise through a mode, whose envelope is
    normally distributed, and small for a limit cycle. ``coherence``, 0 to 1, is between the strongest line and all
    further lines together: side lines that the teeth cause vary with the strongest line, lines of noise do not.
    """

    fluctuation: float
    coherence: float


def envelope_of(revolutions: Revolutions, family: Family, spectrum: Spectrum) -> Envelope:
    """Demodulate a family of two or more lines, each channel over its noise floor, and extract their common motion.

    A motion ``a(t) exp(i w t)`` that the teeth modulate has lines at ``+-w + k w_tooth``, all with the same a(t), or
    with the conjugate of a(t) for mirrored lines. The first singular vector of all lines and channels is the estimate
    of a(t) with the best ratio of signal to noise (Golub & Van Loan, Matrix Computations, section 2.4).
    """
    teeth = revolutions.teeth
    power = np.array([float((line.amplitude**2).sum()) for line in family.lines])
    places = np.array([abs(_signed(line.order, teeth)) for line in family.lines])
    place = float(np.average(places, weights=power))
    residual = revolutions.residual
    columns = [_demodulated(residual, revolutions, line, place, spectrum) for line in family.lines]
    columns = [column[len(column) // 8 :] for column in columns]  # the entry may still die out in the first eighth
    strongest, others = _common(columns[0]), _common(np.concatenate(columns[1:], axis=1))
    size = np.abs(_common(np.concatenate(columns, axis=1))) ** 2
    coherence = abs(np.vdot(strongest, others)) ** 2 / max(
        float(np.sum(np.abs(strongest) ** 2) * np.sum(np.abs(others) ** 2)), 1e-300
    )
    return Envelope(float(size.std() / max(size.mean(), 1e-300)), float(coherence))


def _signed(order: float, teeth: int) -> float:
    """Compute the signed distance (orders) from the nearest multiple of the number of teeth."""
    return (order + teeth / 2) % teeth - teeth / 2


def _demodulated(residual: Real, revolutions: Revolutions, line: Line, place: float, spectrum: Spectrum) -> Complex:
    """Compute the amplitude of a line over time, (n_values, n_channels), relative to the noise at its frequency.

    The amplitude of a mirrored line is conjugated.
    """
    teeth, n_places = revolutions.teeth, revolutions.samples.shape[1]
    distance = _signed(line.order, teeth)
    sign = 1.0 if distance >= 0 else -1.0
    order = round((line.order - distance) / teeth) * teeth + sign * place
    length = 8 * n_places // teeth  # each value is a mean over eight tooth periods
    count = len(residual) // length
    wave = np.exp(-2j * np.pi * order * np.arange(count * length) / n_places)
    window = np.hanning(length + 2)[1:-1]
    segments = (residual[: count * length] * wave[:, None]).reshape(count, length, -1)
    values = np.einsum("ktc,t->kc", segments, window) / window.sum()
    floor = spectrum.floor[min(round(line.order / spectrum.resolution), len(spectrum.floor) - 1)]
    return np.asarray((values if sign > 0 else values.conj()) / np.sqrt(floor))


def _common(columns: Complex) -> Complex:
    left, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, 0] * sizes[0])


@dataclass(frozen=True)
class ToolMotion:
    """Channels that hold the tool's motion across its axis, and the chip that this motion changes.

    A linear cut that is not stable grows until teeth leave the cut (Balachandran, Phil. Trans. R. Soc. A 359, 2001),
    which takes a motion of the size of the chip. The noise of a stable cut causes less.
    """

    chip: float  # m, thickest chip of the cut without vibration
    teeth: int
    spindle: float  # Hz
    scales: Real  # (n_channels,): unit of each channel in that of the samples; 0 for channels that do not count
    derivatives: tuple[int, ...]  # per channel: 2 for acceleration, 1 for velocity, 0 for displacement

    def change(self, orders: Real, power: Real) -> float:
        """Compute the root mean square of the chip's change from pass to pass, over the thickest chip.

        At a frequency f the chip changes by ``x (1 - exp(-2 pi i f tau))``, tau the time from tooth to tooth.
        ``orders`` (n_lines,) are frequencies over the spindle's, all positive, and ``power`` (n_lines, n_channels) mean
        squares of the evidence's channels.
        """
        omega = 2 * math.pi * self.spindle * orders
        regeneration = np.abs(1 - np.exp(-2j * np.pi * orders / self.teeth)) ** 2
        gains = self.scales**2 / omega[:, None] ** (2 * np.array(self.derivatives))
        return math.sqrt(float(np.sum(power * gains * regeneration[:, None]))) / self.chip

    def of_family(self, family: Family) -> float:
        """Compute the change of the chip by a family of lines, over the thickest chip."""
        orders = np.array([line.order for line in family.lines])
        return self.change(orders, np.array([line.amplitude for line in family.lines]) ** 2)


def irregular_change(spectrum: Spectrum, motion: ToolMotion, tones: Real) -> float:
    """Compute the root mean square of the chip's change by irregular motion, over the thickest chip.

    Irregular motion is power above a floor from lines within an octave: the noise of sensors is smooth over octaves,
    but the motion of the structure has humps at its modes. ``tones`` (n_tones,) are orders of foreign tones, which do
    not count.
    """
    used = spectrum.searched & (spectrum.orders > 0.1 * motion.teeth)  # above a tenth of the tooth passing
    for tone in tones:
        used &= np.abs(spectrum.orders - tone) > 5 * spectrum.resolution
    orders, power = spectrum.orders[used], spectrum.power[used]
    neighbours = 15  # lines over which power is averaged before it is compared with the floor
    if len(orders) < neighbours:
        return 0.0
    counted = motion.scales > 0
    floor = wide_floor(orders, power, 1.0)
    above = scipy.ndimage.uniform_filter1d(power, neighbours, axis=0) > THRESHOLDS.irregular_power * floor
    return motion.change(orders, np.where(above & counted, np.maximum(power - floor, 0.0), 0.0))


def alternation(revolutions: Revolutions) -> float:
    """Compute the size of the orders at odd multiples of half the tooth passing over the size of all other orders.

    The orders are those of the mean revolution. With an odd number of teeth the result is NaN, because half the tooth
    passing is then no order of the spindle. An eccentric cutter with four or more teeth causes orders one above and one
    below the tooth passing instead.
    """
    if revolutions.teeth % 2:
        return float("nan")
    alternating = _alternating(revolutions)
    others = np.mean(revolutions.mean_turn**2) - np.mean(alternating**2)
    return float(np.sqrt(np.mean(alternating**2) / max(float(others), 1e-300)))


def inequality(revolutions: Revolutions) -> float:
    """Compute the size of orders that unequal teeth alone cause over that of all orders of equal teeth.

    These are the orders that are no multiple of half the tooth passing: neither equal teeth nor period doubling have
    them.
    """
    power = np.sum(np.abs(np.fft.rfft(revolutions.mean_turn, axis=0)) ** 2, axis=1)
    orders, teeth = np.arange(len(power)), revolutions.teeth
    alone, equal = power[(2 * orders) % teeth != 0].sum(), power[orders % teeth == 0].sum()
    return math.sqrt(float(alone) / max(float(equal), 1e-300))


def alternation_course(revolutions: Revolutions) -> Course:
    """Compute the size, over the recording, of motion that alternates from tooth to tooth (even number of teeth)."""
    length = revolutions.count // PARTS
    eighths = [_alternating(revolutions.part(k * length, (k + 1) * length)) for k in range(PARTS)]
    return Course(np.array([float(np.sqrt(np.mean(eighth**2))) for eighth in eighths]))


def alternation_rise(revolutions: Revolutions) -> float:
    """Compute the alternation in the last eighth of a recording over that in the first (even number of teeth).

    At a wrong speed all orders are forced vibration, and grow alike.
    """
    length = revolutions.count // PARTS
    first, last = revolutions.part(0, length), revolutions.part(revolutions.count - length, revolutions.count)
    return alternation(last) / max(alternation(first), 1e-300)


def alternating_change(late: Revolutions, spectrum: Spectrum, motion: ToolMotion) -> float:
    """Compute the root mean square of the chip's change by alternating motion, over the thickest chip.

    Alternating motion consists of the significant orders at odd multiples of half the tooth passing; the number of
    teeth is even.
    """
    power = 2 * np.abs(np.fft.rfft(late.mean_turn, axis=0) / late.mean_turn.shape[0]) ** 2
    orders = np.arange(late.teeth // 2, int(spectrum.orders[spectrum.searched][-1]) + 1, late.teeth)
    above = (power[orders] / floor_of_mean_turn(late, spectrum, orders)).max(axis=1) > THRESHOLDS.order_power
    return motion.change(orders[above].astype(float), power[orders[above]])


def _alternating(revolutions: Revolutions) -> Real:
    """Extract the motion that changes its sign from tooth to tooth, (n_places / teeth, n_channels)."""
    turn = revolutions.mean_turn
    by_tooth = turn.reshape(revolutions.teeth, -1, turn.shape[1])
    signs = np.where(np.arange(revolutions.teeth) % 2, -1.0, 1.0)[:, None, None]
    return np.asarray((by_tooth * signs).mean(axis=0))
