"""Growing spectra, FRFs and traces of a recording, and whether the data suffice."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from acquisition import Channel
from estimation import (
    EXCITING,
    RESPONDING,
    CrossSpectra,
    Frf,
    Resampler,
    SpectralAccumulator,
    h1,
    input_independence,
    settings_for,
    sum_tests,
    to_receptance,
    whole_ratio,
)
from millfrf.core import InputError, Real
from millfrf.gate import driven_lines


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


_COHERENT = 0.5
_POOR = 1e3  # condition of the scaled forces from which noise on the weakest direction rules


@dataclass(frozen=True)
class StackedFrf:
    """FRF of several tests.

    Parameters
    ----------
    frf
        H1 over the tests' summed spectra; None: the forces are independent on no line.
    driven, known : (n_lines,), bool
        Lines on which a force has power, and those of them on which the forces are independent and a response
        follows them.
    """

    frf: Frf | None
    driven: NDArray[np.bool_]
    known: NDArray[np.bool_]


def stack(tests: Sequence[CrossSpectra]) -> StackedFrf:
    """Stack tests of one set-up, spectra of equal settings.

    Raises
    ------
    InputError
        No test, or tests that cannot be stacked.
    """
    total = sum_tests(tests)
    driven = driven_lines(total)
    none = StackedFrf(None, driven, np.zeros_like(driven))
    if total.effective_averages <= len(total.excitations) + 0.5:
        return none
    try:
        frf = h1(total)
    except InputError:
        return none
    known = driven & frf.valid & (input_independence(total).condition < _POOR)
    if frf.multiple_coherence is not None:
        known &= frf.multiple_coherence.max(axis=1) >= _COHERENT
    return StackedFrf(frf, driven, known) if known.any() else none


class TraceBuffer:
    """Minimum and maximum of consecutive buckets of samples.

    Parameters
    ----------
    n_channels
        Number of columns of the samples.
    sample_rate : Hz
        Samples a second.
    window : s
        Duration that is kept.
    points
        Number of buckets in the window.
    """

    def __init__(self, n_channels: int, sample_rate: float, window: float = 5.0, points: int = 400) -> None:
        self._bucket = max(1, math.ceil(window * sample_rate / points))
        self._rate = sample_rate
        self._points = points
        self._lowest = np.zeros((0, n_channels))
        self._highest = np.zeros((0, n_channels))
        self._rest = np.zeros((0, n_channels))
        self._n_buckets = 0

    def add(self, samples: Real) -> None:
        """Take the next samples (n, n_channels)."""
        joined = np.concatenate([self._rest, samples]) if len(self._rest) else samples
        n_whole = len(joined) // self._bucket
        whole = joined[: n_whole * self._bucket].reshape(n_whole, self._bucket, samples.shape[1])
        self._rest = joined[n_whole * self._bucket :].copy()
        self._n_buckets += n_whole
        if n_whole:
            self._lowest = np.concatenate([self._lowest, whole.min(axis=1)])[-self._points :]
            self._highest = np.concatenate([self._highest, whole.max(axis=1)])[-self._points :]

    def drawn(self) -> tuple[Real, Real]:
        """Times (n,), s, and values (n, n_channels): minimum and maximum of each bucket in turn."""
        n = len(self._lowest)
        buckets = np.arange(self._n_buckets - n, self._n_buckets)
        times = (np.repeat(buckets, 2) + np.tile([0.25, 0.75], n)) * self._bucket / self._rate
        values = np.stack([self._lowest, self._highest], axis=1).reshape(2 * n, self._lowest.shape[1])
        return times, values


@dataclass(frozen=True)
class BandProgress:
    """Progress in one band of frequencies.

    Parameters
    ----------
    low, high : Hz
        Lower and upper end of the band.
    share
        Share of its known lines that reach the wanted error, 0 ... 1.
    error
        Median over the known lines of the error over the wanted one; below 1 is enough; infinite where none is known.
    known
        Share of its lines on which the FRF is known, 0 ... 1.
    """

    low: float
    high: float
    share: float
    error: float
    known: float = 1.0

    @property
    def done(self) -> float:
        """Share of the data that the wanted error needs, 0 ... 1: an error falls with the root of the averages."""
        return min(1.0, 1.0 / self.error**2) if self.error > 0 else 1.0

    @property
    def enough(self) -> bool:
        """Whether at least nine tenths of the lines are known and nine tenths of those reach the wanted error."""
        return self.share >= 0.9 and self.known >= 0.9


def band_progress(
    frf: Frf | None,
    band: tuple[float, float],
    n_bands: int,
    *,
    known: NDArray[np.bool_] | None = None,
    relative: float,
    absolute: float | None = None,
) -> tuple[BandProgress, ...]:
    """Judge an FRF's error band by band.

    Parameters
    ----------
    frf
        FRF with its covariance; None: nothing is known yet.
    band : Hz
        Lowest and highest frequency; the band is cut into parts of equal width.
    n_bands
        Number of parts.
    known : (n_lines,), bool
        Lines on which the FRF says something; None: all that are valid.
    relative
        Wanted standard deviation of a column of the FRF over its length (2-norm over the responses).
    absolute
        Instead, the largest standard deviation of any entry of the receptance, m/N, that was planned.
    """
    edges = np.linspace(band[0], band[1], n_bands + 1)
    pairs = list(pairwise(edges))
    if frf is None or frf.covariance is None:
        return tuple(BandProgress(float(low), float(high), 0.0, float("inf"), 0.0) for low, high in pairs)
    reached = _worst(frf, relative, absolute)
    counted = frf.valid if known is None else known
    found = []
    for low, high in pairs:
        inside = (frf.frequencies >= low) & (frf.frequencies < high) & (frf.frequencies > 0)
        errors = reached[inside & counted]
        share = float(np.mean(errors <= 1)) if len(errors) else 0.0
        middle = float(np.median(errors)) if len(errors) else float("inf")
        covered = float(np.mean(counted[inside])) if inside.any() else 0.0
        found.append(BandProgress(float(low), float(high), share, middle, covered))
    return tuple(found)


def _worst(frf: Frf, relative: float, absolute: float | None) -> np.ndarray:
    """Error over the wanted one, the worst entry or column of each line; infinite where there is no FRF."""
    judged = frf if absolute is None else to_receptance(frf)
    assert judged.covariance is not None
    variance = judged.covariance.variance()
    if absolute is not None and judged.quantity == "receptance":
        error = np.sqrt(variance.max(axis=(1, 2))) / absolute
    else:
        size = np.sum(np.abs(judged.values) ** 2, axis=1)
        ratio = np.divide(variance.sum(axis=1), size, out=np.full(size.shape, np.inf), where=size > 0)
        error = np.sqrt(ratio.max(axis=1)) / relative
    return np.where(judged.valid, error, np.inf)
