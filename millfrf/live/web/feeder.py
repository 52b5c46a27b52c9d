"""`Feeder`: draws once for all open pages, and sends each the next picture only when it has drawn the last one."""

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from ..control import LiveControl
from ..drawings import Choice, Drawing, as_json
from ..monitor import LiveMonitor, Snapshot
from .status import status_of, tests_of

NOTE_LENGTH = 120
_MOST_TICKED = 500  # channels of a rig, with room to spare


class RefusedError(Exception):
    """A message that no page sends."""


class OpenPage:
    """One open page: what it has chosen, and whether it has drawn what was sent.

    Parameters
    ----------
    send, abort
        Function that sends it a message, and one that ends it at once.
    choice
        What it shows.
    act
        Function that is told which button was pressed, and the note.
    """

    def __init__(
        self,
        send: Callable[[bytes], None],
        abort: Callable[[], None],
        choice: Choice,
        act: Callable[[str, str], None],
    ) -> None:
        self.send, self.abort, self.choice = send, abort, choice
        self._act = act
        self.sent_at: float | None = None

    def take(self, message: object) -> None:
        """Take a message.

        Raises
        ------
        RefusedError
            It is none that the page sends.
        """
        if not isinstance(message, dict) or len(message) != 1:
            raise RefusedError
        [(key, value)] = message.items()
        if key == "drawn" and value is True:
            self.sent_at = None
        elif key == "show" and isinstance(value, dict):
            self.choice = _chosen(self.choice, value)
        elif key in ("start", "stop", "mark") and isinstance(value, str):
            self._act(key, value[:NOTE_LENGTH])
        else:
            raise RefusedError


def _chosen(before: Choice, wanted: dict[str, Any]) -> Choice:
    """The choice with what a page wants, where it exists."""
    spectra = wanted.get("spectra")
    if not isinstance(spectra, list) or len(spectra) > _MOST_TICKED:
        raise RefusedError
    return replace(
        before,
        response=_index(wanted.get("response"), before.n_responses),
        excitation=_index(wanted.get("excitation"), before.n_excitations),
        spectra=tuple(dict.fromkeys(_index(one, before.n_spectra) for one in spectra))[: Choice.MOST_SPECTRA],
    )


def _index(value: object, n: int) -> int:
    """A place among ``n``."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < n:
        raise RefusedError
    return value


class Feeder:
    """Feeds open pages.

    Parameters
    ----------
    monitor, control
        What is drawn, and what the buttons say.
    drawings
        Figures of the page.
    first
        What a page shows before anything is chosen.
    patience : s
        Time after which a page that has not drawn is ended.
    """

    def __init__(
        self, monitor: LiveMonitor, control: LiveControl, drawings: Sequence[Drawing], first: Choice, patience: float
    ) -> None:
        self._monitor, self._control, self._drawings, self._first = monitor, control, drawings, first
        self._patience = patience
        self._pages: list[OpenPage] = []
        self._rest_until = 0.0

    @property
    def n_pages(self) -> int:
        """Number of open pages."""
        return len(self._pages)

    def add(self, send: Callable[[bytes], None], abort: Callable[[], None]) -> OpenPage:
        """Open a page."""
        page = OpenPage(send, abort, self._first, self._act)
        self._pages.append(page)
        return page

    def remove(self, page: OpenPage) -> None:
        """Close a page."""
        if page in self._pages:
            self._pages.remove(page)

    def _act(self, button: str, note: str) -> None:
        if button == "start":
            self._control.start()
        elif button == "stop":
            self._control.stop()
        else:
            self._control.mark(note, self._monitor.seconds)

    def feed(self) -> None:
        """Draw, and send to all pages that have drawn what came before; a third of the time at most is spent here."""
        began = time.monotonic()
        for page in [page for page in self._pages if page.sent_at and began - page.sent_at > self._patience]:
            page.abort()
        ready = [page for page in self._pages if page.sent_at is None]
        if not ready or began < self._rest_until:
            return
        now = self._monitor.snapshot()
        drawn: dict[Choice, bytes] = {}
        for page in ready:
            if page.choice not in drawn:
                drawn[page.choice] = self._message(now, page.choice)
            page.sent_at = began
            page.send(drawn[page.choice])
        self._rest_until = began + 3 * (time.monotonic() - began)

    def _message(self, now: Snapshot, choice: Choice) -> bytes:
        marks = self._control.marks
        figures = {drawing.name: drawing.content(now, choice, marks) for drawing in self._drawings}
        told = {"status": status_of(now, self._control), "tests": tests_of(now), "figures": figures}
        return json.dumps(told, default=as_json, allow_nan=False, separators=(",", ":")).encode("ascii")
