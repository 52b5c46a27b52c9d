"""Spectra, coherence and FRF as they grow, of the band that matters: samples are reduced to its rate first."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acquisition import Channel
from estimation import EXCITING, RESPONDING, CrossSpectra, Resampler, SpectralAccumulator, settings_for, whole_ratio
from millfrf.core import InputError

Real = NDArray[np.float64]


@dataclass(frozen=True)
class GrownSpectra:
    """Spectra of one test so far.

    Parameters
    ----------
    frequencies : (n,), Hz
        Frequencies of the lines.
    power : (n, n_channels), unit^2/Hz
        Power spectral density of the excitations, then of the responses.
    cross
        The spectra themselves, for stacking with those of other tests.
    averages
        Number of independent averages.
    """

    frequencies: Real
    power: Real
    cross: CrossSpectra
    averages: float


class LiveSpectra:
    """Spectra that grow while samples come.

    Parameters
    ----------
    channels
        Channels of the stream; forces excite, motions respond.
    sample_rate : Hz
        Samples a second.
    highest_frequency : Hz
        Upper end of the band.
    segment : s
        Duration of a segment.

    Raises
    ------
    InputError
        No force or no motion among the channels, or a band that does not fit.
    """

    def __init__(
        self, channels: Sequence[Channel], sample_rate: float, highest_frequency: float, segment: float
    ) -> None:
        self._exciting = [k for k, channel in enumerate(channels) if channel.quantity in EXCITING and channel.node]
        self._responding = [k for k, channel in enumerate(channels) if channel.quantity in RESPONDING]
        if not self._exciting or not self._responding:
            raise InputError("no force or no motion with a place among the channels; there is no FRF to grow")
        self._resampler = Resampler(sample_rate, whole_ratio(sample_rate, highest_frequency))
        rate = self._resampler.rate
        self._highest = highest_frequency
        settings = settings_for(rate, max(segment, 16 / rate), window="hann")
        exciting, responding = ([channels[k] for k in chosen] for chosen in (self._exciting, self._responding))
        self._accumulator = SpectralAccumulator(exciting, responding, rate, settings)

    def add(self, samples: Real) -> None:
        """Take the next samples (n, n_channels)."""
        low = self._resampler.add(samples[:, [*self._exciting, *self._responding]])
        if len(low):
            n = len(self._exciting)
            self._accumulator.add(low[:, :n], low[:, n:])

    def grown(self) -> GrownSpectra | None:
        """Give the spectra so far; None before the first segment is full."""
        try:
            spectra = self._accumulator.result()
        except InputError:
            return None
        cross = _lines(spectra, (spectra.frequencies <= self._highest) & (spectra.frequencies > 0))
        inputs = np.real(np.einsum("kii->ki", cross.input_spectra))
        outputs = np.real(np.einsum("kii->ki", cross.output_spectra))
        power = np.concatenate([inputs, outputs], axis=1)
        return GrownSpectra(cross.frequencies, power, cross, cross.effective_averages)


def _lines(spectra: CrossSpectra, chosen: NDArray[np.bool_]) -> CrossSpectra:
    """Chosen lines of spectra."""
    return replace(
        spectra,
        frequencies=spectra.frequencies[chosen],
        input_spectra=spectra.input_spectra[chosen],
        cross_spectra=spectra.cross_spectra[chosen],
        output_spectra=spectra.output_spectra[chosen],
    )
