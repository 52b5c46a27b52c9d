"""`EventFeed`: an auxiliary device beside the sampled one."""

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

from .events import EventAxis, Events


@runtime_checkable
class EventFeed(Protocol):
    """A device that gives events, or none but is switched on and off with the recording (an amplifier)."""

    @property
    def event_series(self) -> Mapping[str, EventAxis]:
        """The series it gives and the clock of each."""

    def open(self) -> None:
        """Start to receive events."""

    def poll(self) -> list[Events]:
        """Give the events since the last call, without waiting; raise an error of the receiver."""

    def close(self) -> None:
        """Stop and release the device; harmless when not open."""


@runtime_checkable
class TellsNotes(Protocol):
    """A feed that also knows its device's name, how to open it again, and what the recording shall tell of it."""

    where: str

    def reopen(self) -> None:
        """Open a device that was lost, while the recording goes on."""

    def drop(self) -> None:
        """Let go of a device that was lost, without a word to it."""

    def notes(self) -> list[tuple[float, str]]:
        """Give what was noted since the last call: host's time (s) and text."""

    def conclude(self) -> None:
        """Note what is worth telling at the end of a recording."""
