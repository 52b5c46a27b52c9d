"""`LiveMonitor`: takes every block without holding the recording up, and says what a page shall draw."""

import queue
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition import Block, Channel, Events, StreamDescription
from estimation import Frf
from millfrf.core import InputError, Real

from .spectra import BandProgress, GrownSpectra, LiveSpectra, StackedFrf, TraceBuffer, band_progress, stack
from .standing import SessionTests, Standing
from .tests_of_session import SPEED_EVENTS, MilledSpeeds, SetUp

_WAITING = 64
_OVERLOAD = 0.999
_FINISHING = 2.0  # s


@dataclass(frozen=True)
class LiveSettings:
    """Settings of what the live page estimates.

    Parameters
    ----------
    band : Hz
        Lowest and highest frequency; None: up to 2 kHz or what the sample rate allows.
    judged_band : Hz
        Band in which progress is told; None: the same.
    segment : s
        Duration of a segment.
    relative_error, absolute_error
        Wanted standard deviation of the FRF, see :func:`millfrf.live.spectra.band_progress`.
    n_bands
        Number of bands for which progress is told.
    teeth
        Number of teeth of the cutter; 0: unknown, no tooth-passing line.
    spindle_speed_rpm : rpm
        Planned spindle speed; a device's speed replaces it.
    """

    band: tuple[float, float] | None = None
    segment: float = 1.0
    relative_error: float = 0.1
    absolute_error: float | None = None
    n_bands: int = 8
    teeth: int = 0
    spindle_speed_rpm: float = 0.0
    judged_band: tuple[float, float] | None = None


@dataclass(frozen=True)
class Snapshot:
    """State of the live page: everything it draws at one moment.

    Parameters
    ----------
    seconds, n_samples
        Time (s) and number of samples of the stream since the start.
    times : (n,), s
        Times of the traces.
    traces : (n, n_channels)
        Samples of the traces, in the channels' units.
    peaks, overloads : (n_channels,)
        Largest magnitude of the last second, in the channel's unit; samples at full scale since the start.
    spectra
        Spectra so far; None until a segment is full.
    frf, known : FRF and (n_lines,), bool
        FRF of all tests together, and the lines on which it says something; without FRF `why_no_frf` says why.
    bands
        Progress of each band of frequencies.
    tooth_passing : Hz
        Tooth-passing frequency; 0: unknown.
    standing, notes
        How far the session is, and what else is to be said of it; None and nothing without a session.
    n_skipped
        Number of blocks that were recorded but not drawn, because the page did not keep up.
    """

    seconds: float
    n_samples: int
    times: Real
    traces: Real
    peaks: Real
    overloads: Real
    spectra: GrownSpectra | None
    frf: Frf | None
    known: NDArray[np.bool_]
    why_no_frf: str
    bands: tuple[BandProgress, ...]
    tooth_passing: float
    standing: Standing | None
    notes: tuple[str, ...]
    n_skipped: int


class LiveMonitor:
    """A watcher for `record`: blocks go into a short queue, a thread of its own works them off.

    Parameters
    ----------
    streams
        Streams of the source; the one with most channels is shown.
    settings
        Settings of what is estimated.
    session
        Tests of the session, which are stacked with the running one; None: it stands alone.
    """

    def __init__(
        self, streams: Sequence[StreamDescription], settings: LiveSettings, session: SessionTests | None = None
    ) -> None:
        self.stream = max(streams, key=lambda stream: len(stream.channels))
        self.settings, self.session = settings, session
        rate = self.stream.sample_rate
        low, high = settings.band or (0.0, 2000.0)
        self.band = (low, min(high, 0.4 * rate))
        self.judged_band = settings.judged_band or self.band
        if session is not None:
            session.read(SetUp(self.stream, session.setup, self.band[1], settings.segment))
        self._queue: queue.Queue[Block] = queue.Queue(_WAITING)
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._gap = False
        self._speed_rpm = settings.spindle_speed_rpm
        self.n_skipped = 0
        self._recording = self._ended = False
        self._begin()
        self._thread = threading.Thread(target=self._run, name="live monitor", daemon=True)
        self._thread.start()

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Channels that are shown."""
        return self.stream.channels

    @property
    def seconds(self) -> float:
        """Time of the stream since the start, as far as it is drawn, s."""
        return self._n_samples / self.stream.sample_rate

    def _begin(self) -> None:
        n = len(self.channels)
        self._traces = TraceBuffer(n, self.stream.sample_rate)
        self._recent: list[tuple[float, Real]] = []
        self._overloads = np.zeros(n)
        self._n_samples = 0
        self._spectra = self._fresh_spectra()
        self._grown: GrownSpectra | None = None
        self._stacked: StackedFrf | None = None
        self._bands = self._judged(None)
        self._standing: Standing | None = None
        self._speeds = MilledSpeeds()

    def _fresh_spectra(self) -> LiveSpectra | None:
        try:
            return LiveSpectra(self.channels, self.stream.sample_rate, self.band[1], self.settings.segment)
        except InputError:
            return None

    def forget(self) -> None:
        """Forget everything drawn so far."""
        with self._lock:
            while not self._queue.empty():
                self._queue.get_nowait()
                self._queue.task_done()
            self._begin()

    def restart(self) -> None:
        """Forget everything drawn so far: the recording proper begins."""
        self.forget()
        self._recording = True

    def __call__(self, taken: Block | Events) -> None:
        """Take a block or event; never waits."""
        if isinstance(taken, Events):
            if taken.series == SPEED_EVENTS and len(taken.values):
                self._speed_rpm = float(taken.values[-1])
                self._speeds.add(taken.values)
            return
        if taken.stream != self.stream.name:
            return
        try:
            self._queue.put_nowait(taken)
        except queue.Full:
            self.n_skipped += 1
            self._gap = True

    def _run(self) -> None:
        estimated = time.monotonic()
        while not self._stop.is_set():
            try:
                block = self._queue.get(timeout=0.2)
            except queue.Empty:
                continue
            with self._lock:
                self._add(block)
                self._queue.task_done()
                if time.monotonic() - estimated > 1.0 and self._spectra is not None:
                    self._estimate(self._spectra)
                    estimated = time.monotonic()

    def _estimate(self, spectra: LiveSpectra) -> None:
        """Stack what came so far with the tests before; while nothing is recorded yet, those tests alone."""
        self._grown = spectra.grown()
        mine = None if self._grown is None else self._grown.cross
        before = [] if self.session is None or self.session.total is None else [self.session.total]
        stacked = [*before, *([mine] if mine and (self._recording or not before) else [])]
        self._stacked = stack(stacked) if stacked else None
        self._bands = self._judged(self._stacked)
        if self.session is not None:
            now = self.session.running(mine, self.seconds, self._speeds) if self._recording else None
            known = self._stacked is not None and self._stacked.frf is not None
            self._standing = self.session.standing(now, self._ended, self._bands, known)

    def finish(self) -> None:
        """Work off what waits, and judge all of it: the recording has ended."""
        latest = time.monotonic() + _FINISHING
        while self._queue.unfinished_tasks and time.monotonic() < latest:
            time.sleep(0.02)
        with self._lock:
            self._ended = True
            if self._spectra is not None:
                self._estimate(self._spectra)

    def _add(self, block: Block) -> None:
        samples = block.samples
        self._n_samples = block.first_sample + len(samples)
        self._traces.add(samples)
        now = time.monotonic()
        self._recent = [entry for entry in self._recent if now - entry[0] < 1.0]
        size = np.nan_to_num(np.abs(samples).max(axis=0))
        self._recent.append((now, size))
        limits = np.array([channel.full_scale or np.inf for channel in self.channels]) * _OVERLOAD
        if (size >= limits).any():
            self._overloads += np.sum(np.abs(samples) >= limits, axis=0)
        if self._gap:  # segments must not reach over samples that were not seen
            self._gap, self._spectra = False, self._fresh_spectra()
        if self._spectra is not None:
            try:
                self._spectra.add(samples)
            except InputError:  # a sample that is no number: the segments begin anew behind it
                self._gap = True

    def _judged(self, stacked: StackedFrf | None) -> tuple[BandProgress, ...]:
        s = self.settings
        frf, known = (None, None) if stacked is None else (stacked.frf, stacked.known)
        return band_progress(
            frf, self.judged_band, s.n_bands, known=known, relative=s.relative_error, absolute=s.absolute_error
        )

    def snapshot(self) -> Snapshot:
        """Give the state that a page draws now."""
        with self._lock:
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
                self.n_skipped,
            )

    def _why_no_frf(self) -> str:
        if self._stacked is None:
            return "no spectra yet"
        return "" if self._stacked.frf is not None else "the forces are not independent yet"

    def close(self) -> None:
        """End the thread."""
        self._stop.set()
        if self.session is not None:
            self.session.close()
        self._thread.join()
