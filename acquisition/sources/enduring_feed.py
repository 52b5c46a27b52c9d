"""An auxiliary device that never ends a recording: its loss is logged, and it is tried again until the end."""

import threading
import time
from contextlib import suppress

from foundation import MillfrfError

from ..errors import DeviceTimeout
from .device_log import BACK, DEVICES, LOST, NOTE, device_event
from .event_feed import EventFeed, TellsNotes
from .events import Events

RETRY = 1.0
"""s between two attempts to bring a device back."""


class EnduringFeed:
    """A feed that gives the events of another one, and the log of its losses instead of its errors.

    Opening it is strict: what is missing before the cut is told before the cut.

    Parameters
    ----------
    feed
        The auxiliary device.
    log
        Name of the event series of the log.
    retry : s
        Time between two attempts to bring it back.
    """

    def __init__(self, feed: EventFeed, log: str = DEVICES, retry: float = RETRY) -> None:
        self._feed, self._log, self._retry = feed, log, retry
        self.where = str(getattr(feed, "where", type(feed).__name__))
        self._stop = threading.Event()
        self._returning: threading.Thread | None = None
        self._lost_at: float | None = None
        self._is_open = False

    def open(self) -> None:
        """Open the device.

        Raises
        ------
        DeviceError, InputError
            It is not there or not as it should be.
        """
        self._stop.clear()
        self._lost_at = None
        self._feed.open()
        self._is_open = True

    def poll(self) -> list[Events]:
        """Give the events since the last call and what there is to log; never waits and never fails."""
        if not self._is_open:
            return self._logged([])
        taken: list[Events] = []
        try:
            taken = self._feed.poll()
        except Exception as error:
            return self._logged(self._lose(error))
        if self._lost_at is not None and (taken or not self._feed.event_series):
            taken.append(self._found(taken))
        return self._logged(taken)

    def conclude(self) -> list[Events]:
        """Give the last events, and what the device has to tell of the whole recording."""
        self._end_attempts()
        if isinstance(self._feed, TellsNotes):
            self._feed.conclude()
        return self.poll()

    def _logged(self, taken: list[Events]) -> list[Events]:
        """The events together with the device's own notes."""
        if isinstance(self._feed, TellsNotes):
            taken += [device_event(at, NOTE, text, self._log) for at, text in self._feed.notes()]
        return taken

    def _lose(self, error: Exception) -> list[Events]:
        """Start to bring the device back; the log's line, where it was not lost before."""
        self._is_open = False
        self._end_attempts()
        self._stop.clear()
        self._returning = threading.Thread(target=self._bring_back, name=f"{self.where} again", daemon=True)
        self._returning.start()
        if self._lost_at is not None:
            return []
        since = error.since if isinstance(error, DeviceTimeout) else None
        self._lost_at = time.monotonic() if since is None else since
        return [device_event(self._lost_at, LOST, f"{self.where}: lost ({self._reason(error)})", self._log)]

    def _found(self, taken: list[Events]) -> Events:
        """The log's line of a device that is back: the loss ends with its first value."""
        there = [float((one.times if one.arrivals is None else one.arrivals)[0]) for one in taken]
        self._lost_at = None
        return device_event(min([time.monotonic(), *there]), BACK, f"{self.where}: back", self._log)

    def _bring_back(self) -> None:
        """Open the device again and again until it is there or the recording ends."""
        feed = self._feed
        drop, reopen = (feed.drop, feed.reopen) if isinstance(feed, TellsNotes) else (feed.close, feed.open)
        while not self._stop.is_set():
            with suppress(Exception):
                drop()
            with suppress(Exception):
                reopen()
                self._is_open = True
                return
            self._stop.wait(self._retry)

    def _reason(self, error: Exception) -> str:
        """The error without the device's name and without the remedy, which no longer helps."""
        text = str(error) if isinstance(error, MillfrfError) else f"{type(error).__name__}: {error}"
        return " ".join(text.split(";")[0].split()).removeprefix(self.where).lstrip(": ") or type(error).__name__

    def close(self) -> None:
        """End the attempts and release the device."""
        self._end_attempts()
        with suppress(Exception):
            self._feed.close()

    def _end_attempts(self) -> None:
        self._stop.set()
        if self._returning is not None:
            self._returning.join()
            self._returning = None
