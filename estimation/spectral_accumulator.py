"""`SpectralAccumulator`: Welch's averaged spectra, fed block by block, in memory that does not grow."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from acquisition import Channel
from foundation import InputError

from .cross_spectra import CrossSpectra, SpectralSettings
from .windows import check_settings, effective_averages, hop_length, window_samples

_BATCH_BYTES = 64 << 20  # of segments transformed at once


class SpectralAccumulator:
    """Sums windowed cross spectra over segments as samples arrive.

    ``S_uv[k] = 2 / (fs sum w^2) * mean over segments of U_k conj(V_k)``, one-sided; lines 0 and Nyquist are not
    doubled (Welch 1967; Bendat & Piersol, Random Data, 4th ed., section 11.5).

    Parameters
    ----------
    excitations, responses
        Channels along the columns of what ``add`` gets.
    sample_rate
        Hz.
    settings
        Segment length, overlap, window, detrending.

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
        self.n_segments = 0
        self._window = window_samples(settings)
        self._hop = hop_length(settings)
        width = len(self.excitations) + len(self.responses)
        self._sum = np.zeros((settings.segment_length // 2 + 1, width, width), dtype=complex)
        self._held = np.empty((width, 0))

    def add(self, excitation_samples: NDArray[np.floating], response_samples: NDArray[np.floating]) -> None:
        """Take the next samples, (n, n_excitations) and (n, n_responses), any number of them.

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
        fresh = np.empty((self._held.shape[0], n))
        fresh[: len(self.excitations)] = np.asarray(excitation_samples).T
        fresh[len(self.excitations) :] = np.asarray(response_samples).T
        if not np.isfinite(fresh.sum()):
            row = int(np.argmin(np.isfinite(fresh).all(axis=1)))
            name = (*self.excitations, *self.responses)[row].name
            raise InputError(f"channel {name} holds NaN or infinity; mend or convert the recording")
        samples = np.concatenate([self._held, fresh], axis=1) if self._held.shape[1] else fresh
        length = self.settings.segment_length
        n_new = max(0, (samples.shape[1] - length) // self._hop + 1) if samples.shape[1] >= length else 0
        batch = max(1, _BATCH_BYTES // (8 * length * len(samples)))
        for first in range(0, n_new, batch):
            self._add_segments(samples, first, min(first + batch, n_new))
        self._held = samples[:, n_new * self._hop :].copy()
        self.n_segments += n_new

    def _add_segments(self, samples: NDArray[np.float64], first: int, last: int) -> None:
        """Transform segments first..last-1 of the channel-major ``samples`` and add their products."""
        view = np.lib.stride_tricks.sliding_window_view(samples, self.settings.segment_length, axis=1)
        segments = view[:, first * self._hop : (last - 1) * self._hop + 1 : self._hop]
        lines = fft.rfft(_detrended(segments, self.settings.detrend) * self._window, axis=2, overwrite_x=True)
        by_line = np.ascontiguousarray(lines.transpose(2, 0, 1))
        self._sum += by_line @ by_line.conj().transpose(0, 2, 1)

    def result(self) -> CrossSpectra:
        """The spectra of what came so far.

        Raises
        ------
        InputError
            Fewer samples than one segment.
        """
        if self.n_segments == 0:
            raise InputError(
                f"record is shorter than one segment of {self.settings.segment_length} samples "
                f"({self.settings.segment_length / self.sample_rate:g} s); use shorter segments or a longer record"
            )
        scale = np.full(len(self._sum), 2.0)
        scale[0] = 1.0
        if self.settings.segment_length % 2 == 0:
            scale[-1] = 1.0
        scale /= self.sample_rate * float(self._window @ self._window) * self.n_segments
        mean = self._sum * scale[:, None, None]
        n = len(self.excitations)
        return CrossSpectra(
            frequencies=np.asarray(
                np.fft.rfftfreq(self.settings.segment_length, 1 / self.sample_rate), dtype=np.float64
            ),
            input_spectra=mean[:, :n, :n],
            cross_spectra=mean[:, n:, :n],
            output_spectra=mean[:, n:, n:],
            excitations=self.excitations,
            responses=self.responses,
            n_segments=self.n_segments,
            effective_averages=effective_averages(self.settings, self.n_segments),
            settings=self.settings,
            sample_rate=self.sample_rate,
        )


def _detrended(segments: NDArray[np.float64], kind: str) -> NDArray[np.float64]:
    """Take mean or least-squares line off the last axis."""
    if kind == "none":
        return segments
    centred = segments - segments.mean(axis=-1, keepdims=True)
    if kind == "constant":
        return np.asarray(centred)
    ramp = np.arange(segments.shape[-1]) - (segments.shape[-1] - 1) / 2
    slope = (centred @ ramp) / float(ramp @ ramp)
    return np.asarray(centred - slope[..., None] * ramp)
