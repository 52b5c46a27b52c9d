"""Where tasks run: `Executor` is what running asks for; here is that of this process, without Dask."""

from collections import deque
from dataclasses import replace
from typing import Protocol

from .one_task import FAILED, FOREIGN, Ended, Order, run_task


class Executor(Protocol):
    """Takes orders and tells how they ended."""

    @property
    def n_workers(self) -> int:
        """Number of tasks that run at a time."""

    def submit(self, order: Order) -> None:
        """Take an order."""

    def next_ended(self, seconds: float) -> Ended | None:
        """How the next task ended; None: none did within some seconds."""

    def close(self) -> None:
        """Give up what has not begun."""


class InThisProcess:
    """Runs one task after the other, when it is asked how the next one ended."""

    def __init__(self) -> None:
        self._waiting: deque[Order] = deque()
        self.n_workers = 1

    def submit(self, order: Order) -> None:
        """Take an order."""
        self._waiting.append(order)

    def next_ended(self, seconds: float) -> Ended | None:
        """Do the next task."""
        del seconds
        if not self._waiting:
            return None
        ended = run_task(self._waiting.popleft())
        return replace(ended, status=FAILED) if ended.status == FOREIGN else ended

    def close(self) -> None:
        """Give up what has not begun."""
        self._waiting.clear()
