"""`CountedServer`: an HTTP server with a fixed number of connections, none of them for long unless it is a page."""

from typing import Any

from tornado.httpserver import HTTPServer
from tornado.ioloop import IOLoop
from tornado.iostream import IOStream

from .guard import Limits

_BUFFER = 1 << 18  # bytes that a connection may send ahead


class CountedServer(HTTPServer):
    """HTTP server with a limit on connections.

    A connection that has not become a page is closed when its time is over, and earlier where a newer one needs its
    place: whoever holds connections open keeps nobody out.
    """

    limits: Limits
    _waiting: dict[IOStream, object]

    @classmethod
    def with_limits(cls, application: Any, limits: Limits) -> "CountedServer":
        """Make a server for an application."""
        server = cls(
            application,
            idle_connection_timeout=limits.patience,
            body_timeout=limits.patience,
            max_header_size=limits.request_bytes,
            max_body_size=limits.request_bytes,
            max_buffer_size=_BUFFER,
        )
        server.limits, server._waiting, server._pages = limits, {}, 0
        return server

    _pages: int

    def handle_stream(self, stream: IOStream, address: Any) -> None:
        """Take a connection, and end the oldest waiting one where there are too many."""
        while self._waiting and len(self._waiting) + self._pages >= self.limits.connections:
            oldest = next(iter(self._waiting))
            self._forget(oldest)
            oldest.close()
        loop = IOLoop.current()
        self._waiting[stream] = loop.call_later(self.limits.patience, stream.close)
        stream.set_close_callback(lambda: self._forget(stream))
        super().handle_stream(stream, address)

    def _forget(self, stream: IOStream) -> None:
        timer = self._waiting.pop(stream, None)
        if timer is not None:
            IOLoop.current().remove_timeout(timer)

    def became_page(self, stream: IOStream) -> None:
        """A connection has been let in and stays until it ends."""
        self._forget(stream)
        self._pages += 1

    def page_left(self) -> None:
        """A page has ended."""
        self._pages -= 1
