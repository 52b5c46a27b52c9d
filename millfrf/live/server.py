"""The page's server: on this machine only, unless an address is given; then its path holds a token nobody can guess."""

import asyncio
import ipaddress
import secrets
import threading
from typing import Any

from acquisition import DriverMissing
from foundation import InputError

from .control import LiveControl
from .monitor import LiveMonitor
from .page import build_page

LOOPBACK = "127.0.0.1"


class LiveServer:
    """Serves the live page from a thread of its own; use it in a ``with`` block.

    Parameters
    ----------
    monitor, control
        What is drawn; what the buttons say.
    address
        IP address to listen on. Other than loopback, everybody who knows the whole address can see and stop.
    port
        0: any free one.
    token
        Whether the path holds a token; None: only where the address is not loopback.

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
        token: bool | None = None,
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
        self._address, self._wanted_port = address, port
        guarded = not parsed.is_loopback if token is None else token
        self._path = f"/{secrets.token_urlsafe(24)}" if guarded else "/"
        self._loop: asyncio.AbstractEventLoop | None = None
        self._server: Any = None
        self._ready = threading.Event()
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="live page", daemon=True)

    @property
    def url(self) -> str:
        """Address for a browser."""
        host = f"[{self._address}]" if ":" in self._address else self._address
        return f"http://{host}:{self._server.port}{self._path}"

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
        self._loop.run_until_complete(self._loop.shutdown_asyncgens())
        self._loop.close()

    def _started(self) -> Any:
        try:
            from bokeh.application import Application
            from bokeh.application.handlers.function import FunctionHandler
            from bokeh.server.server import Server
        except ImportError as error:
            raise DriverMissing("the live page needs bokeh; pip install millfrf[live]") from error
        from tornado.ioloop import IOLoop
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
        port = socket.getsockname()[1]
        socket.close()
        host = f"[{self._address}]" if ":" in self._address else self._address
        page = Application(FunctionHandler(lambda document: build_page(document, self._monitor, self._control)))
        server = Server(
            {self._path: page},
            io_loop=IOLoop.current(),
            port=port,
            address=self._address,
            allow_websocket_origin=[f"{host}:{port}", *([f"localhost:{port}"] if self._path == "/" else [])],
            use_index=False,
            redirect_root=False,
            check_unused_sessions_milliseconds=2000,
            unused_session_lifetime_milliseconds=5000,
        )
        server.start()
        return server

    def __exit__(self, *exception: object) -> None:
        if self._loop is not None and self._loop.is_running():
            self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(5.0)
