"""`ThreadedFeed`: a device that is read by a thread of its own, within bounds of rate, memory and time to stop."""

import queue
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterable, Mapping

from ..settings import SETTINGS
from .source import Disconnected, EventAxis, Events


class Inflow:
    """Bound of the messages that a device may give: ``rate`` a second, in bursts of a second at most.

    Messages beyond it are counted in ``n_left_out``, so that a flood takes neither the processor nor the memory from
    the samples.

    Examples
    --------
    >>> inflow = Inflow(2.0)
    >>> [inflow.admits(at) for at in (0.0, 0.0, 0.0, 0.5)], inflow.n_left_out
    ([True, True, False, True], 1)
    """

    def __init__(self, rate: float = SETTINGS.messages_per_second) -> None:
        self._rate, self._room, self._last = rate, rate, -float("inf")
        self.n_left_out = 0

    def admits(self, arrival: float) -> bool:
        """Return whether a message that arrives at ``arrival`` (s) is within the bound; count it if it is not."""
        self._room = min(self._room + self._rate * max(arrival - self._last, 0.0), self._rate)
        self._last = arrival
        if self._room < 1:
            self.n_left_out += 1
            return False
        self._room -= 1
        return True


class ThreadedFeed(ABC):
    """Base class of feeds whose device is read by a separate thread, so that no event waits for samples or the disk.

    ``where`` names the device in messages; ``event_series`` gives the clock of each of its series. The thread runs
    `_receive`, which calls `_put` with each event and returns when `_stopped` is set; it must check this a few times a
    second. A thread that does not is left to itself: it delays the end of a recording by `SETTINGS.stop_time` at most.
    """

    def __init__(self, where: str, event_series: Mapping[str, EventAxis]) -> None:
        self.where = where
        self.event_series: dict[str, EventAxis] = dict(event_series)
        self._stopped = threading.Event()
        self._end_by = 0.0  # host's monotonic time until which the end of the thread is awaited
        self._queue: queue.Queue[Events] = queue.Queue(SETTINGS.queued_events)
        self._inflow = Inflow()
        self._n_not_taken = 0  # values for which the queue had no room
        self._n_unreadable = 0  # messages without a value, and requests without a proper answer
        self._notes: deque[tuple[float, str]] = deque(maxlen=SETTINGS.queued_notes)
        self._error: BaseException | None = None
        self._thread: threading.Thread | None = None

    @abstractmethod
    def _connect(self) -> None:
        """Open the device; raise DriverMissing or Disconnected."""

    @abstractmethod
    def _receive(self) -> None:
        """Receive and put events until stopped; raise an error of the device."""

    @abstractmethod
    def _release(self) -> None:
        """Close the device; do nothing if it is not open."""

    def _reconnect(self) -> None:
        """Open the device again while a recording runs."""
        self._connect()

    def _suspend(self) -> None:
        """Release a lost device while a recording runs."""
        self._release()

    def open(self) -> None:
        """Open the device and start receiving."""
        self.close()
        self._inflow, self._n_not_taken, self._n_unreadable = Inflow(), 0, 0
        self._connect()
        self._start()

    def reopen(self) -> None:
        """Open a lost device again while the recording goes on; raise a DeviceError if it is still lost."""
        self.drop()
        self._reconnect()
        self._start()

    def drop(self) -> None:
        """Release a lost device without sending anything to it."""
        self._end_thread()
        self._suspend()

    def close(self) -> None:
        self._end_thread()
        self._release()

    def request_end(self) -> None:
        """Let the thread end, without waiting for it."""
        if not self._stopped.is_set():
            self._stopped.set()
            self._end_by = time.monotonic() + SETTINGS.stop_time

    def conclude(self) -> None:
        """Stop receiving, release the held values, and add the notes on the complete recording."""
        self._end_thread()
        if self._thread is not None:
            self.note(f"its driver did not stop within {SETTINGS.stop_time:g} s; its last values may be missing")
        if self._inflow.n_left_out:
            rate = f"{SETTINGS.messages_per_second:g} a second"
            self.note(f"{self._inflow.n_left_out} messages left out, as more than {rate} came")
        if self._n_unreadable:
            self.note(f"{self._n_unreadable} messages without a value left out")
        if self._n_not_taken:
            self.note(f"{self._n_not_taken} values left out, as the recorder was too busy to take them")

    def _start(self) -> None:
        if self._thread is not None:
            raise Disconnected(f"{self.where}: its driver does not return from the last attempt; plug it in again")
        self._stopped.clear()
        self._error = None
        self._thread = threading.Thread(target=self._run, name=self.where, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            self._receive()
        except BaseException as error:
            self._error = error

    def _end_thread(self) -> None:
        self.request_end()
        if self._thread is not None:
            self._thread.join(max(self._end_by - time.monotonic(), 0.0))
            if not self._thread.is_alive():
                self._thread = None

    def _put(self, events: Iterable[Events]) -> None:
        for event in events:
            try:
                self._queue.put_nowait(event)
            except queue.Full:
                self._n_not_taken += len(event.values)

    def poll(self) -> list[Events]:
        """Return the events since the last call; after the last event, raise the error that ended the thread."""
        events = [self._queue.get_nowait() for _ in range(self._queue.qsize())]  # a flood must not keep the recorder
        if not events and self._error is not None:
            raise self._error
        return events

    def note(self, text: str, time_of_note: float | None = None) -> None:
        """Add a note for the log, at a host's monotonic time (s); None: now."""
        self._notes.append((time.monotonic() if time_of_note is None else time_of_note, f"{self.where}: {text}"))

    def notes(self) -> list[tuple[float, str]]:
        """Return the notes since the last call: host's monotonic time (s) and text."""
        return [self._notes.popleft() for _ in range(len(self._notes))]
