"""What the page's buttons say to the recording: start, stop, mark."""

import threading
import time
from typing import Literal

import numpy as np

from acquisition import HOST_AXIS, EventAxis, Events

MARKS = "mark"
"""Event series of the marks; their values count 1, 2, 3 ..."""

State = Literal["waiting", "recording", "stopping", "ended"]


class LiveControl:
    """Buttons on one side, the recording on the other; also the feed of marks.

    A button counts only in the state in which it makes sense, however often it is pressed and from however many pages.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._state: State = "waiting"
        self._pending: list[float] = []
        self._n_marks = 0
        self.message = ""
        self.event_series: dict[str, EventAxis] = {MARKS: HOST_AXIS}

    @property
    def state(self) -> State:
        """waiting, recording, stopping or ended."""
        return self._state

    @property
    def n_marks(self) -> int:
        """Marks so far."""
        return self._n_marks

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

    def mark(self) -> None:
        """Mark this moment."""
        with self._lock:
            if self._state == "recording":
                self._pending.append(time.monotonic())
                self._n_marks += 1

    def open(self) -> None:
        """As a feed: nothing to do."""

    def poll(self) -> list[Events]:
        """As a feed: the marks since the last call."""
        with self._lock:
            times, self._pending = self._pending, []
            first = self._n_marks - len(times) + 1
        if not times:
            return []
        return [Events(MARKS, np.array(times), np.arange(first, first + len(times), dtype=float))]

    def close(self) -> None:
        """As a feed: nothing to do."""
