"""`ChatterWatch`: judges a cut while it is recorded; what it tells a page, a recording and listeners."""

import math
import threading
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition import Block, EventAxis, Events
from millfrf.stability import CHATTER, INCONCLUSIVE, JudgedCut, OnlineClassifier, StateChange, WatchedCut

from .background import Background
from .tests_of_session import SPEED_EVENTS

CHATTER_EVENTS = "chatter"  # event series; 1: chatter begins, 0: it is over or the verdict is open
_RPM = math.pi / 30


@dataclass(frozen=True)
class ShownState:
    """State of the cut in words."""

    state: str  # stable, hopf, period-doubling, undecided or idle
    line: str  # one sentence; may be empty


@dataclass(frozen=True)
class Announcement:
    """A change of the state of the cut, as people and machines read it."""

    time: float  # s, on the recording's time axis
    state: str  # stable, hopf, period-doubling, undecided or idle
    frequency: float  # Hz, of the chatter; NaN without
    spindle_speed_rpm: float  # found in the recording; the stated one where none was found
    proposed_rpm: tuple[float, ...]  # speeds to try, see :meth:`.JudgedCut.proposed_rpm`
    reason: str
    p_value: float  # see `ChatterVerdict`; 1 while idle
    side_line: float = math.nan  # Hz; another frequency that may be the chatter's own, see `ChatterVerdict`

    @property
    def in_words(self) -> str:
        """Return state, frequency and what to try."""
        words = self.state if math.isnan(self.frequency) else f"{self.state} chatter at {self.frequency:.0f} Hz"
        if math.isfinite(self.side_line):
            words += f" or {self.side_line:.0f} Hz (one of them is a side line)"
        if self.proposed_rpm:
            words += f"; try {' or '.join(f'{rpm:.0f}' for rpm in self.proposed_rpm)} rpm"
        return words if self.state in (*CHATTER, "idle", "stable") else f"{words}: {self.reason}"


class ChatterWatch:
    """A watcher for `record`, and the feed of its marks: it judges the cut in a thread of its own.

    Parameters
    ----------
    stream
        Name of the stream.
    start_time : s
        Time of the stream's first sample on the recording's axis.
    columns
        Columns of the channels that are judged.
    cut
        What is known about the cut.
    announce
        Called with each announcement, in the watch's thread.
    series
        Name of the event series of its marks.
    waits
        Whether samples wait for the judgement; a recording's samples must not.
    """

    def __init__(
        self,
        stream: str,
        start_time: float,
        columns: tuple[int, ...],
        cut: WatchedCut,
        announce: Callable[[Announcement], None],
        *,
        series: str = CHATTER_EVENTS,
        waits: bool = False,
    ) -> None:
        self.cut = cut
        self.counts: Counter[str] = Counter()  # number of windows by verdict
        self.event_series: dict[str, EventAxis] = {series: EventAxis("samples", texts=True)}
        self._series = series
        self._stream, self._start_time, self._columns, self._announce = stream, start_time, list(columns), announce
        self._n_samples = 0
        self._classifier = OnlineClassifier(cut)
        self._last: Announcement | None = None
        self.open_reason = ""  # why the newest window that was not judged was not
        self._pending: list[Announcement] = []
        self._pending_lock = threading.Lock()
        self._speed: float | None = None  # rad/s, newest of the device
        self._background = Background(stream, self._process, "chatter watch", waits=waits)

    @property
    def shown(self) -> ShownState:
        """State of the cut now, for a page."""
        if self.error is not None:
            return ShownState("undecided", f"the cut is no longer judged: {self.error}")
        if self._last is None:
            return ShownState("undecided", f"not judged yet: {self.open_reason}" if self.open_reason else "")
        return ShownState(self._last.state, self._last.in_words)

    @property
    def n_skipped(self) -> int:
        """Number of blocks that were recorded but not judged."""
        return self._background.n_skipped

    @property
    def announced_nothing(self) -> bool:
        """Check whether the cut was never stable, chattering or idle for long enough to say so."""
        return self._last is None

    @property
    def error(self) -> Exception | None:
        """Error that ended the judgement; None while there is none."""
        return self._background.error

    @property
    def seconds(self) -> float:
        """Duration of the stream up to the newest block, s."""
        return self._n_samples / self.cut.sample_rate

    def __call__(self, item: Block | Events) -> None:
        """Take a block, or the spindle's speed."""
        if isinstance(item, Events) and item.series == SPEED_EVENTS and len(item.values):
            self._speed = abs(float(item.values[-1])) * _RPM or None  # a spindle at rest cuts nothing
        if isinstance(item, Block) and item.stream == self._stream:
            self._n_samples = item.first_sample + len(item.samples)
        self._background(item)

    def _process(self, block: Block, gap: bool) -> None:
        if self._speed is not None:
            self._classifier.set_speed(self._speed)
        if gap:
            self._classifier.forget(block.first_sample)
        for change in self._classifier.add(block.samples[:, self._columns]):
            self._take(change)
        for window in self._classifier.judged():
            self.counts[window.kind] += 1
            if window.kind == INCONCLUSIVE and window.verdict is not None:
                self.open_reason = window.verdict.reason

    def _take(self, change: StateChange) -> None:
        announcement = self._announced(change)
        with self._pending_lock:
            self._pending.append(announcement)
        self._last = announcement
        self._announce(announcement)

    def _announced(self, change: StateChange) -> Announcement:
        time = self._start_time + change.time
        verdict = change.verdict
        stated = self._classifier.stated_speed / _RPM
        if verdict is None:
            return Announcement(time, change.state, math.nan, stated, (), "", 1.0)
        cut = JudgedCut("", stated, verdict)
        return Announcement(
            time,
            change.state,
            verdict.frequency,
            cut.rpm,
            cut.proposed_rpm(self.cut.teeth),
            verdict.reason,
            verdict.p_value,
            verdict.side_line,
        )

    def open(self) -> None:
        """Do nothing; part of the interface of a feed."""

    def poll(self) -> list[Events]:
        """Return the beginnings and ends of chatter since the last call."""
        with self._pending_lock:
            pending, self._pending = self._pending, []
        if not pending:
            return []
        values: NDArray[np.float64] = np.array([float(item.state in CHATTER) for item in pending])
        texts = tuple(item.in_words for item in pending)
        return [Events(self._series, np.array([item.time for item in pending]), values, None, texts)]

    def finish(self) -> None:
        """Judge the samples that still wait."""
        self._background.finish()

    def close(self) -> None:
        """Stop the thread."""
        self._background.close()
