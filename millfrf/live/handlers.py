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
    """Return the state of the recording as plain text; the page never interprets it as HTML."""
    return {
        "state": control.state,
        "line": status_line(now, control),
        "start": control.state == "waiting",
        "mark": control.state == "recording",
        "stop": control.state in ("waiting", "recording"),
        "cut": None if now.chatter is None else {"state": now.chatter.state, "line": now.chatter.line},
    }


def tests_of(now: Snapshot) -> dict[str, Any] | None:
    """Return the progress of the session as plain text; None without a session."""
    standing = now.standing
    if standing is None or not (standing.rows or standing.advice or now.notes):
        return None
    rows = [{"state": row.state, "cells": row.cells} for row in standing.rows]
    return {"advice": standing.advice, "columns": COLUMNS, "rows": rows, "notes": now.notes}


def status_line(now: Snapshot, control: LiveControl) -> str:
    """Describe time, samples, averages, marks, skipped blocks, and the end of the recording."""
    n = len(control.marks)
    parts = [f"{now.seconds:.1f} s", f"{now.n_samples} samples a channel"]
    if now.spectra is not None:
        parts.append(counted(round(now.spectra.averages), "average"))
    if n:
        parts.append(f"{counted(n, 'mark')} (last: {control.marks[-1].label})")
    if now.n_skipped:
        parts.append(f"{now.n_skipped} blocks recorded but not drawn")
    return f"{', '.join(parts)}. {control.message}".strip()


NOTE_LENGTH = 120  # characters
_MOST_TICKED = 500  # more channels than any rig has


class RefusedError(Exception):
    """A message that the page of this server never sends."""


class OpenPage:
    """An open page: its choice of entry and channels, and whether it has drawn the last message."""

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
        """Process a message of the page: a drawn update, a choice, or a pressed button."""
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


def _chosen(choice: Choice, request: dict[str, Any]) -> Choice:
    """Return the choice of entry and channels that a page requests; refuse indices that do not exist."""
    spectra = request.get("spectra")
    if not isinstance(spectra, list) or len(spectra) > _MOST_TICKED:
        raise RefusedError
    return replace(
        choice,
        response=_index(request.get("response"), choice.n_responses),
        excitation=_index(request.get("excitation"), choice.n_excitations),
        spectra=tuple(dict.fromkeys(_index(index, choice.n_spectra) for index in spectra))[: Choice.MOST_SPECTRA],
    )


def _index(value: object, n: int) -> int:
    """Return a value if it is an index from 0 to ``n - 1``, else refuse it."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < n:
        raise RefusedError
    return value


class Feeder:
    """Sends updates to open pages; closes a page that has not drawn within ``patience`` s."""

    def __init__(
        self, monitor: LiveMonitor, control: LiveControl, drawings: Sequence[Drawing], first: Choice, patience: float
    ) -> None:
        self._monitor, self._control, self._drawings, self._first = monitor, control, drawings, first
        self._patience = patience
        self._pages: list[OpenPage] = []
        self._rest_until = 0.0

    @property
    def n_pages(self) -> int:
        return len(self._pages)

    def add(self, send: Callable[[bytes], None], abort: Callable[[], None]) -> OpenPage:
        page = OpenPage(send, abort, self._first, self._act)
        self._pages.append(page)
        return page

    def remove(self, page: OpenPage) -> None:
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
        """Send an update to all pages that have drawn the last update; use at most a third of the time."""
        start = time.monotonic()
        for page in [page for page in self._pages if page.sent_at and start - page.sent_at > self._patience]:
            page.abort()
        ready = [page for page in self._pages if page.sent_at is None]
        if not ready or start < self._rest_until:
            return
        snapshot = self._monitor.snapshot()
        drawn: dict[Choice, bytes] = {}
        for page in ready:
            if page.choice not in drawn:
                drawn[page.choice] = self._message(snapshot, page.choice)
            page.sent_at = start
            page.send(drawn[page.choice])
        self._rest_until = start + 3 * (time.monotonic() - start)

    def _message(self, snapshot: Snapshot, choice: Choice) -> bytes:
        marks = self._control.marks
        figures = {drawing.name: drawing.content(snapshot, choice, marks) for drawing in self._drawings}
        content = {"status": status_of(snapshot, self._control), "tests": tests_of(snapshot), "figures": figures}
        return json.dumps(content, default=as_json, allow_nan=False, separators=(",", ":")).encode("ascii")


_FOLDER = Path(__file__).parent
_CHUNK = 1 << 16
_KINDS = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript",
    ".css": "text/css",
    ".json": "application/json",
}


class Guarded(RequestHandler):
    """A handler that checks host and token, and sets the headers of the guard."""

    @property
    def _guard(self) -> Guard:
        guard = self.application.settings["guard"]
        assert isinstance(guard, Guard)
        return guard

    def set_default_headers(self) -> None:
        """Set the headers of every answer, also of errors."""
        for name, value in self._guard.headers().items():
            self.set_header(name, value)
        self.clear_header("Server")

    def prepare(self) -> None:
        """Refuse a foreign host and a wrong token."""
        if not self._guard.host_is_ours(self.request.headers.get_list("Host")):
            raise HTTPError(421)
        if not self._guard.token_is_right(str(self.path_kwargs.get("token", ""))):
            raise HTTPError(404)

    def write_error(self, status_code: int, **_: Any) -> None:
        """Send only the reason of an error."""
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{status_code} {self._reason}\n")

    def log_exception(self, *_: Any) -> None:
        """Log no exception, because the path of the request contains the token."""


class Missing(Guarded):
    """Handler of unknown paths."""

    def prepare(self) -> None:
        raise HTTPError(404)


class PageFile(Guarded):
    """Handler of the files and figures of the page."""

    async def get(self, token: str, name: str = "") -> None:
        """Send a file in chunks, so that a client that does not read uses the memory of one chunk."""
        del token
        content: bytes | Path | None = self.application.settings["content"].get(name)
        if content is None:
            raise HTTPError(404)
        self.set_header("Content-Type", _KINDS.get(Path(name or "page.html").suffix, "application/octet-stream"))
        if isinstance(content, bytes):
            self.write(content)
            return
        with content.open("rb") as file, suppress(StreamClosedError):
            while chunk := file.read(_CHUNK):
                self.write(chunk)
                await self.flush()


class LiveSocket(Guarded, WebSocketHandler):
    """Websocket of an open page: it receives updates and sends pressed buttons."""

    _feeder: Feeder
    _limits: Limits

    def prepare(self) -> None:
        """Refuse foreign origins and too many pages."""
        super().prepare()
        if not self._guard.origin_is_ours(self.request.headers.get_list("Origin")):
            raise HTTPError(403)
        self._feeder, self._limits = self.application.settings["feeder"], self.application.settings["limits"]
        if self._feeder.n_pages >= self._limits.pages:
            raise HTTPError(503)

    def check_origin(self, origin: str) -> bool:
        return self._guard.origin_is_ours([origin])

    def open(self, *_: str, **__: str) -> None:
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
        """Process a message; close a page that sends invalid or too many messages."""
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
        if getattr(self, "_counted", False):
            self._counted = False
            self._feeder.remove(self._page)
            self.application.settings["server"].page_left()


def _let_go(future: "asyncio.Future[None]") -> None:
    """Ignore errors of messages to closed pages."""
    if not future.cancelled():
        future.exception()


def page_content(figures: bytes) -> dict[str, bytes | Path]:
    """Return the files of the page by name; ``figures`` is JSON text."""
    from bokeh.util.paths import bokehjs_path

    library = Path(bokehjs_path()) / "js" / "bokeh.min.js"
    own = {name: (_FOLDER / name).read_bytes() for name in ("page.html", "page.js", "page.css")}
    html = own.pop("page.html")
    return {"": html, **own, "figures.json": figures, "bokeh.min.js": library}
