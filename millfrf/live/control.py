"""Buttons of the page: start, stop, mark."""

import threading
import time
from dataclasses import dataclass
from typing import Literal

import numpy as np

from acquisition import EventAxis, Events

MARKS = "mark"  # event series; values count 1, 2, 3 ..., texts are the notes of the user

State = Literal["waiting", "recording", "stopping", "ended"]


@dataclass(frozen=True)
class Mark:
    """Time marked by the user."""

    number: int  # from 1
    note: str  # text of the user, may be empty
    host_time: float  # s; monotonic time of the host
    shown_at: float  # s since the start; position on the page

    @property
    def label(self) -> str:
        """Note, or number without a note."""
        return self.note or f"mark {self.number}"


class LiveControl:
    """State that buttons and recording share; also the feed of marks."""

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
        return tuple(self._marks)

    def start(self) -> None:
        """Start to record."""
        with self._lock:
            if self._state == "waiting":
                self._state = "recording"

    def stop(self) -> None:
        """Request to end the recording."""
        with self._lock:
            if self._state in ("waiting", "recording"):
                self._state = "stopping"

    def ended(self, message: str) -> None:
        """Set the state after the file is closed; ``message`` is shown."""
        with self._lock:
            self._state, self.message = "ended", message

    def mark(self, note: str = "", shown_at: float = 0.0) -> None:
        """Add a mark at the current time; ``shown_at`` is its position on the page, s since the start."""
        with self._lock:
            if self._state == "recording":
                mark = Mark(len(self._marks) + 1, note.strip(), time.monotonic(), shown_at)
                self._pending.append(mark)
                self._marks.append(mark)

    def open(self) -> None:
        """Do nothing; part of the interface of a feed."""

    def poll(self) -> list[Events]:
        """Return the marks since the last call."""
        with self._lock:
            marks, self._pending = self._pending, []
        if not marks:
            return []
        times = np.array([mark.host_time for mark in marks])
        numbers = np.array([float(mark.number) for mark in marks])
        return [Events(self._series, times, numbers, None, tuple(mark.note for mark in marks))]

    def close(self) -> None:
        """Do nothing; part of the interface of a feed."""
