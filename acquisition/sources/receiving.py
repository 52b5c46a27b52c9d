"""Threads that receive events, so that none waits for samples or for the disk."""

import queue
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Mapping

from .source import EventAxis, Events

Put = Callable[[Events], None]


class Receiver:
    """Runs one loop in a thread; what it puts is fetched with `drain`, and what it raises is raised there.

    Parameters
    ----------
    name
        Name of the thread, for messages.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._queue: queue.SimpleQueue[Events] = queue.SimpleQueue()
        self._stop = threading.Event()
        self._error: BaseException | None = None
        self._thread: threading.Thread | None = None

    def start(self, loop: Callable[[Put, Callable[[], bool]], None]) -> None:
        """Run ``loop(put, stopped)`` until it returns; it must ask ``stopped()`` a few times a second."""
        self._stop.clear()
        self._error = None

        def run() -> None:
            try:
                loop(self._queue.put, self._stop.is_set)
            except BaseException as error:
                self._error = error

        self._thread = threading.Thread(target=run, name=self._name, daemon=True)
        self._thread.start()

    def drain(self) -> list[Events]:
        """Everything received since the last call, without waiting.

        Raises
        ------
        DeviceError
            Whatever ended the loop, after all that came before it was fetched.
        """
        taken = []
        while True:
            try:
                taken.append(self._queue.get_nowait())
            except queue.Empty:
                break
        if not taken and self._error is not None:
            raise self._error
        return taken

    def stop(self) -> None:
        """End the loop and wait for it; harmless when it does not run."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None


Note = tuple[float, str]


class ThreadedFeed(ABC):
    """A feed of events whose device is listened to by a thread of its own.

    Parameters
    ----------
    where
        The device, as messages and the thread name it.
    event_series
        The series it gives and the clock of each.
    """

    def __init__(self, where: str, event_series: Mapping[str, EventAxis]) -> None:
        self.where = where
        self.event_series: dict[str, EventAxis] = dict(event_series)
        self._receiver = Receiver(where)
        self._notes: deque[Note] = deque()

    @abstractmethod
    def _connect(self) -> None:
        """Open the device; raises DriverMissing or Disconnected."""

    @abstractmethod
    def _receive(self, put: Put, stopped: Callable[[], bool]) -> None:
        """Put events until stopped; raises what went wrong."""

    @abstractmethod
    def _release(self) -> None:
        """Close the device; harmless when not open."""

    def _reconnect(self) -> None:
        """Open the device again while a recording runs."""
        self._connect()

    def _let_go(self) -> None:
        """Release the device while a recording runs."""
        self._release()

    def open(self) -> None:
        """Open the device and start to receive.

        Raises
        ------
        DriverMissing, Disconnected, DeviceTimeout
        """
        self.close()
        self._connect()
        self._receiver.start(self._receive)

    def reopen(self) -> None:
        """Open a device that was lost, while the recording goes on.

        Raises
        ------
        DeviceError
            It is still not there.
        """
        self.drop()
        self._reconnect()
        self._receiver.start(self._receive)

    def drop(self) -> None:
        """Let go of a device that was lost, without a word to it."""
        self._receiver.stop()
        self._let_go()

    def poll(self) -> list[Events]:
        """Give the events since the last call.

        Raises
        ------
        Disconnected, DeviceTimeout
            The device is gone or silent.
        """
        return self._receiver.drain()

    def note(self, text: str, time_of_it: float | None = None) -> None:
        """Note something that the recording shall tell, at a host's monotonic time (s; None: now)."""
        self._notes.append((time.monotonic() if time_of_it is None else time_of_it, f"{self.where}: {text}"))

    def notes(self) -> list[Note]:
        """Give what was noted since the last call: host's time (s) and text."""
        taken = []
        while self._notes:
            taken.append(self._notes.popleft())
        return taken

    def conclude(self) -> None:
        """Receive no more, so that what was held back is given, and note what is worth telling of the recording."""
        self._receiver.stop()

    def close(self) -> None:
        """Stop to receive and release the device."""
        self._receiver.stop()
        self._release()
