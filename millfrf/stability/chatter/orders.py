"""Samples at equal angles of the spindle, and how the size of a line changes over a recording."""

from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import Real

from .spindle import SpindleTrack

_FEWEST_PLACES = 32  # a revolution


@dataclass(frozen=True)
class Revolutions:
    """A recording cut into revolutions of the spindle.

    Parameters
    ----------
    samples : (n_revolutions, n_places, n_channels)
        Samples at equal angles of the spindle; the number of places is a multiple of the number of teeth.
    frequency : Hz
        Mean frequency of the spindle.
    teeth
        Number of teeth.
    """

    samples: Real
    frequency: float
    teeth: int

    def part(self, first: int, last: int) -> "Revolutions":
        """Revolutions ``first`` to ``last``, the latter not included."""
        return Revolutions(self.samples[first:last], self.frequency, self.teeth)

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
        """Mean over the revolutions, without its mean over the angle: all spindle orders, (n_places, n_channels)."""
        turn = self.samples.mean(axis=0)
        return np.asarray(turn - turn.mean(axis=0))

    @property
    def residual(self) -> Real:
        """Samples without the orders of the spindle, (n_revolutions * n_places, n_channels).

        At each angle a straight line over the revolutions is taken away, so that orders may grow or fall slowly.
        """
        n = self.count
        line = np.linspace(-1.0, 1.0, n)
        slope = np.tensordot(line, self.samples, axes=1) / np.sum(line**2)
        rest = self.samples - self.samples.mean(axis=0) - line[:, None, None] * slope
        return np.asarray(rest.reshape(n * self.samples.shape[1], -1))


def to_revolutions(data: Real, sample_rate: float, track: SpindleTrack, teeth: int) -> Revolutions:
    """Resample a recording (n_samples, n_channels) at equal angles of the spindle.

    The samples are doubled in number by a band-limited filter before cubic splines are laid through them.
    """
    times = np.arange(2 * len(data)) / (2 * sample_rate)
    turns = track.revolutions(times)
    count = int(turns[len(data) * 2 - 2])
    places = max(_FEWEST_PLACES, int(np.ceil(sample_rate / track.mean_frequency)))
    places = -(-places // (2 * teeth)) * 2 * teeth
    angles = np.arange(count * places) / places
    when = np.interp(angles, turns, times)
    for _ in range(2):
        speed = np.gradient(turns, times, edge_order=2)
        when = when - (track.revolutions(when) - angles) / np.interp(when, times, speed)
    samples = np.empty((len(when), data.shape[1]))
    for number, column in enumerate(data.T):  # a spline takes many times the memory of its samples
        samples[:, number] = scipy.interpolate.CubicSpline(times, scipy.signal.resample_poly(column, 2, 1))(when)
    return Revolutions(samples.reshape(count, places, -1), track.mean_frequency, teeth)


PARTS = 8
"""Parts into which a recording is divided."""
_RISE = np.log(3.0)
_STRAIGHT = 0.97  # correlation of a growing line's logarithm with time; eight sizes of noise have it once in 30000
_SPREAD = 1.5  # lines of resolution of a part on either side of the line that still count


@dataclass(frozen=True)
class Course:
    """Size of a line in eight equal parts of a recording.

    Parameters
    ----------
    sizes : (8,)
        Root mean square, all channels together.
    """

    sizes: Real

    @property
    def growth(self) -> float:
        """Last eighth over first."""
        return float(self.sizes[-1] / max(self.sizes[0], 1e-300))

    @property
    def dies_out(self) -> bool:
        """Whether it falls by 30 % or more over the first half of the recording, and again over the second."""
        first, middle, last = self.sizes[0], self.sizes[3:5].mean(), self.sizes[-1]
        return bool(middle < 0.7 * first and last < 0.7 * middle)

    @property
    def grows(self) -> bool:
        """Whether it rises threefold or more, as straight on a logarithmic scale as noise hardly ever does."""
        logarithm = np.log(np.maximum(self.sizes, 1e-300))
        if logarithm.std() < 1e-9:
            return False
        along = np.arange(PARTS)
        rise = float(np.polyfit(along, logarithm, 1)[0]) * (PARTS - 1)
        return bool(rise > _RISE and np.corrcoef(along, logarithm)[0, 1] > _STRAIGHT)

    @property
    def steadiness(self) -> float:
        """Standard deviation of the power over its mean after the first quarter: 1 for noise, 0 for a limit cycle."""
        power = self.sizes[PARTS // 4 :] ** 2
        return float(power.std() / max(power.mean(), 1e-300))


def course_of(revolutions: Revolutions, order: float) -> Course:
    """Size of the line at an order over the recording."""
    rest = revolutions.residual.reshape(revolutions.samples.shape)
    length = revolutions.count // PARTS
    return Course(np.array([_size(rest[k * length : (k + 1) * length], order) for k in range(PARTS)]))


def _size(part: Real, order: float) -> float:
    flat = part.reshape(-1, part.shape[2])
    window = np.hanning(len(flat) + 2)[1:-1]
    turns = np.arange(len(flat)) / part.shape[1]
    shifts = np.arange(-_SPREAD, _SPREAD + 0.25, 0.5) / len(part)
    waves = np.exp(-2j * np.pi * np.outer(order + shifts, turns)) * window
    return float(np.sqrt(np.sum(np.abs(waves @ flat) ** 2)) / window.sum())
