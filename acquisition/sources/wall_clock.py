"""The host's wall clock, watched for steps against the monotonic one."""

import time

LEAST_STEP = 0.02
"""s; a time service slews a clock by less than this between two looks, larger changes are steps."""


class WallClock:
    """Tells by how much the wall clock was set while a recording runs.

    Every time in a recording stands on the monotonic clock, which nobody can set. Some interfaces stamp what they
    receive with the wall clock; there a step matters.
    """

    def __init__(self) -> None:
        self._offset = _offset()

    def step(self) -> float:
        """Seconds by which the wall clock was set since the last call; 0 where it was not."""
        now = _offset()
        change, self._offset = now - self._offset, now
        return change if abs(change) > LEAST_STEP else 0.0


def _offset() -> float:
    """Wall clock less monotonic clock, s; the least held up of three readings counts."""
    found = []
    for _ in range(3):
        before, wall, after = time.monotonic(), time.time(), time.monotonic()
        found.append((after - before, wall - 0.5 * (before + after)))
    return min(found)[1]
