"""Count of the computed values of fits, by which a search is limited: the same on every machine and at every load."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field

MILLION = 1_000_000


@dataclass
class Work:
    """Number of values that fits have computed since the count began.

    One unit is one value of a predicted signal, or of its derivative by one number: a simulation of n samples with r
    responses and j joints counts ``n (r + j)``; a Jacobian of c columns counts ``c (l r + n j)``, l lines compared.
    """

    values: int = 0


_counted: ContextVar[Work | None] = ContextVar("counted_work", default=None)


@contextmanager
def counted_work() -> Iterator[Work]:
    """Count the work that is done inside of the ``with`` block, by this process and by its helper processes.

    >>> with counted_work() as work:
    ...     count_work(30)
    ...     count_work(12)
    >>> work.values
    42
    """
    outer, work = _counted.get(), Work()
    token = _counted.set(work)
    try:
        yield work
    finally:
        _counted.reset(token)
        if outer is not None:
            outer.values += work.values


def count_work(values: int) -> None:
    """Add computed values to the present count; without a count nothing happens."""
    work = _counted.get()
    if work is not None:
        work.values += values


@dataclass(frozen=True)
class WorkLimit:
    """Largest work of a search, in millions of values, after which it begins no new step; and its count.

    >>> WorkLimit(2.0, Work(1_999_999)).reached, WorkLimit(2.0, Work(2_000_000)).reached
    (False, True)
    """

    millions: float = float("inf")
    work: Work = field(default_factory=Work)

    @property
    def reached(self) -> bool:
        """Whether the search has done this work."""
        return self.work.values >= self.millions * MILLION
