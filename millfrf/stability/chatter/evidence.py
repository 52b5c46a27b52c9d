"""Evidence in the recording of a cut: variation of lines in time, irregular motion, differences between teeth."""

import math
from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import Complex, Real

from .lines import Family, Line, Spectrum, families_of, lines_of, spectrum_of
from .orders import PARTS, Course, Revolutions, to_revolutions
from .spindle import SpindleTrack, track_spindle

LEVEL = 1e-4
"""Family-wise p-value below which a line stands out."""
_TRIALS = 100  # frequencies of the spindle that were tried


@dataclass(frozen=True)
class Evidence:
    """Spindle, spectrum and lines of a recording.

    Parameters
    ----------
    track
        Angle of the spindle over time.
    revolutions
        The whole recording, with channels scaled to like size.
    late
        Second half of the recording, which is judged.
    spectrum
        Spectrum of what does not repeat with the revolution in the second half.
    families
        Lines that stand out, gathered by the tooth passing, strongest first.
    order_p_value
        Probability that noise alone looks as much like orders of the spindle as the recording.
    sample_rate : Hz
        Samples a second.
    scales : (n_channels,)
        Standard deviation of the samples of each channel, by which the evidence's were divided.
    """

    track: SpindleTrack
    revolutions: Revolutions
    late: Revolutions
    spectrum: Spectrum
    families: tuple[Family, ...]
    order_p_value: float
    sample_rate: float
    scales: Real

    @property
    def alternation_p_value(self) -> float:
        """The same of the orders at odd multiples of half the tooth passing; 1 with an odd number of teeth."""
        teeth = self.late.teeth
        return 1.0 if teeth % 2 else _order_p_value(self.late, self.spectrum, teeth // 2, teeth)

    @property
    def deviation(self) -> float:
        """Size of what does not repeat over the size of the motion, in the channel where it is smallest."""
        return float(np.min(self.late.residual.std(axis=0) / self.late.size))

    @property
    def least_share(self) -> float:
        """Smallest share of the motion that a line must have to stand out where the floor is highest."""
        floor = np.where(self.spectrum.searched[:, None], self.spectrum.floor, 0.0)
        needed = math.log(self.spectrum.searched.sum() * floor.shape[1] / LEVEL)
        return float(np.min(np.sqrt(needed * floor.max(axis=0)) / self.late.size))


def gather_evidence(samples: Real, sample_rate: float, spindle_speed: float, teeth: int) -> Evidence:
    """Follow the spindle, take its orders away, and find the lines that are left.

    Parameters
    ----------
    samples : (n_samples, n_channels)
        Samples of the recording; channels that hold no motion are left out.
    sample_rate : Hz
        Samples a second.
    spindle_speed : rad/s
        Stated spindle speed, right within 1 %.
    teeth
        Number of teeth.
    """
    data = samples - samples.mean(axis=0)
    scales = np.maximum(data.std(axis=0), 1e-300)
    data = data / scales
    track = track_spindle(data, sample_rate, spindle_speed / (2 * math.pi))
    revolutions = to_revolutions(data, sample_rate, track, teeth)
    late = revolutions.part(revolutions.count // 2, revolutions.count)
    spectrum = spectrum_of(late)
    lines = lines_of(spectrum, track.mean_frequency, LEVEL)
    families = families_of(lines, teeth, spectrum.resolution, late.size)
    return Evidence(track, revolutions, late, spectrum, families, _order_p_value(late, spectrum), sample_rate, scales)


def _order_p_value(late: Revolutions, spectrum: Spectrum, first: int = 1, step: int = 1) -> float:
    """Family-wise p-value of the strongest of the orders ``first, first + step, ...`` over the floor beside it."""
    amplitudes = np.fft.rfft(late.mean_turn, axis=0) / late.mean_turn.shape[0]
    orders = np.arange(first, int(spectrum.orders[spectrum.searched][-1]) + 1, step)
    power = 2 * np.abs(amplitudes[orders]) ** 2
    ratio = float((power / spectrum.floor[orders * late.count]).max())
    return min(1.0, float(power.size * _TRIALS * math.exp(-min(ratio, 700.0))))


_PASSES = 8  # tooth periods a value
_BEGIN = 8  # share of the recording, one over this, in which the entry may still die out


@dataclass(frozen=True)
class Envelope:
    """Size and phase, over time, of lines that belong together.

    Parameters
    ----------
    fluctuation
        Standard deviation of the power over its mean: 1 for noise through a mode, whose envelope is normally
        distributed, small for a limit cycle.
    coherence
        Coherence, 0 to 1, of the strongest line with all others together: side lines that the teeth make vary with it;
        a foreign tone among lines of noise has no such side lines.
    """

    fluctuation: float
    coherence: float


def envelope_of(revolutions: Revolutions, family: Family, spectrum: Spectrum) -> Envelope:
    """Demodulate the lines of a family, each channel over its noise floor, and take what they share.

    The teeth make of one motion ``a(t) exp(i w t)`` lines at ``+-w + k w_tooth``, all with the same a(t), or its
    conjugate for those mirrored. The first singular vector of all lines and channels is a(t) at the best ratio of
    signal to noise (Golub & Van Loan, Matrix Computations, section 2.4).

    Parameters
    ----------
    revolutions
        The whole recording, cut into revolutions.
    family
        Family of two lines or more.
    spectrum
        Spectrum of the residual, with its noise floor.
    """
    teeth = revolutions.teeth
    power = np.array([float((line.amplitude**2).sum()) for line in family.lines])
    places = np.array([abs(_signed(line.order, teeth)) for line in family.lines])
    place = float(np.average(places, weights=power))
    rest = revolutions.residual
    columns = [_demodulated(rest, revolutions, line, place, spectrum) for line in family.lines]
    columns = [column[len(column) // _BEGIN :] for column in columns]
    strongest, others = _shared(columns[0]), _shared(np.concatenate(columns[1:], axis=1))
    size = np.abs(_shared(np.concatenate(columns, axis=1))) ** 2
    alike = abs(np.vdot(strongest, others)) ** 2 / max(
        float(np.sum(np.abs(strongest) ** 2) * np.sum(np.abs(others) ** 2)), 1e-300
    )
    return Envelope(float(size.std() / max(size.mean(), 1e-300)), float(alike))


def _signed(order: float, teeth: int) -> float:
    """Distance from the nearest multiple of the number of teeth, with its sign."""
    return (order + teeth / 2) % teeth - teeth / 2


def _demodulated(rest: Real, revolutions: Revolutions, line: Line, place: float, spectrum: Spectrum) -> Complex:
    """The line over time, (n_values, n_channels), conjugated where it is mirrored, over the noise at its frequency."""
    teeth, n_places = revolutions.teeth, revolutions.samples.shape[1]
    away = _signed(line.order, teeth)
    sign = 1.0 if away >= 0 else -1.0
    order = round((line.order - away) / teeth) * teeth + sign * place
    length = _PASSES * n_places // teeth
    count = len(rest) // length
    wave = np.exp(-2j * np.pi * order * np.arange(count * length) / n_places)
    window = np.hanning(length + 2)[1:-1]
    parts = (rest[: count * length] * wave[:, None]).reshape(count, length, -1)
    values = np.einsum("ktc,t->kc", parts, window) / window.sum()
    floor = spectrum.floor[min(round(line.order / spectrum.resolution), len(spectrum.floor) - 1)]
    return np.asarray((values if sign > 0 else values.conj()) / np.sqrt(floor))


def _shared(columns: Complex) -> Complex:
    left, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, 0] * sizes[0])


@dataclass(frozen=True)
class ToolMotion:
    """Channels that hold the tool's motion across its axis, and the chip that it changes.

    A linear cut that is not stable grows until teeth leave the cut (Balachandran, Phil. Trans. R. Soc. A 359, 2001),
    which takes a motion of the size of the chip. What a stable cut's own noise does is smaller.

    Parameters
    ----------
    chip
        Thickest chip of the cut without vibration, m.
    teeth
        Number of teeth.
    spindle
        Frequency of the spindle, Hz.
    scales : (n_channels,)
        Unit of each channel of the evidence, in that of the samples; 0 for channels that do not count.
    derivatives : (n_channels,)
        2 for acceleration, 1 for velocity, 0 for displacement.
    """

    chip: float
    teeth: int
    spindle: float
    scales: Real
    derivatives: tuple[int, ...]

    def change(self, orders: Real, power: Real, *, alike: bool = False) -> float:
        """Root mean square of the chip's change from pass to pass over the thickest chip.

        At a frequency f the chip changes by ``x (1 - exp(-2 pi i f tau))``, tau the time from tooth to tooth.

        Parameters
        ----------
        orders : (n_lines,)
            Frequencies over the spindle's, all positive.
        power : (n_lines, n_channels)
            Mean square of the evidence's channels.
        alike
            Motion itself instead of its change from pass to pass.
        """
        omega = 2 * math.pi * self.spindle * orders
        passed = np.ones(len(orders)) if alike else np.abs(1 - np.exp(-2j * np.pi * orders / self.teeth)) ** 2
        gains = self.scales**2 / omega[:, None] ** (2 * np.array(self.derivatives))
        return math.sqrt(float(np.sum(power * gains * passed[:, None]))) / self.chip

    def of_family(self, family: Family) -> float:
        """The same for lines that belong together."""
        orders = np.array([line.order for line in family.lines])
        return self.change(orders, np.array([line.amplitude for line in family.lines]) ** 2)


ABOVE = 3.0
"""Mean power of neighbouring lines over the floor from which it counts."""
_NEIGHBOURS = 15
_LOWEST = 0.1  # of the tooth passing
_QUANTILE = 0.2  # of exponentially distributed power, which is -ln(1 - 0.2) of its mean
_PLACES = 60  # at which the floor is computed
_WIDE = 2.0  # a floor from half to twice a frequency
_BESIDE = 5  # lines on either side of a tone that are left out


def irregular_change(spectrum: Spectrum, motion: ToolMotion, tones: Real) -> float:
    """Root mean square of the chip's change by what stands out of a floor two octaves wide, over the thickest chip.

    The noise of sensors is smooth over octaves; motion of the structure has humps at its modes.

    Parameters
    ----------
    spectrum
        Spectrum of what does not repeat with the revolution.
    motion
        Channels of the tool's motion, and the thickest chip.
    tones : (n_tones,)
        Orders of foreign tones, which do not count.
    """
    used = spectrum.searched & (spectrum.orders > _LOWEST * motion.teeth)
    for tone in tones:
        used &= np.abs(spectrum.orders - tone) > _BESIDE * spectrum.resolution
    orders, power = spectrum.orders[used], spectrum.power[used]
    if len(orders) < _NEIGHBOURS:
        return 0.0
    counted = motion.scales > 0
    floor = _wide_floor(orders, power)
    stands = scipy.ndimage.uniform_filter1d(power, _NEIGHBOURS, axis=0) > ABOVE * floor
    return motion.change(orders, np.where(stands & counted, np.maximum(power - floor, 0.0), 0.0))


def _wide_floor(orders: Real, power: Real) -> Real:
    """Mean power that the weakest fifth of the lines within an octave on either side speaks for, as ``power``."""
    places = np.geomspace(orders[0], orders[-1], _PLACES)
    low, high = np.searchsorted(orders, places / _WIDE), np.searchsorted(orders, places * _WIDE)
    share = -np.log(1 - _QUANTILE)
    values = np.array([np.quantile(power[a:b], _QUANTILE, axis=0) / share for a, b in zip(low, high, strict=True)])
    logarithm = np.log(np.maximum(values, 1e-300))
    columns = [np.interp(np.log(orders), np.log(places), column) for column in logarithm.T]
    return np.asarray(np.exp(np.column_stack(columns)))


_STANDS_OUT = 20.0  # power of an order over the noise from which it counts


def alternation(revolutions: Revolutions) -> float:
    """Size of the orders at odd multiples of half the tooth passing over that of all other orders.

    They are those of the mean revolution. With an odd number of teeth the result is NaN, because half the tooth passing
    is no order of the spindle then. An eccentric cutter with four teeth or more has orders one above and
    one below the tooth passing instead.
    """
    if revolutions.teeth % 2:
        return float("nan")
    alternating = _alternating(revolutions)
    rest = np.mean(revolutions.mean_turn**2) - np.mean(alternating**2)
    return float(np.sqrt(np.mean(alternating**2) / max(float(rest), 1e-300)))


def alternation_course(revolutions: Revolutions) -> Course:
    """Size over the recording of what alternates from tooth to tooth; the number of teeth is even."""
    length = revolutions.count // PARTS
    parts = [_alternating(revolutions.part(k * length, (k + 1) * length)) for k in range(PARTS)]
    return Course(np.array([float(np.sqrt(np.mean(part**2))) for part in parts]))


def alternating_change(late: Revolutions, spectrum: Spectrum, motion: ToolMotion) -> float:
    """Root mean square of the chip's change by what alternates from tooth to tooth, over the thickest chip.

    Of orders at odd multiples of half the tooth passing that stand out of the noise; 0 with an odd number of teeth.
    """
    if late.teeth % 2:
        return 0.0
    power = 2 * np.abs(np.fft.rfft(late.mean_turn, axis=0) / late.mean_turn.shape[0]) ** 2
    orders = np.arange(late.teeth // 2, int(spectrum.orders[spectrum.searched][-1]) + 1, late.teeth)
    stands = (power[orders] / spectrum.floor[orders * late.count]).max(axis=1) > _STANDS_OUT
    return motion.change(orders[stands].astype(float), power[orders[stands]])


def _alternating(revolutions: Revolutions) -> Real:
    """Give the part that changes its sign from tooth to tooth, (n_places / teeth, n_channels)."""
    turn = revolutions.mean_turn
    by_tooth = turn.reshape(revolutions.teeth, -1, turn.shape[1])
    signs = np.where(np.arange(revolutions.teeth) % 2, -1.0, 1.0)[:, None, None]
    return np.asarray((by_tooth * signs).mean(axis=0))
