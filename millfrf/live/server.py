"""Web server of the live page: on this computer unless an address is given, with a token and limits."""

import asyncio
import ipaddress
import json
import threading
from typing import Any

from acquisition import DriverMissing
from millfrf.core import InputError

from .control import LiveControl
from .guard import LOOPBACK, CountedServer, Guard, Limits, hosts_of
from .monitor import LiveMonitor

PERIOD_MS = 500  # between two updates of the pages


class LiveServer:
    """Serve the live page from a separate thread; use it in a ``with`` block."""

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
                f"{address!r} is no IP address; give an address of this computer, such as {LOOPBACK}"
            ) from error
        if parsed.is_unspecified:
            raise InputError(f"{address} means every network; give one address of this computer")
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
        """Address for a browser; it contains the token, so everybody with it can press the buttons."""
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
            # lazy: bokeh and tornado are optional and slow to import
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
        items = {"figures": {drawing.name: json_item(drawing.figure) for drawing in drawings}}
        choice = {"response": first.response, "excitation": first.excitation, "spectra": first.spectra}
        content = json.dumps(items | {"names": names_of(self._monitor), "first": choice})
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
        """Return the listening socket."""
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
    """Log no request, because the path of a request contains the token."""
