"""What the server answers: the page's files behind the token, and the websocket of each open page."""

import asyncio
import json
import time
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import Any

from tornado.iostream import StreamClosedError
from tornado.web import HTTPError, RequestHandler
from tornado.websocket import WebSocketHandler

from .feeder import Feeder, RefusedError
from .guard import Guard, Limits

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
