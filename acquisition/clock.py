r"""One clock for all: how a device's clock runs against the host's monotonic time, from pairs that arrive late.

A pair says that the device showed :math:`x` when the host noticed it at :math:`t`. The host is never early, only late:

.. math:: t_k = a + b\,x_k + e_k, \qquad e_k \ge 0,

with small :math:`e_k` most of the time and large ones while the host was busy. So in each of some windows only the
least late pair counts, the slope is the median of the slopes between those (Theil and Sen), and the offset is their
lower quartile.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

PLAUSIBLE_DRIFT = 100e-6
"""Standard deviation of a clock's relative error that is expected before anything is measured."""

_WINDOWS = 60
_PAIRS_A_WINDOW = 5

Real = NDArray[np.float64]


@dataclass(frozen=True)
class ClockFit:
    """``host = origin_host + slope * (local - origin_local)``.

    Parameters
    ----------
    origin_local
        Time of the origin in the device's unit: samples, or s.
    origin_host : s
        Host's monotonic time at the origin.
    slope
        Host seconds per unit.
    drift
        Relative error of the device's unit against its nominal one, positive where the device is slow.
    scatter : s
        Half the range between the lateness of the windows' pairs that counts as usual (quartiles).
    n_pairs
        Number of pairs used.
    """

    origin_local: float
    origin_host: float
    slope: float
    drift: float
    scatter: float
    n_pairs: int

    def host(self, local: Real | float) -> Real:
        """Host's monotonic time of a device's reading, s."""
        return self.origin_host + self.slope * (np.asarray(local, dtype=float) - self.origin_local)

    def local(self, host: Real | float) -> Real:
        """The device's reading at a host's time."""
        return self.origin_local + (np.asarray(host, dtype=float) - self.origin_host) / self.slope


def fit_clock(local: Real, host: Real, nominal_slope: float) -> ClockFit:
    """Offset and drift of a device's clock, robust against a host that stalls.

    Parameters
    ----------
    local : (n_pairs,)
        The device's readings: sample counts, or s.
    host : (n_pairs,), s
        Host's monotonic time when each was noticed.
    nominal_slope
        Host seconds per unit of ``local`` if the device were exact: 1 / sample rate, or 1.

    Returns
    -------
    ClockFit
        Where the pairs span too little time to tell a drift, it is shrunk towards zero.

    Raises
    ------
    InputError
        No pair, pairs of unequal number, or values that are not finite.
    """
    local, host = np.asarray(local, dtype=float), np.asarray(host, dtype=float)
    if local.shape != host.shape or local.ndim != 1 or not len(local):
        raise InputError(f"{local.size} readings and {host.size} host times make no clock; record at least one pair")
    if not (np.isfinite(local).all() and np.isfinite(host).all()):
        raise InputError("a clock's pairs hold NaN or infinity; leave those out")
    x0, t0 = float(local[0]), float(host[0])
    elapsed = (local - x0) * nominal_slope
    late = host - t0 - elapsed
    best = _least_late(elapsed, late)
    drift = _median_slope(elapsed[best], late[best])
    left = late[best] - drift * elapsed[best]
    low, middle = np.quantile(left, (0.25, 0.5))
    scatter = float(middle - low)
    span = float(np.ptp(elapsed[best]))
    expected_error = (scatter + 1e-5) / span if span > 0 else np.inf
    if np.isinf(expected_error):
        drift = 0.0
    else:
        drift *= PLAUSIBLE_DRIFT**2 / (PLAUSIBLE_DRIFT**2 + expected_error**2)
    left = late[best] - drift * elapsed[best]
    offset = float(np.quantile(left, 0.25))
    return ClockFit(x0, t0 + offset, nominal_slope * (1 + drift), drift, scatter, len(local))


def _least_late(elapsed: Real, late: Real) -> NDArray[np.intp]:
    """Index of the pair that came least late in each of several windows of equal numbers of pairs."""
    order = np.argsort(elapsed, kind="stable")
    n_windows = int(np.clip(len(order) // _PAIRS_A_WINDOW, 1, _WINDOWS))
    return np.array([part[np.argmin(late[part])] for part in np.array_split(order, n_windows)])


def _median_slope(x: Real, y: Real) -> float:
    """Theil-Sen slope of a few points."""
    first, second = np.triu_indices(len(x), 1)
    run = x[second] - x[first]
    usable = run > 0.25 * np.ptp(x) if len(x) > 1 else np.zeros(0, dtype=bool)
    return float(np.median((y[second] - y[first])[usable] / run[usable])) if usable.any() else 0.0
