"""Running spectra, FRFs and traces of a recording, and the progress of their errors."""

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
    """Spectra of one test so far."""

    frequencies: Real  # (n,), Hz
    power: Real  # (n, n_channels), unit^2/Hz; power spectral densities of excitations, then responses
    cross: CrossSpectra  # for averaging with other tests
    averages: float  # number of independent averages


class LiveSpectra:
    """Spectra, updated with each block of samples; ``segment`` in s, ``highest_frequency`` of the band in Hz."""

    def __init__(
        self, channels: Sequence[Channel], sample_rate: float, highest_frequency: float, segment: float
    ) -> None:
        self._exciting = [k for k, channel in enumerate(channels) if channel.quantity in EXCITING and channel.node]
        self._responding = [k for k, channel in enumerate(channels) if channel.quantity in RESPONDING]
        if not self._exciting or not self._responding:
            raise InputError("no FRF: the channels need a force with a node and a motion")
        self._resampler = Resampler(sample_rate, whole_ratio(sample_rate, highest_frequency))
        rate = self._resampler.rate
        self._highest = highest_frequency
        settings = settings_for(rate, max(segment, 16 / rate), window="hann")
        exciting, responding = ([channels[k] for k in chosen] for chosen in (self._exciting, self._responding))
        self._accumulator = SpectralAccumulator(exciting, responding, rate, settings)

    def add(self, samples: Real) -> None:
        """Add the next samples, with one column per channel."""
        low = self._resampler.add(samples[:, [*self._exciting, *self._responding]])
        if len(low):
            n = len(self._exciting)
            self._accumulator.add(low[:, :n], low[:, n:])

    def grown(self) -> GrownSpectra | None:
        """Return the spectra so far; None before the first segment is complete."""
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
    return replace(
        spectra,
        frequencies=spectra.frequencies[chosen],
        input_spectra=spectra.input_spectra[chosen],
        cross_spectra=spectra.cross_spectra[chosen],
        output_spectra=spectra.output_spectra[chosen],
    )


_COHERENT = 0.5  # least multiple coherence of one response
_LARGEST_CONDITION = 1e3  # of the scaled forces; above it noise dominates the weakest direction


@dataclass(frozen=True)
class StackedFrf:
    """FRF estimated from several tests."""

    frf: Frf | None  # H1; None: the forces are independent on no line
    driven: NDArray[np.bool_]  # (n_lines,); lines with power of a force
    known: NDArray[np.bool_]  # (n_lines,); driven lines with independent forces and a coherent response


def stack(tests: Sequence[CrossSpectra]) -> StackedFrf:
    """Estimate the FRF of several tests with equal set-up and settings."""
    total = sum_tests(tests)
    driven = driven_lines(total)
    none = StackedFrf(None, driven, np.zeros_like(driven))
    if total.effective_averages <= len(total.excitations) + 0.5:
        return none
    try:
        frf = h1(total)
    except InputError:
        return none
    known = driven & frf.valid & (input_independence(total).condition < _LARGEST_CONDITION)
    if frf.multiple_coherence is not None:
        known &= frf.multiple_coherence.max(axis=1) >= _COHERENT
    return StackedFrf(frf, driven, known) if known.any() else none


class TraceBuffer:
    """Minimum and maximum of consecutive buckets of samples over the last ``window`` s."""

    def __init__(self, n_channels: int, sample_rate: float, window: float = 5.0, points: int = 400) -> None:
        self._bucket = max(1, math.ceil(window * sample_rate / points))
        self._rate = sample_rate
        self._points = points
        self._lowest = np.zeros((0, n_channels))
        self._highest = np.zeros((0, n_channels))
        self._incomplete = np.zeros((0, n_channels))
        self._n_buckets = 0

    def add(self, samples: Real) -> None:
        """Add the next samples, with one column per channel."""
        joined = np.concatenate([self._incomplete, samples]) if len(self._incomplete) else samples
        n_whole = len(joined) // self._bucket
        buckets = joined[: n_whole * self._bucket].reshape(n_whole, self._bucket, samples.shape[1])
        self._incomplete = joined[n_whole * self._bucket :].copy()
        self._n_buckets += n_whole
        if n_whole:
            self._lowest = np.concatenate([self._lowest, buckets.min(axis=1)])[-self._points :]
            self._highest = np.concatenate([self._highest, buckets.max(axis=1)])[-self._points :]

    def drawn(self) -> tuple[Real, Real]:
        """Return times (s) and values, one column per channel; minimum and maximum of each bucket alternate."""
        n = len(self._lowest)
        buckets = np.arange(self._n_buckets - n, self._n_buckets)
        times = (np.repeat(buckets, 2) + np.tile([0.25, 0.75], n)) * self._bucket / self._rate
        values = np.stack([self._lowest, self._highest], axis=1).reshape(2 * n, self._lowest.shape[1])
        return times, values


@dataclass(frozen=True)
class BandProgress:
    """Progress in one band of frequencies."""

    low: float  # Hz
    high: float  # Hz
    share: float  # share of the known lines that reach the planned error, 0 to 1
    error: float  # median over the known lines of error over planned error; infinite: no line is known
    known: float = 1.0  # share of the lines with a known FRF, 0 to 1

    @property
    def done(self) -> float:
        """Share of the averages needed for the planned error, 0 to 1; the error falls with the root of their number."""
        return min(1.0, 1.0 / self.error**2) if self.error > 0 else 1.0

    @property
    def enough(self) -> bool:
        """Whether 90 % of the lines are known and 90 % of the known lines reach the planned error."""
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
    """Compare the error of an FRF with the planned error in bands of equal width.

    ``band`` is in Hz; ``known`` states for each line whether the FRF is known, by default on all valid lines.
    """
    edges = np.linspace(band[0], band[1], n_bands + 1)
    pairs = list(pairwise(edges))
    if frf is None or frf.covariance is None:
        return tuple(BandProgress(float(low), float(high), 0.0, float("inf"), 0.0) for low, high in pairs)
    reached = _worst(frf, relative, absolute)
    counted = frf.valid if known is None else known
    progress = []
    for low, high in pairs:
        in_band = (frf.frequencies >= low) & (frf.frequencies < high) & (frf.frequencies > 0)
        errors = reached[in_band & counted]
        share = float(np.mean(errors <= 1)) if len(errors) else 0.0
        median = float(np.median(errors)) if len(errors) else float("inf")
        covered = float(np.mean(counted[in_band])) if in_band.any() else 0.0
        progress.append(BandProgress(float(low), float(high), share, median, covered))
    return tuple(progress)


def _worst(frf: Frf, relative: float, absolute: float | None) -> np.ndarray:
    """Return for each line the largest ratio of error to planned error; infinite where the FRF is not known.

    A planned error in m/N is compared with each entry, a relative planned error with each column of the FRF matrix.
    """
    compared = frf if absolute is None else to_receptance(frf)
    assert compared.covariance is not None
    variance = compared.covariance.variance()
    if absolute is not None and compared.quantity == "receptance":
        error = np.sqrt(variance.max(axis=(1, 2))) / absolute
    else:
        size = np.sum(np.abs(compared.values) ** 2, axis=1)
        ratio = np.divide(variance.sum(axis=1), size, out=np.full(size.shape, np.inf), where=size > 0)
        error = np.sqrt(ratio.max(axis=1)) / relative
    return np.where(compared.valid, error, np.inf)
