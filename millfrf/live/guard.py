"""Whom the live page answers, and limits of what it gives: host, origin, token, connections."""

import secrets
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from tornado.httpserver import HTTPServer
from tornado.ioloop import IOLoop
from tornado.iostream import IOStream


@dataclass(frozen=True)
class Limits:
    """Limits of what all visitors together can take from the computer that records.

    Parameters
    ----------
    pages
        Pages open at once; a further one is told to come back later.
    connections
        Connections open at once; a further one ends the oldest that has not become a page.
    request_bytes, message_bytes
        Largest request and largest message of a page.
    messages_a_second
        Messages of one page in a second; more end it.
    patience : s
        Time for a request to be sent whole and answered, and for a page to say that it has drawn.
    """

    pages: int = 12
    connections: int = 256
    request_bytes: int = 16384
    message_bytes: int = 4096
    messages_a_second: int = 20
    patience: float = 20.0


@dataclass(frozen=True)
class Guard:
    """Names under which the server is asked, and the token that every path begins with.

    A foreign page can make a browser ask this server under a name of its own (DNS rebinding); such a request has a
    foreign ``Host``, and the right one cannot be forged by a page.

    Parameters
    ----------
    hosts
        Allowed values of the header ``Host``, in lower case, with the port where a browser sends it.
    token
        First part of every path.
    """

    hosts: frozenset[str]
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24), repr=False)

    def host_is_ours(self, given: Sequence[str]) -> bool:
        """Tell whether a request has one ``Host`` and it is allowed."""
        return len(given) == 1 and given[0].strip().lower() in self.hosts

    def origin_is_ours(self, given: Sequence[str]) -> bool:
        """Tell whether a websocket comes from a page of this server."""
        return len(given) == 1 and given[0].strip().lower() in {f"http://{host}" for host in self.hosts}

    def token_is_right(self, given: str) -> bool:
        """Compare the token in a time that tells nothing about it."""
        return secrets.compare_digest(given.encode(), self.token.encode())

    def headers(self) -> dict[str, str]:
        """Headers of every answer: scripts and data of this server alone, no frames, no referrer, nothing kept."""
        sockets = " ".join(f"ws://{host}" for host in sorted(self.hosts))
        policy = (
            "default-src 'none'; script-src 'self'; "
            "style-src 'self' 'unsafe-inline'; "  # bokeh styles its shadow roots with <style>
            f"connect-src 'self' {sockets}; img-src 'self' data:; "
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


def hosts_of(address: str, port: int, loopback: bool) -> frozenset[str]:
    """Values of ``Host`` with which a browser asks for an address.

    Examples
    --------
    >>> sorted(hosts_of("127.0.0.1", 5006, True)), sorted(hosts_of("::1", 80, False))
    (['127.0.0.1:5006', 'localhost:5006'], ['[::1]', '[::1]:80'])
    """
    names = [f"[{address}]" if ":" in address else address, *(["localhost"] if loopback else [])]
    found = {f"{name}:{port}" for name in names}
    return frozenset(found | set(names)) if port == 80 else frozenset(found)


LOOPBACK = "127.0.0.1"


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
