"""Welch's averaged spectra of samples that arrive block by block, in constant memory."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import scipy
from numpy.typing import NDArray

from acquisition import Channel
from millfrf.core import Complex, InputError, Real

from .cross_spectra import (
    CrossSpectra,
    SpectralSettings,
    check_settings,
    effective_averages,
    hop_length,
    line_step,
    window_samples,
)

_WORKERS = 2
_BATCH = 8  # segments whose products are added at once: the sums are read and written once per batch
_LINE_BYTES = 64 << 20  # of a batch at most, so that long segments of many channels have smaller batches
_ROWS = 4  # channels transformed at once: they stay in the processor's cache, and share its instructions


class SpectralAccumulator:
    """Sum windowed cross spectra over segments as samples arrive.

    ``S_uv[k] = 2 / (fs sum w^2) * mean over segments of U_k conj(V_k)``, one-sided; lines 0 and Nyquist are not
    doubled (Welch 1967; Bendat & Piersol, Random Data, 4th ed., section 11.5). Known input delays of the channels are
    removed from the result.

    Parameters
    ----------
    excitations, responses
        Channels along the columns of the samples.
    sample_rate : Hz
        Samples per second.
    settings
        Segment length, overlap, window and detrending.

    Raises
    ------
    InputError
        Settings that cannot be used, or no channels.
    """

    def __init__(
        self,
        excitations: Sequence[Channel],
        responses: Sequence[Channel],
        sample_rate: float,
        settings: SpectralSettings,
    ) -> None:
        check_settings(settings)
        if not excitations or not responses:
            raise InputError("spectra need at least one excitation and one response channel; name them")
        self.excitations, self.responses = tuple(excitations), tuple(responses)
        self.sample_rate, self.settings = sample_rate, settings
        self.n_segments = self.n_excluded = 0
        self._window = window_samples(settings)
        self._hop = hop_length(settings)
        width, length = len(self.excitations) + len(self.responses), settings.segment_length
        n_lines = length // 2 + 1
        batch = max(1, min(_BATCH, _LINE_BYTES // (16 * n_lines * width)))
        # memory that is used again for every segment and batch: new memory costs more time than a transform
        self._waiting = np.empty((width, 2 * length))  # samples from the start of the next segment on
        self._waiting_usable = np.empty(2 * length, dtype=bool)
        self._windowed = np.empty((width, length))
        self._lines = np.empty((batch, width, n_lines), dtype=complex)  # segments whose products are not in the sums
        self._sum = np.empty((n_lines, width, width), dtype=complex)
        self._n_waiting = self._n_held = self._n_summed = 0

    def add(
        self,
        excitation_samples: NDArray[np.floating],
        response_samples: NDArray[np.floating],
        usable: NDArray[np.bool_] | None = None,
    ) -> None:
        """Add the next samples, (n, n_excitations) and (n, n_responses), any number of them.

        Segments with a sample that is not ``usable`` (n,) are left out and counted in ``n_excluded``.

        Raises
        ------
        InputError
            Unequal lengths, wrong numbers of columns, or samples that are not finite.
        """
        shapes = (np.shape(excitation_samples), np.shape(response_samples))
        n = shapes[0][0]
        if shapes != ((n, len(self.excitations)), (n, len(self.responses))):
            raise InputError(
                f"samples of shapes {shapes[0]} and {shapes[1]}, expected (n, {len(self.excitations)}) and "
                f"(n, {len(self.responses)}) of one length"
            )
        with ThreadPoolExecutor(_WORKERS) as pool:  # threads, because transforms and products release the GIL
            first = 0
            while first < n:
                last = min(n, first + self._waiting.shape[1] - self._n_waiting)
                here = slice(first, last)
                self._take(excitation_samples[here], response_samples[here], None if usable is None else usable[here])
                self._transform(pool)
                first = last

    def _take(
        self, excitations: NDArray[np.floating], responses: NDArray[np.floating], usable: NDArray[np.bool_] | None
    ) -> None:
        """Append samples, for which there is room, to the waiting ones."""
        begin = self._n_waiting
        self._n_waiting += len(excitations)
        new = self._waiting[:, begin : self._n_waiting]
        new[: len(self.excitations)] = excitations.T
        new[len(self.excitations) :] = responses.T
        if usable is not None:
            new[:, ~usable] = 0.0  # they may be NaN, which is refused below; their segments are left out
        if not np.isfinite(new.sum()):  # one value that is not finite makes the sum so
            row = int(np.argmin(np.isfinite(new).all(axis=1)))
            name = (*self.excitations, *self.responses)[row].name
            raise InputError(f"channel {name} holds NaN or infinity; correct or convert the recording")
        self._waiting_usable[begin : self._n_waiting] = True if usable is None else usable

    def _transform(self, pool: ThreadPoolExecutor) -> None:
        """Transform the segments that are complete, and drop the samples that no later segment holds."""
        length, start = self.settings.segment_length, 0
        while start + length <= self._n_waiting:
            if self._waiting_usable[start : start + length].all():
                samples = self._waiting[:, start : start + length]
                list(pool.map(partial(self._transform_rows, samples), range(0, len(samples), _ROWS)))
                self._n_held += 1
                self.n_segments += 1
                if self._n_held == len(self._lines):
                    self._add_products(pool)
            else:
                self.n_excluded += 1
            start += self._hop
        if start:
            left = self._n_waiting - start
            self._waiting[:, :left] = self._waiting[:, start : self._n_waiting].copy()
            self._waiting_usable[:left] = self._waiting_usable[start : self._n_waiting].copy()
            self._n_waiting = left

    def _transform_rows(self, samples: Real, first: int) -> None:
        """Window and transform the channels from ``first`` on of a segment, in the calling thread.

        scipy's own threads (``workers``) are not used: they end before each fork of the process, and a fork that meets
        their start never returns.
        """
        rows = slice(first, first + _ROWS)
        windowed = self._windowed[rows]
        _detrend(samples[rows], self.settings.detrend, windowed)
        windowed *= self._window
        self._lines[self._n_held, rows] = scipy.fft.rfft(windowed, axis=1, overwrite_x=True)

    def _add_products(self, pool: ThreadPoolExecutor, scale: Real | None = None) -> None:
        """Add the products of the transformed segments to the sums, some lines at a time, then scale the sums."""
        edges = np.linspace(0, len(self._sum), _WORKERS + 1).astype(int).tolist()
        list(pool.map(partial(self._add_between, scale), edges[:-1], edges[1:]))
        self._n_summed += self._n_held
        self._n_held = 0

    def _add_between(self, scale: Real | None, first: int, last: int) -> None:
        step = min(line_step(self._sum), last - first)
        values = np.empty((step, self._n_held, self._sum.shape[1]), dtype=complex)
        products = np.empty((step, *self._sum.shape[1:]), dtype=complex)
        for start in range(first, last, step):
            sums = self._sum[start : min(start + step, last)]
            here, added = values[: len(sums)], products[: len(sums)]
            here[...] = self._lines[: self._n_held, :, start : start + len(sums)].transpose(2, 0, 1)
            if self._n_summed:
                np.matmul(here.transpose(0, 2, 1), here.conj(), out=added)
                sums += added
            else:
                np.matmul(here.transpose(0, 2, 1), here.conj(), out=sums)
            if scale is not None:
                sums *= scale[start : start + len(sums), None, None]

    def result(self) -> CrossSpectra:
        """Return the spectra of the samples added so far; more samples may follow.

        Raises
        ------
        InputError
            Fewer samples than one segment, or none that is usable.
        """
        self._require_segments()
        if self._n_held:
            with ThreadPoolExecutor(_WORKERS) as pool:
                self._add_products(pool)
        return self._spectra(np.asarray(self._sum * self._scale()[:, None, None], dtype=np.complex128))

    def finish(self) -> CrossSpectra:
        """Return the spectra, computed in the memory of the sums; nothing can be added afterwards.

        Raises
        ------
        InputError
            Fewer samples than one segment, or none that is usable.
        """
        self._require_segments()
        with ThreadPoolExecutor(_WORKERS) as pool:
            self._add_products(pool, self._scale())
        total, self._sum, self._lines = self._sum, np.empty((0, 0, 0), complex), np.empty((0, 0, 0), complex)
        return self._spectra(total)

    def _require_segments(self) -> None:
        if self.n_segments == 0 and self.n_excluded:
            raise InputError(
                f"all {self.n_excluded} segments hold overload, clipping or dropped samples; record again with a "
                "lower gain, or use shorter segments"
            )
        if self.n_segments == 0:
            raise InputError(
                f"record is shorter than one segment of {self.settings.segment_length} samples "
                f"({self.settings.segment_length / self.sample_rate:g} s); use shorter segments or a longer record"
            )

    def _scale(self) -> Real:
        # one-sided spectra hold the power of the negative frequencies too, which 0 Hz and Nyquist do not have
        scale = np.full(len(self._sum), 2.0)
        scale[0] = 1.0
        if self.settings.segment_length % 2 == 0:
            scale[-1] = 1.0
        return scale / (self.sample_rate * float(self._window @ self._window) * self.n_segments)

    def _spectra(self, mean: Complex) -> CrossSpectra:
        n = len(self.excitations)
        frequencies = np.fft.rfftfreq(self.settings.segment_length, 1 / self.sample_rate).astype(np.float64)
        _remove_delays(mean, frequencies, (*self.excitations, *self.responses))
        return CrossSpectra(
            frequencies,
            mean[:, :n, :n],
            mean[:, n:, :n],
            mean[:, n:, n:],
            self.excitations,
            self.responses,
            self.n_segments,
            effective_averages(self.settings, self.n_segments),
            self.settings,
            self.sample_rate,
            n_excluded=self.n_excluded,
        )


def _remove_delays(spectra: Complex, frequencies: Real, channels: Sequence[Channel]) -> None:
    """Correct the phases of spectra (n_lines, n, n), in place, for the input delays of the channels.

    The result is ``S_uv exp(2 pi i f (tau_u - tau_v))``, because a delay tau multiplies a channel's lines by
    ``exp(-2 pi i f tau)``.
    """
    delays = np.array([channel.input_delay_s or 0.0 for channel in channels])
    if np.ptp(delays) == 0:
        return
    rotation = np.exp(2j * np.pi * frequencies[:, None] * (delays - delays.min()))
    for row in range(len(channels)):  # row by row: no second array of this size
        spectra[:, row, :] *= rotation[:, row, None] * rotation.conj()


def _detrend(samples: Real, kind: str, out: Real) -> None:
    """Write samples without their mean or least-squares line along the last axis to ``out``."""
    if kind == "none":
        out[...] = samples
        return
    np.subtract(samples, samples.mean(axis=-1, keepdims=True), out=out)
    if kind == "linear":  # mean and slope are independent on a centred ramp
        ramp = np.arange(samples.shape[-1]) - (samples.shape[-1] - 1) / 2
        out -= ((out @ ramp) / float(ramp @ ramp))[..., None] * ramp
