"""Clocks: how the clock of a device runs against the monotonic clock of the host, and what that says of the samples."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError, Real

PLAUSIBLE_DRIFT = 100e-6
"""Standard deviation of a clock's relative error that is expected before anything is measured."""

_WINDOWS = 60
_PAIRS_A_WINDOW = 5


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
    best = _least_late_of_clock(elapsed, late)
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


def _least_late_of_clock(elapsed: Real, late: Real) -> NDArray[np.intp]:
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


FEWEST = 8
"""Pairs from which anything is told."""

FEWEST_SLOPES = 15
"""Slopes between windows from which their spread tells the error of the rate."""

AROUND = 50
"""Pairs behind a gap of which several must keep the new lateness: a computer that stalls comes back from it."""

SMALLEST_GAP = 0.02
"""s; a gap below it may be the host's."""

TIMES_SCATTER = 6.0
"""A gap is told from so many times the usual difference of the least late pairs of neighbouring windows."""

TRUSTED_RATE = 1e-3
"""Share by which a rate may be off: clocks are off by 1e-4 at most, and a host that follows a time server by 5e-4."""


@dataclass(frozen=True)
class Gap:
    """Time that is missing between two samples.

    Parameters
    ----------
    after_sample
        Number of samples that were there before the gap.
    seconds
        Length of the gap, s.
    """

    after_sample: int
    seconds: float


@dataclass(frozen=True)
class ClockFindings:
    """What the pairs of one stream say.

    Parameters
    ----------
    stated_rate, true_rate : Hz
        Sample rate in the file, and by the host's clock; nan where the pairs do not tell.
    rate_error
        Standard error of the true rate, as a share of it.
    gaps
        Where time is missing.
    """

    stated_rate: float
    true_rate: float
    rate_error: float
    gaps: tuple[Gap, ...] = ()

    @property
    def rate_is_wrong(self) -> bool:
        """Whether the stated rate is off by more than clocks are, and by more than chance."""
        off = abs(self.true_rate / self.stated_rate - 1)
        return bool(off > TRUSTED_RATE + 5 * self.rate_error)


def check_clock(pairs: Real, stated_rate: float) -> ClockFindings:
    """Compare the samples of a stream with the host's clock.

    Parameters
    ----------
    pairs : (n_pairs, 2)
        Number of samples, and the host's monotonic time (s) when they were there.
    stated_rate
        Sample rate in the file, Hz.

    Examples
    --------
    >>> counts = np.arange(1, 101) * 1024.0
    >>> found = check_clock(np.column_stack([counts, counts / 9216]), 10240.0)
    >>> round(found.true_rate), found.rate_is_wrong, found.gaps
    (9216, True, ())
    """
    pairs = pairs[np.isfinite(pairs).all(axis=1)]
    pairs = pairs[np.argsort(pairs[:, 0], kind="stable")]
    nothing = ClockFindings(stated_rate, float("nan"), float("inf"))
    if len(pairs) < FEWEST or np.ptp(pairs[:, 0]) <= 0:
        return nothing
    period, error = _period(pairs)
    if not period > 0:
        return nothing
    found = _gaps(pairs, period)
    if found:
        # a slope across a gap says nothing of the rate: the gaps are taken out, and the rate is told anew
        closed = pairs.copy()
        for gap in found:
            closed[pairs[:, 0] > gap.after_sample, 1] -= gap.seconds
        period, error = _period(closed)
    return ClockFindings(stated_rate, 1.0 / period, error, found)


def _period(pairs: Real) -> tuple[float, float]:
    """Host seconds a sample, and its relative standard error.

    The median slope between least late pairs of neighbouring windows: a gap spoils one slope, not the median.
    """
    rough = float(np.median(np.diff(pairs[:, 1])) / np.median(np.diff(pairs[:, 0])))
    chosen = pairs[_least_late_of_clock_check(pairs[:, 1] - rough * pairs[:, 0])]
    run, rise = np.diff(chosen[:, 0]), np.diff(chosen[:, 1])
    slopes = rise[run > 0] / run[run > 0]
    period = float(np.median(slopes)) if len(slopes) else float("nan")
    if not period > 0:
        return float("nan"), float("inf")
    spread = 1.4826 * float(np.median(np.abs(slopes - period))) + 1e-5 / float(np.median(run[run > 0]))
    error = 1.2533 * spread / np.sqrt(len(slopes)) / period
    if len(slopes) >= FEWEST_SLOPES:
        return period, error
    # of few slopes the spread says little: the usual lateness over the whole recording bounds the error
    late = pairs[:, 1] - period * pairs[:, 0]
    usual = float(np.quantile(late, 0.9) - late.min())
    return period, error + usual / (period * float(np.ptp(pairs[:, 0])))


def _least_late_of_clock_check(late: Real) -> NDArray[np.intp]:
    """Number of the least late pair in each of at most thirty windows."""
    windows = int(np.clip(len(late) // 8, 2, 30))
    return np.array([part[np.argmin(late[part])] for part in np.array_split(np.arange(len(late)), windows)])


def _gaps(pairs: Real, period: float) -> tuple[Gap, ...]:
    """Where no later pair comes back to the lateness of those before, and several keep the new one."""
    late = pairs[:, 1] - period * pairs[:, 0]
    best = late[_least_late_of_clock_check(late)]
    least = max(SMALLEST_GAP, TIMES_SCATTER * float(np.median(np.abs(np.diff(best)))))
    lowest_behind = np.minimum.accumulate(late[::-1])[::-1]
    rises = np.diff(lowest_behind)
    found = []
    for k in np.flatnonzero(rises > least):
        behind = late[k + 1 : k + 1 + AROUND]
        if np.sum(behind < lowest_behind[k + 1] + least) >= FEWEST:
            found.append(Gap(int(pairs[k, 0]), float(rises[k])))
    return tuple(found)
