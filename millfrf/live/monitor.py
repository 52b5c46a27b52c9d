"""`LiveMonitor`: estimates in the background what the live page draws, without delaying the recording."""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition import Block, Channel, Events, StreamDescription
from estimation import Frf
from millfrf.core import InputError, Real

from .background import Background
from .chatter_watch import ChatterWatch, ShownState
from .spectra import BandProgress, GrownSpectra, LiveSpectra, StackedFrf, TraceBuffer, band_progress, stack
from .standing import SessionTests, Standing
from .tests_of_session import SPEED_EVENTS, MilledSpeeds, SetUp

_OVERLOAD = 0.999  # share of full scale from which a sample is overloaded
_LAST_ESTIMATE = 2.0  # s; longest wait for the estimates of the last samples, which are drawn and not recorded


@dataclass(frozen=True)
class LiveSettings:
    """Settings of the estimates on the live page."""

    band: tuple[float, float] | None = None  # Hz; None: up to 2 kHz or as high as the sample rate allows
    segment: float = 1.0  # s; duration of a segment
    relative_error: float = 0.1  # planned error of the FRF, see :func:`.spectra.band_progress`
    absolute_error: float | None = None
    n_bands: int = 8  # number of bands for which progress is shown
    teeth: int = 0  # number of teeth of the cutter; 0: unknown, no tooth-passing line
    spindle_speed_rpm: float = 0.0  # rpm; planned spindle speed; a device's speed replaces it
    judged_band: tuple[float, float] | None = None  # Hz; band of the progress; None: ``band``


@dataclass(frozen=True)
class Snapshot:
    """All data that the live page draws at one moment."""

    seconds: float  # s since the start of the stream
    n_samples: int  # since the start of the stream
    times: Real  # (n,), s; times of the traces
    traces: Real  # (n, n_channels); in the units of the channels
    peaks: Real  # (n_channels,); largest magnitude of the last second
    overloads: Real  # (n_channels,); number of samples at full scale since the start
    spectra: GrownSpectra | None  # None until the first segment is complete
    frf: Frf | None  # of all tests together
    known: NDArray[np.bool_]  # (n_lines,); lines on which the FRF is known
    why_no_frf: str
    bands: tuple[BandProgress, ...]
    tooth_passing: float  # Hz; 0: unknown
    standing: Standing | None  # progress of the session; None: no session
    notes: tuple[str, ...]  # on the session
    n_skipped: int  # blocks that were recorded but not drawn, because the page was too slow
    chatter: ShownState | None  # state of the cut; None: it is not judged


class LiveMonitor:
    """A watcher for `record`: a background thread estimates what is drawn, and ``chatter`` judges the cut."""

    def __init__(
        self,
        streams: Sequence[StreamDescription],
        settings: LiveSettings,
        session: SessionTests | None = None,
        chatter: ChatterWatch | None = None,
    ) -> None:
        self.stream = max(streams, key=lambda stream: len(stream.channels))
        self.settings, self.session, self._chatter = settings, session, chatter
        rate = self.stream.sample_rate
        low, high = settings.band or (0.0, 2000.0)
        self.band = (low, min(high, 0.4 * rate))
        self.judged_band = settings.judged_band or self.band
        if session is not None:
            session.read(SetUp(self.stream, session.setup, self.band[1], settings.segment))
        self._speed_rpm = settings.spindle_speed_rpm
        self._recording = self._ended = False
        self._estimated = time.monotonic()
        self._begin()
        self._background = Background(self.stream.name, self._process, "live monitor")

    @property
    def channels(self) -> tuple[Channel, ...]:
        return self.stream.channels

    @property
    def seconds(self) -> float:
        """Time since the start of the stream up to the last drawn sample, s."""
        return self._n_samples / self.stream.sample_rate

    def _begin(self) -> None:
        n = len(self.channels)
        self._traces = TraceBuffer(n, self.stream.sample_rate)
        self._recent: list[tuple[float, Real]] = []
        self._overloads = np.zeros(n)
        self._n_samples = 0
        self._spectra = self._new_spectra()
        self._grown: GrownSpectra | None = None
        self._stacked: StackedFrf | None = None
        self._bands = self._progress(None)
        self._standing: Standing | None = None
        self._speeds = MilledSpeeds()

    def _new_spectra(self) -> LiveSpectra | None:
        try:
            return LiveSpectra(self.channels, self.stream.sample_rate, self.band[1], self.settings.segment)
        except InputError:
            return None

    def forget(self) -> None:
        """Clear all data."""
        with self._background.lock:
            self._background.clear()
            self._begin()

    def restart(self) -> None:
        """Clear all data at the start of the recording."""
        self.forget()
        self._recording = True

    def __call__(self, item: Block | Events) -> None:
        """Put a block into the queue without waiting, and take the spindle's speed."""
        if isinstance(item, Events) and item.series == SPEED_EVENTS and len(item.values):
            self._speed_rpm = float(item.values[-1])
            self._speeds.add(item.values)
        self._background(item)

    def _process(self, block: Block, gap: bool) -> None:
        if gap:  # a segment must not span skipped samples
            self._spectra = self._new_spectra()
        self._add(block)
        if time.monotonic() - self._estimated > 1.0 and self._spectra is not None:
            self._estimate(self._spectra)
            self._estimated = time.monotonic()

    def _estimate(self, spectra: LiveSpectra) -> None:
        """Estimate the FRF of this test and earlier tests; before the recording starts, use only earlier tests."""
        self._grown = spectra.grown()
        own = None if self._grown is None else self._grown.cross
        earlier = [] if self.session is None or self.session.total is None else [self.session.total]
        stacked = [*earlier, *([own] if own and (self._recording or not earlier) else [])]
        self._stacked = stack(stacked) if stacked else None
        self._bands = self._progress(self._stacked)
        if self.session is not None:
            running = self.session.running(own, self.seconds, self._speeds) if self._recording else None
            known = self._stacked is not None and self._stacked.frf is not None
            self._standing = self.session.standing(running, self._ended, self._bands, known)

    def finish(self) -> None:
        """Process the rest of the queue and update the estimates after the end of the recording."""
        self._background.finish(_LAST_ESTIMATE)
        with self._background.lock:
            self._ended = True
            if self._spectra is not None:
                self._estimate(self._spectra)

    def _add(self, block: Block) -> None:
        samples = block.samples
        self._n_samples = block.first_sample + len(samples)
        self._traces.add(samples)
        now = time.monotonic()
        self._recent = [entry for entry in self._recent if now - entry[0] < 1.0]
        peak = np.nan_to_num(np.abs(samples).max(axis=0))
        self._recent.append((now, peak))
        limits = np.array([channel.full_scale or np.inf for channel in self.channels]) * _OVERLOAD
        if (peak >= limits).any():
            self._overloads += np.sum(np.abs(samples) >= limits, axis=0)
        if self._spectra is not None:
            try:
                self._spectra.add(samples)
            except InputError:  # a sample is NaN: start new segments after it
                self._spectra = self._new_spectra()

    def _progress(self, stacked: StackedFrf | None) -> tuple[BandProgress, ...]:
        s = self.settings
        frf, known = (None, None) if stacked is None else (stacked.frf, stacked.known)
        return band_progress(
            frf, self.judged_band, s.n_bands, known=known, relative=s.relative_error, absolute=s.absolute_error
        )

    def snapshot(self) -> Snapshot:
        """Return the data that a page draws now."""
        with self._background.lock:
            times, traces = self._traces.drawn()
            peaks = np.max([size for _, size in self._recent], axis=0) if self._recent else 0 * self._overloads
            return Snapshot(
                self.seconds,
                self._n_samples,
                times,
                traces,
                peaks,
                self._overloads.copy(),
                self._grown,
                None if self._stacked is None else self._stacked.frf,
                np.zeros(0, dtype=bool) if self._stacked is None else self._stacked.known,
                self._why_no_frf(),
                self._bands,
                self.settings.teeth * self._speed_rpm / 60,
                self._standing,
                () if self.session is None else self.session.notes,
                self._background.n_skipped,
                None if self._chatter is None else self._chatter.shown,
            )

    def _why_no_frf(self) -> str:
        if self._stacked is None:
            return "no spectra yet"
        return "" if self._stacked.frf is not None else "the forces are not independent yet"

    def close(self) -> None:
        """Stop the threads."""
        if self.session is not None:
            self.session.close()
        self._background.close()
