"""Access control of the live page: host, origin, token, and limits of connections."""

import secrets
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from tornado.httpserver import HTTPServer
from tornado.ioloop import IOLoop
from tornado.iostream import IOStream


@dataclass(frozen=True)
class Limits:
    """Limits for all visitors together, so that they cannot overload the recording computer."""

    pages: int = 12  # open pages; a further page gets status 503
    connections: int = 256  # open connections; a further connection closes the oldest that has not become a page
    request_bytes: int = 16384  # largest request
    message_bytes: int = 4096  # largest message of a page
    messages_a_second: int = 20  # of one page; a page that sends more is closed
    patience: float = 20.0  # s; timeout of a request, and of a page that draws


@dataclass(frozen=True)
class Guard:
    """Allowed hosts of the server, and the token at the start of every path.

    A foreign page can make a browser send requests to this server under another name (DNS rebinding). Such a request
    has a foreign ``Host``, which a page cannot forge.
    """

    hosts: frozenset[str]  # allowed values of the header ``Host``, in lower case
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24), repr=False)  # first part of every path

    def host_is_ours(self, values: Sequence[str]) -> bool:
        """Return whether a request has exactly one ``Host`` and it is allowed."""
        return len(values) == 1 and values[0].strip().lower() in self.hosts

    def origin_is_ours(self, values: Sequence[str]) -> bool:
        """Return whether a websocket comes from a page of this server."""
        return len(values) == 1 and values[0].strip().lower() in {f"http://{host}" for host in self.hosts}

    def token_is_right(self, text: str) -> bool:
        """Compare the token in constant time."""
        return secrets.compare_digest(text.encode(), self.token.encode())

    def headers(self, scripts: str = "'self'", connections: str = "'self'") -> dict[str, str]:
        """Return the headers of every answer: they allow only scripts of this server, no frames, referrer or cache."""
        sockets = " ".join(f"ws://{host}" for host in sorted(self.hosts))
        policy = (
            f"default-src 'none'; script-src {scripts}; "
            "style-src 'self' 'unsafe-inline'; "  # bokeh styles its shadow roots with <style>
            f"connect-src {connections} {sockets}; img-src 'self' data: blob:; font-src 'self' data:; "
            "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        )
        return {
            "Content-Security-Policy": policy,
            "X-Content-Type-Options": "nosniff",
            "X-Frame-Options": "DENY",
            "Referrer-Policy": "no-referrer",
            "Cache-Control": "no-store",
            "Cross-Origin-Resource-Policy": "same-origin",
        }

    def page_headers(self) -> dict[str, str]:
        """Return the headers of pages that Panel draws: their scripts stand in the page, or are compiled in it."""
        return self.headers("'self' 'unsafe-inline' 'unsafe-eval' blob:", "'self' blob:")


def hosts_of(address: str, port: int, loopback: bool) -> frozenset[str]:
    """Return the values of ``Host`` that a browser sends for an address.

    Examples
    --------
    >>> sorted(hosts_of("127.0.0.1", 5006, True)), sorted(hosts_of("::1", 80, False))
    (['127.0.0.1:5006', 'localhost:5006'], ['[::1]', '[::1]:80'])
    """
    names = [f"[{address}]" if ":" in address else address, *(["localhost"] if loopback else [])]
    with_port = {f"{name}:{port}" for name in names}
    return frozenset(with_port | set(names)) if port == 80 else frozenset(with_port)


LOOPBACK = "127.0.0.1"


_BUFFER = 1 << 18  # bytes; receive buffer of a connection


class CountedServer(HTTPServer):
    """HTTP server with a limit on connections.

    A connection that has not become a page is closed after a timeout, or earlier if a newer connection needs its place.
    So idle connections cannot block other visitors.
    """

    limits: Limits
    _waiting: dict[IOStream, object]

    @classmethod
    def with_limits(cls, application: Any, limits: Limits) -> "CountedServer":
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
        """Accept a connection; if there are too many connections, close the oldest waiting connection."""
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
        """Count a connection as a page without timeout."""
        self._forget(stream)
        self._pages += 1

    def page_left(self) -> None:
        """Reduce the number of open pages by 1."""
        self._pages -= 1
