"""Commands of the page's buttons to the recording: start, stop, mark."""

import threading
import time
from dataclasses import dataclass
from typing import Literal

import numpy as np

from acquisition import EventAxis, Events

MARKS = "mark"
"""Event series of the marks; their values count 1, 2, 3 ..., their texts are the user's notes."""

State = Literal["waiting", "recording", "stopping", "ended"]


@dataclass(frozen=True)
class Mark:
    """A moment that the user marked.

    Parameters
    ----------
    number, note
        Number of the mark, counted from 1, and the text that the user typed, possibly empty.
    host_time : s
        Host's monotonic time of the mark.
    shown_at : s
        Time since the start at which the page draws it.
    """

    number: int
    note: str
    host_time: float
    shown_at: float

    @property
    def label(self) -> str:
        """Its note, or its number."""
        return self.note or f"mark {self.number}"


class LiveControl:
    """Buttons on one side, the recording on the other; also the feed of marks.

    Parameters
    ----------
    series
        Name of the event series of the marks.

    A button counts only in the state in which it makes sense, however often it is pressed and from however many pages.
    """

    def __init__(self, series: str = MARKS) -> None:
        self._series = series
        self._lock = threading.Lock()
        self._state: State = "waiting"
        self._pending: list[Mark] = []
        self._marks: list[Mark] = []
        self.message = ""
        self.event_series: dict[str, EventAxis] = {series: EventAxis("host", texts=True)}

    @property
    def state(self) -> State:
        """waiting, recording, stopping or ended."""
        return self._state

    @property
    def marks(self) -> tuple[Mark, ...]:
        """Marks that were set so far."""
        return tuple(self._marks)

    def start(self) -> None:
        """Start to record."""
        with self._lock:
            if self._state == "waiting":
                self._state = "recording"

    def stop(self) -> None:
        """End the recording in order."""
        with self._lock:
            if self._state in ("waiting", "recording"):
                self._state = "stopping"

    def ended(self, message: str) -> None:
        """The file is closed; ``message`` is shown."""
        with self._lock:
            self._state, self.message = "ended", message

    def mark(self, note: str = "", shown_at: float = 0.0) -> None:
        """Mark this moment, with a note; ``shown_at`` is where the page draws it, s since the start."""
        with self._lock:
            if self._state == "recording":
                set_now = Mark(len(self._marks) + 1, note.strip(), time.monotonic(), shown_at)
                self._pending.append(set_now)
                self._marks.append(set_now)

    def open(self) -> None:
        """As a feed: nothing to do."""

    def poll(self) -> list[Events]:
        """As a feed: the marks since the last call."""
        with self._lock:
            marks, self._pending = self._pending, []
        if not marks:
            return []
        times = np.array([mark.host_time for mark in marks])
        numbers = np.array([float(mark.number) for mark in marks])
        return [Events(self._series, times, numbers, None, tuple(mark.note for mark in marks))]

    def close(self) -> None:
        """As a feed: nothing to do."""
