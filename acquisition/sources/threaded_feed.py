"""The common part of feeds with a receiving thread: connect, receive, hand over, release."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping

from .events import EventAxis, Events
from .receiver import Put, Receiver


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
        self._where = where
        self.event_series: dict[str, EventAxis] = dict(event_series)
        self._receiver = Receiver(where)

    @abstractmethod
    def _connect(self) -> None:
        """Open the device; raises DriverMissing or Disconnected."""

    @abstractmethod
    def _receive(self, put: Put, stopped: Callable[[], bool]) -> None:
        """Put events until stopped; raises what went wrong."""

    @abstractmethod
    def _release(self) -> None:
        """Close the device; harmless when not open."""

    def open(self) -> None:
        """Open the device and start to receive.

        Raises
        ------
        DriverMissing, Disconnected
        """
        self.close()
        self._connect()
        self._receiver.start(self._receive)

    def poll(self) -> list[Events]:
        """Give the events since the last call.

        Raises
        ------
        Disconnected, DeviceTimeout
            The device is gone or silent.
        """
        return self._receiver.drain()

    def close(self) -> None:
        """Stop to receive and release the device."""
        self._receiver.stop()
        self._release()
