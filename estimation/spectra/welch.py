"""Welch's averaged spectra of samples that arrive block by block, in constant memory."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import scipy
from numpy.typing import NDArray

from acquisition import Channel
from millfrf.core import Complex, InputError, Real

from .cross_spectra import (
    CrossSpectra,
    SpectralSettings,
    check_settings,
    count_segments,
    effective_averages,
    hop_length,
    window_samples,
)

_WORKERS = 2
_PRODUCT_BYTES = 1 << 20  # size of the products computed at once: they stay in the processor's cache


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
        width = len(self.excitations) + len(self.responses)
        # segments transformed at once: 20 MB at most, so that memory does not grow with the recording
        self._batch = max(1, min(16, (20 << 20) // (8 * settings.segment_length * width)))
        self._sum = np.zeros((settings.segment_length // 2 + 1, width, width), dtype=complex)
        self._waiting = np.empty((width, 0))
        self._waiting_usable = np.empty(0, dtype=bool)

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
        new = np.empty((len(self._waiting), n))
        new[: len(self.excitations)] = np.asarray(excitation_samples).T
        new[len(self.excitations) :] = np.asarray(response_samples).T
        if usable is not None:
            new[:, ~usable] = 0.0  # they may be NaN, which is refused below; their segments are left out
        if not np.isfinite(new.sum()):  # one value that is not finite makes the sum so
            row = int(np.argmin(np.isfinite(new).all(axis=1)))
            name = (*self.excitations, *self.responses)[row].name
            raise InputError(f"channel {name} holds NaN or infinity; correct or convert the recording")
        self._waiting = np.concatenate([self._waiting, new], axis=1) if self._waiting.shape[1] else new
        self._waiting_usable = np.concatenate([self._waiting_usable, np.ones(n, bool) if usable is None else usable])
        complete = count_segments(self._waiting.shape[1], self.settings)
        # only whole batches: the sums are read and written once per batch
        self._add_segments(complete - complete % self._batch)

    def _add_segments(self, n_segments: int) -> None:
        """Add the first segments of the waiting samples, batch by batch, and drop the samples that are done."""
        for first in range(0, n_segments, self._batch):
            self._add_batch(first, min(first + self._batch, n_segments))
        self._waiting = self._waiting[:, n_segments * self._hop :].copy()
        self._waiting_usable = self._waiting_usable[n_segments * self._hop :]

    def _add_batch(self, first: int, last: int) -> None:
        """Transform the waiting segments ``first`` to before ``last``, and add the products of the usable ones."""
        starts = slice(first * self._hop, (last - 1) * self._hop + 1, self._hop)
        length = self.settings.segment_length
        segments = np.lib.stride_tricks.sliding_window_view(self._waiting, length, axis=1)[:, starts]
        if not self._waiting_usable.all():
            usable = np.lib.stride_tricks.sliding_window_view(self._waiting_usable, length)[starts]
            segments = segments[:, usable.all(axis=1)]
        self.n_segments += segments.shape[1]
        self.n_excluded += last - first - segments.shape[1]
        if segments.shape[1] == 0:
            return
        windowed = _detrended(segments, self.settings.detrend)
        windowed *= self._window
        step = max(1, _PRODUCT_BYTES // (16 * len(windowed) ** 2))

        def add_products(start: int) -> None:
            values = np.empty((min(step, len(self._sum) - start), *windowed.shape[:2]), dtype=complex)
            for row, channel in enumerate(lines):
                values[:, row] = channel[:, start : start + step].T
            self._sum[start : start + step] += values @ values.conj().transpose(0, 2, 1)

        with ThreadPoolExecutor(_WORKERS) as pool:  # threads, because transforms and products release the GIL
            lines = list(pool.map(_transformed, windowed))
            list(pool.map(add_products, range(0, len(self._sum), step)))

    def result(self) -> CrossSpectra:
        """Return the spectra of the samples added so far; more samples may follow.

        Raises
        ------
        InputError
            Fewer samples than one segment, or none that is usable.
        """
        self._add_remainder()
        return self._spectra(np.asarray(self._sum * self._scale(len(self._sum))[:, None, None], dtype=np.complex128))

    def finish(self) -> CrossSpectra:
        """Return the spectra, computed in the memory of the sums; nothing can be added afterwards.

        Raises
        ------
        InputError
            Fewer samples than one segment, or none that is usable.
        """
        self._add_remainder()
        total, self._sum = self._sum, np.empty((0, 0, 0), dtype=complex)
        scale = self._scale(len(total))
        step = max(1, _PRODUCT_BYTES // (16 * max(1, total.shape[1]) ** 2))
        for start in range(0, len(total), step):  # in steps, so that no second array of this size is made
            total[start : start + step] *= scale[start : start + step, None, None]
        return self._spectra(total)

    def _add_remainder(self) -> None:
        """Add the complete segments that wait for their batch to fill."""
        self._add_segments(count_segments(self._waiting.shape[1], self.settings))
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

    def _scale(self, n_lines: int) -> Real:
        # one-sided spectra hold the power of the negative frequencies too, which 0 Hz and Nyquist do not have
        scale = np.full(n_lines, 2.0)
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


def _transformed(segments: Real) -> Complex:
    """Transform the segments of one channel in the calling thread.

    scipy's own threads (``workers``) are not used: they end before each fork of the process, and a fork that meets
    their start never returns.
    """
    return np.asarray(scipy.fft.rfft(segments, axis=1, overwrite_x=True))


def _detrended(segments: Real, kind: str) -> Real:
    """Return a copy of the segments without their mean or least-squares line along the last axis."""
    if kind == "none":
        return segments.copy()
    centred: Real = segments - segments.mean(axis=-1, keepdims=True)
    if kind == "constant":
        return centred
    # least-squares line: mean and slope are independent on a centred ramp
    ramp = np.arange(segments.shape[-1]) - (segments.shape[-1] - 1) / 2
    centred -= ((centred @ ramp) / float(ramp @ ramp))[..., None] * ramp
    return centred
