"""A thread that receives, so that no event waits for samples or for the disk."""

import queue
import threading
from collections.abc import Callable

from .events import Events

Put = Callable[[Events], None]


class Receiver:
    """Runs one loop in a thread; what it puts is fetched with `drain`, and what it raises is raised there.

    Parameters
    ----------
    name
        Name of the thread, for messages.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._queue: queue.SimpleQueue[Events] = queue.SimpleQueue()
        self._stop = threading.Event()
        self._error: BaseException | None = None
        self._thread: threading.Thread | None = None

    def start(self, loop: Callable[[Put, Callable[[], bool]], None]) -> None:
        """Run ``loop(put, stopped)`` until it returns; it must ask ``stopped()`` a few times a second."""
        self._stop.clear()
        self._error = None

        def run() -> None:
            try:
                loop(self._queue.put, self._stop.is_set)
            except BaseException as error:
                self._error = error

        self._thread = threading.Thread(target=run, name=self._name, daemon=True)
        self._thread.start()

    def drain(self) -> list[Events]:
        """Everything received since the last call, without waiting.

        Raises
        ------
        DeviceError
            Whatever ended the loop, after all that came before it was fetched.
        """
        taken = []
        while True:
            try:
                taken.append(self._queue.get_nowait())
            except queue.Empty:
                break
        if not taken and self._error is not None:
            raise self._error
        return taken

    def stop(self) -> None:
        """End the loop and wait for it; harmless when it does not run."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
