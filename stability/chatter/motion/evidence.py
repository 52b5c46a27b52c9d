"""Evidence that is found in the recording of a cut, before anything is concluded from it."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .families import Family, families_of
from .lines import Spectrum, lines_of, spectrum_of
from .orders import Revolutions, to_revolutions
from .spindle import SpindleTrack, track_spindle

Real = NDArray[np.float64]

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
