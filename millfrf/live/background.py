"""`Background`: takes blocks of a running recording in a thread of its own, without delaying the recording."""

import contextvars
import math
import queue
import threading
import time
from collections.abc import Callable

from acquisition import Block, Events

_QUEUE_LENGTH = 64  # blocks


class Background:
    """A watcher for `record`: it puts the blocks of one stream into a short queue that a thread processes.

    Parameters
    ----------
    stream
        Name of the stream whose blocks are taken.
    process
        Called with each block, and with whether blocks were skipped before it, while :attr:`lock` is held.
    name
        Name of the thread.
    waits
        Whether to wait where the queue is full. A recording must not wait: blocks are then skipped and counted.
    """

    def __init__(self, stream: str, process: Callable[[Block, bool], None], name: str, *, waits: bool = False) -> None:
        self.lock = threading.Lock()
        self.n_skipped = 0
        self.error: Exception | None = None  # ended the processing; further blocks are skipped
        self._stream, self._process, self._waits = stream, process, waits
        self._queue: queue.Queue[Block] = queue.Queue(_QUEUE_LENGTH)
        self._stop = threading.Event()
        self._gap = False
        context = contextvars.copy_context()  # what is said there is said as here
        self._thread = threading.Thread(target=context.run, args=(self._run,), name=name, daemon=True)
        self._thread.start()

    def __call__(self, item: Block | Events) -> None:
        """Put a block into the queue; skip it if the queue is full."""
        if isinstance(item, Events) or item.stream != self._stream:
            return
        if self._waits:
            self._queue.put(item)
            return
        try:
            self._queue.put_nowait(item)
        except queue.Full:
            self.n_skipped += 1
            self._gap = True

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                block = self._queue.get(timeout=0.2)
            except queue.Empty:
                continue
            with self.lock:
                self._take(block)
                self._queue.task_done()

    def _take(self, block: Block) -> None:
        if self.error is not None:
            self.n_skipped += 1
            return
        gap, self._gap = self._gap, False
        try:
            self._process(block, gap)
        except Exception as error:  # a thread that ends would let a waiting recording stand still
            self.error = error

    def clear(self) -> None:
        """Remove all blocks from the queue; call it while holding :attr:`lock`."""
        while not self._queue.empty():
            self._queue.get_nowait()
            self._queue.task_done()

    def finish(self, at_most: float = math.inf) -> None:
        """Process the rest of the queue, for ``at_most`` so many seconds."""
        latest = time.monotonic() + at_most
        while self._queue.unfinished_tasks and not self._stop.is_set() and time.monotonic() < latest:
            time.sleep(0.02)

    def close(self) -> None:
        """Stop the thread."""
        self._stop.set()
        self._thread.join()
