"""Samples at equal angles of the spindle, and what of them does not repeat every revolution."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import resample_poly

from .spindle import SpindleTrack

Real = NDArray[np.float64]

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
        samples[:, number] = CubicSpline(times, resample_poly(column, 2, 1))(when)
    return Revolutions(samples.reshape(count, places, -1), track.mean_frequency, teeth)
