"""`MilledSpeeds`: spindle speeds that a test has passed through, from the speed that a device tells."""

import numpy as np
from numpy.typing import NDArray

_MOST = 100_000  # rpm
_JUMP = 0.1  # share of the speed; a larger step between two values was not swept through


class MilledSpeeds:
    """Speeds passed so far, to 1 rpm; it takes the same memory whatever comes.

    Examples
    --------
    >>> speeds = MilledSpeeds()
    >>> speeds.add(np.array([400.0, 410.0, 600.0]))
    >>> speeds.passed(404.0, 408.0).all(), speeds.passed(450.0, 460.0).any()
    (np.True_, np.False_)
    """

    def __init__(self) -> None:
        self._passed = np.zeros(_MOST, dtype=bool)
        self._last = float("nan")

    @property
    def known(self) -> bool:
        """Whether any speed was told."""
        return bool(self._passed.any())

    def add(self, values: NDArray[np.float64]) -> None:
        """Take further speeds (rpm) in the order of time."""
        for value in np.clip(np.abs(values[np.isfinite(values)]), 0, _MOST - 1):
            near = abs(value - self._last) <= _JUMP * value
            low, high = sorted((value, self._last)) if near else (value, value)
            self._passed[int(low) : int(high) + 1] = True
            self._last = float(value)

    def passed(self, low: float, high: float) -> NDArray[np.bool_]:
        """Whether each whole speed from ``low`` to ``high`` (rpm) was passed."""
        return self._passed[int(low) : int(high) + 1].copy()
