"""The common part of feeds with a receiving thread: connect, receive, hand over, release."""

import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Mapping

from .events import EventAxis, Events
from .receiver import Put, Receiver

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
