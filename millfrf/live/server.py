"""Web server of the live page: local unless an address is given, with a token and limits."""

import asyncio
import ipaddress
import json
import secrets
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from tornado.httpserver import HTTPServer
from tornado.ioloop import IOLoop
from tornado.iostream import IOStream

from acquisition import DriverMissing
from millfrf.core import InputError

from .control import LiveControl
from .monitor import LiveMonitor


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
PERIOD_MS = 500


class LiveServer:
    """Serves the live page from a thread of its own; use it in a ``with`` block.

    Parameters
    ----------
    monitor, control
        What is drawn; what the buttons say.
    address
        IP address to listen on. Everybody who knows the whole address of the page can see and stop.
    port
        0: any free one.
    limits
        What all visitors together can have.

    Raises
    ------
    DriverMissing
        bokeh is not installed.
    InputError
        No IP address, or a port that is taken.
    """

    def __init__(
        self,
        monitor: LiveMonitor,
        control: LiveControl,
        address: str = LOOPBACK,
        port: int = 0,
        limits: Limits | None = None,
    ) -> None:
        try:
            parsed = ipaddress.ip_address(address)
        except ValueError as error:
            raise InputError(
                f"{address!r} is no IP address; give one of this computer's, such as {LOOPBACK}"
            ) from error
        if parsed.is_unspecified:
            raise InputError(f"{address} means every network; give the one of this computer's addresses to listen on")
        self._monitor, self._control = monitor, control
        self._address, self._wanted_port, self._loopback = address, port, parsed.is_loopback
        self._limits = limits or Limits()
        self._guard: Guard | None = None
        self._port = 0
        self._loop: asyncio.AbstractEventLoop | None = None
        self._server: Any = None
        self._ready = threading.Event()
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="live page", daemon=True)

    @property
    def url(self) -> str:
        """Address for a browser; whoever has it can press the buttons."""
        assert self._guard is not None
        host = f"[{self._address}]" if ":" in self._address else self._address
        return f"http://{host}:{self._port}/{self._guard.token}/"

    def __enter__(self) -> "LiveServer":
        self._thread.start()
        self._ready.wait()
        if self._error is not None:
            self._thread.join()
            raise self._error
        return self

    def _run(self) -> None:
        self._loop = asyncio.new_event_loop()
        asyncio.set_event_loop(self._loop)
        try:
            self._server = self._started()
        except Exception as error:
            self._error = error
            self._ready.set()
            return
        self._ready.set()
        self._loop.run_forever()
        self._server.stop()
        self._loop.run_until_complete(self._server.close_all_connections())
        self._loop.run_until_complete(self._loop.shutdown_asyncgens())
        self._loop.close()

    def _started(self) -> Any:
        try:
            from bokeh.embed import json_item
            from tornado.ioloop import PeriodicCallback
            from tornado.web import Application
        except ImportError as error:
            raise DriverMissing("the live page needs bokeh; pip install millfrf[live]") from error
        from .frequency_drawings import all_drawings, first_choice, names_of
        from .handlers import Feeder, LiveSocket, Missing, PageFile, page_content

        socket = self._bound()
        self._port = socket.getsockname()[1]
        self._guard = Guard(hosts_of(self._address, self._port, self._loopback))
        drawings, first = all_drawings(self._monitor), first_choice(self._monitor)
        items = {"figures": {one.name: json_item(one.figure) for one in drawings}}
        chosen = {"response": first.response, "excitation": first.excitation, "spectra": first.spectra}
        content = json.dumps(items | {"names": names_of(self._monitor), "first": chosen})
        feeder = Feeder(self._monitor, self._control, drawings, first, self._limits.patience)
        application = Application(
            [
                (r"/(?P<token>[^/]*)/live", LiveSocket),
                (r"/(?P<token>[^/]*)/(?P<name>[^/]*)", PageFile),
            ],
            default_handler_class=Missing,
            log_function=_say_nothing,
            websocket_max_message_size=self._limits.message_bytes,
            websocket_ping_interval=self._limits.patience,
            guard=self._guard,
            limits=self._limits,
            feeder=feeder,
            content=page_content(content.encode()),
        )
        server = CountedServer.with_limits(application, self._limits)
        application.settings["server"] = server
        server.add_sockets([socket])
        PeriodicCallback(feeder.feed, PERIOD_MS).start()
        return server

    def _bound(self) -> Any:
        """The socket that is listened on."""
        from tornado.netutil import bind_sockets

        try:
            [socket, *others] = bind_sockets(self._wanted_port, self._address)
        except OSError as error:
            raise InputError(
                f"the live page cannot listen on {self._address} port {self._wanted_port}: {error.strerror}; "
                "choose another with --live-port"
            ) from error
        for other in others:
            other.close()
        return socket

    def __exit__(self, *exception: object) -> None:
        if self._loop is not None and self._loop.is_running():
            self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(5.0)


def _say_nothing(_: object) -> None:
    """Log no request: its path holds the token."""


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
