"""Requests and web sockets of the live page."""

import asyncio
import json
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from tornado.iostream import StreamClosedError
from tornado.web import HTTPError, RequestHandler
from tornado.websocket import WebSocketHandler

from millfrf.core import counted

from .control import LiveControl
from .drawings import Choice, Drawing, as_json
from .guard import Guard, Limits
from .monitor import LiveMonitor, Snapshot
from .standing import COLUMNS


def status_of(now: Snapshot, control: LiveControl) -> dict[str, Any]:
    """State of the recording as plain text, for the page to set as text; never as HTML."""
    return {
        "state": control.state,
        "line": status_line(now, control),
        "start": control.state == "waiting",
        "mark": control.state == "recording",
        "stop": control.state in ("waiting", "recording"),
    }


def tests_of(now: Snapshot) -> dict[str, Any] | None:
    """How far the session is, as plain text; None without a session."""
    standing = now.standing
    if standing is None or not (standing.rows or standing.advice or now.notes):
        return None
    rows = [{"state": row.state, "cells": row.cells} for row in standing.rows]
    return {"advice": standing.advice, "columns": COLUMNS, "rows": rows, "notes": now.notes}


def status_line(now: Snapshot, control: LiveControl) -> str:
    """Time, samples, averages, marks, what was left out of the drawing, and how it ended."""
    n = len(control.marks)
    parts = [f"{now.seconds:.1f} s", f"{now.n_samples} samples a channel"]
    if now.spectra is not None:
        parts.append(counted(round(now.spectra.averages), "average"))
    if n:
        parts.append(f"{counted(n, 'mark')} (last: {control.marks[-1].label})")
    if now.n_skipped:
        parts.append(f"{now.n_skipped} blocks recorded but not drawn")
    return f"{', '.join(parts)}. {control.message}".strip()


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


_FOLDER = Path(__file__).parent
_CHUNK = 1 << 16
_KINDS = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript",
    ".css": "text/css",
    ".json": "application/json",
}


class Guarded(RequestHandler):
    """A handler that answers only under its own name, behind its token, with the headers of the guard."""

    @property
    def _guard(self) -> Guard:
        guard = self.application.settings["guard"]
        assert isinstance(guard, Guard)
        return guard

    def set_default_headers(self) -> None:
        """Set the headers of every answer, refusals included."""
        for name, value in self._guard.headers().items():
            self.set_header(name, value)
        self.clear_header("Server")

    def prepare(self) -> None:
        """Refuse a foreign name of this server, and a wrong token."""
        if not self._guard.host_is_ours(self.request.headers.get_list("Host")):
            raise HTTPError(421)
        if not self._guard.token_is_right(str(self.path_kwargs.get("token", ""))):
            raise HTTPError(404)

    def write_error(self, status_code: int, **_: Any) -> None:
        """Say nothing but the reason."""
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{status_code} {self._reason}\n")

    def log_exception(self, *_: Any) -> None:
        """Log nothing: a request's path holds the token."""


class Missing(Guarded):
    """Every path that is none."""

    def prepare(self) -> None:
        """Refuse every request that finds no other handler."""
        raise HTTPError(404)


class PageFile(Guarded):
    """A file of the page, or its figures."""

    async def get(self, token: str, name: str = "") -> None:
        """Send a file in parts, so that a reader who does not read costs one part."""
        del token
        content: bytes | Path | None = self.application.settings["content"].get(name)
        if content is None:
            raise HTTPError(404)
        self.set_header("Content-Type", _KINDS.get(Path(name or "page.html").suffix, "application/octet-stream"))
        if isinstance(content, bytes):
            self.write(content)
            return
        with content.open("rb") as file, suppress(StreamClosedError):
            while part := file.read(_CHUNK):
                self.write(part)
                await self.flush()


class LiveSocket(Guarded, WebSocketHandler):
    """The websocket of an open page: it gets what is drawn and sends what was pressed."""

    _feeder: Feeder
    _limits: Limits

    def prepare(self) -> None:
        """Refuse what is not a page of this server, and one page too many."""
        super().prepare()
        if not self._guard.origin_is_ours(self.request.headers.get_list("Origin")):
            raise HTTPError(403)
        self._feeder, self._limits = self.application.settings["feeder"], self.application.settings["limits"]
        if self._feeder.n_pages >= self._limits.pages:
            raise HTTPError(503)

    def check_origin(self, origin: str) -> bool:
        """Compare with the pages of this server."""
        return self._guard.origin_is_ours([origin])

    def open(self, *_: str, **__: str) -> None:
        """Let the page in."""
        self._arrived: deque[float] = deque(maxlen=self._limits.messages_a_second)
        assert self.ws_connection is not None
        stream = self.ws_connection.stream
        assert stream is not None
        self._abort = stream.close
        self.application.settings["server"].became_page(stream)
        self._counted = True
        self._page = self._feeder.add(self._send, self._abort)

    def _send(self, message: bytes) -> None:
        if self.ws_connection is not None and not self.ws_connection.is_closing():
            asyncio.ensure_future(self.write_message(message.decode("ascii"))).add_done_callback(_let_go)

    def on_message(self, message: str | bytes) -> None:
        """Do what was pressed; end a page that sends anything else, or too much of it."""
        now = time.monotonic()
        if len(self._arrived) == self._arrived.maxlen and now - self._arrived[0] < 1.0:
            self._abort()
            return
        self._arrived.append(now)
        try:
            self._page.take(json.loads(message))
        except (RefusedError, ValueError, RecursionError):
            self._abort()

    def on_close(self) -> None:
        """Let the page go."""
        if getattr(self, "_counted", False):
            self._counted = False
            self._feeder.remove(self._page)
            self.application.settings["server"].page_left()


def _let_go(sent: "asyncio.Future[None]") -> None:
    """A page that has left needs no message, and nobody needs to hear of it."""
    if not sent.cancelled():
        sent.exception()


def page_content(figures: bytes) -> dict[str, bytes | Path]:
    """Files of the page by their names; ``figures`` is JSON text."""
    from bokeh.util.paths import bokehjs_path

    library = Path(bokehjs_path()) / "js" / "bokeh.min.js"
    own = {name: (_FOLDER / name).read_bytes() for name in ("page.html", "page.js", "page.css")}
    html = own.pop("page.html")
    return {"": html, **own, "figures.json": figures, "bokeh.min.js": library}
