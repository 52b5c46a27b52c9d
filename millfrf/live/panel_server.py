"""Server of a page that Panel draws: on this computer only, with the guard and the limits of the live page."""

import asyncio
import html
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

from bokeh.server.tornado import BokehTornado
from panel.io.application import build_applications
from panel.io.resources import COMPONENT_PATH
from panel.io.server import ComponentResourceHandler
from tornado.httputil import HTTPHeaders, HTTPServerRequest
from tornado.ioloop import IOLoop
from tornado.netutil import bind_sockets
from tornado.web import OutputTransform

from millfrf.core import InputError

from .guard import LOOPBACK, CountedServer, Guard, Limits, hosts_of
from .handlers import Missing

UPLOAD_BYTES = 256 << 20
"""Largest message of a page: a dropped file, encoded."""


class _GuardHeaders(OutputTransform):
    """Add the headers of the guard to every answer."""

    def __init__(self, headers: dict[str, str], _request: HTTPServerRequest) -> None:
        self._headers = headers

    def transform_first_chunk(
        self, status_code: int, headers: HTTPHeaders, chunk: bytes, finishing: bool
    ) -> tuple[int, HTTPHeaders, bytes]:
        del finishing
        for name, value in self._headers.items():
            headers[name] = value
        headers.pop("Server", None)
        return status_code, headers, chunk


class GuardedPages(BokehTornado):  # type: ignore[misc]
    """Bokeh's application behind a guard: a foreign host, path or origin gets status 404 before any handler runs.

    Parameters
    ----------
    page
        Function that builds the page for a visitor.
    guard, limits
        Allowed hosts with the token, and the limits of connections.
    title
        Title of the page.
    """

    def __init__(self, page: Callable[[], Any], guard: Guard, limits: Limits, title: str) -> None:
        self._guard, self._limits = guard, limits
        super().__init__(
            build_applications(page, title=title),
            prefix=guard.token,
            extra_patterns=[(rf"/{COMPONENT_PATH}(.*)", ComponentResourceHandler, {})],
            extra_websocket_origins=sorted(guard.hosts),
            use_index=False,
            websocket_max_message_size_bytes=UPLOAD_BYTES,
            transforms=[partial(_GuardHeaders, guard.page_headers())],
            log_function=lambda _: None,  # a request's path holds the token
            guard=guard,
        )
        self.server: CountedServer | None = None
        self._open: set[Any] = set()

    def find_handler(self, request: HTTPServerRequest, **kwargs: Any) -> Any:
        """Return the handler of an allowed request, that of missing pages for all others."""
        if not self._is_allowed(request):
            return self.get_handler_delegate(request, Missing)
        return super().find_handler(request, **kwargs)

    def _is_allowed(self, request: HTTPServerRequest) -> bool:
        token = request.path.lstrip("/").partition("/")[0]
        is_socket = request.headers.get("Upgrade", "").lower() == "websocket"
        return (
            self._guard.host_is_ours(request.headers.get_list("Host"))
            and self._guard.token_is_right(token)
            and (not is_socket or self._guard.origin_is_ours(request.headers.get_list("Origin")))
            and (not is_socket or len(self._open) < self._limits.pages)
            and (request.path.strip("/") != token or self._n_documents < self._limits.pages)
        )

    @property
    def _n_documents(self) -> int:
        """Number of documents that are held for visitors; that of a closed page goes after half a minute."""
        return sum(len(context.sessions) for context in self._applications.values())

    def new_connection(self, protocol: Any, socket: Any, application_context: Any, session: Any) -> Any:
        """Count a page that opens: its connection has no timeout."""
        connection = super().new_connection(protocol, socket, application_context, session)
        if self.server is not None:
            self._open.add(connection)
            self.server.became_page(socket.ws_connection.stream)
        return connection

    def client_lost(self, connection: Any) -> None:
        """Count a page that closed."""
        super().client_lost(connection)
        if self.server is not None and connection in self._open:
            self._open.remove(connection)
            self.server.page_left()


def set_columns(source: Any, columns: dict[str, Any]) -> None:
    """Replace the columns of a bokeh source, when its document may be changed: also after a wait in a handler."""
    if source.document is None:
        source.data = columns
    else:
        source.document.add_next_tick_callback(lambda: source.update(data=columns))


def said(text: str, role: str = "status", more: Sequence[str] = ()) -> str:
    """Return a message as HTML, which screen readers speak; ``more`` are further sentences in a list.

    Examples
    --------
    >>> said("a < b", "alert")
    '<p role="alert" style="margin:0;color:#8a1c00">a &lt; b</p>'
    """
    colour = "#8a1c00" if role == "alert" else "#111111"
    listed = "".join(f"<li>{html.escape(each)}</li>" for each in more)
    sentence = f'<p role="{role}" style="margin:0;color:{colour}">{html.escape(text)}</p>' if text else ""
    return sentence + (f"<ul>{listed}</ul>" if listed else "")


async def serve_page(
    page: Callable[[], Any],
    title: str,
    show: Callable[[str], object],
    until: "asyncio.Future[Any]",
    port: int = 0,
    limits: Limits | None = None,
) -> Any:
    """Serve a page to this computer until a future has a result, and return the result.

    Parameters
    ----------
    page
        Function that builds the page for a visitor.
    title
        Title of the page.
    show
        Called with the address of the page, which contains the token.
    until
        Its result ends the server.
    port
        Port; 0: any that is free.
    limits
        Limits of connections.

    Raises
    ------
    InputError
        The port is taken.
    """
    try:
        sockets = bind_sockets(port, LOOPBACK)
    except OSError as error:
        raise InputError(
            f"the page cannot listen on port {port}: {error.strerror}; choose another with --port, or leave it out"
        ) from error
    port, limits = sockets[0].getsockname()[1], limits or Limits()
    guard = Guard(hosts_of(LOOPBACK, port, True))
    application = GuardedPages(page, guard, limits, title)
    server = CountedServer.with_limits(application, limits)
    application.server = server
    application.initialize(IOLoop.current())
    application.start()
    server.add_sockets(sockets)
    show(f"http://{LOOPBACK}:{port}/{guard.token}/")
    try:
        return await until
    finally:
        await asyncio.sleep(0.2)  # time for the last message to the page
        server.stop()
        application.stop(wait=False)
        with suppress(asyncio.TimeoutError):
            await asyncio.wait_for(server.close_all_connections(), 2.0)
