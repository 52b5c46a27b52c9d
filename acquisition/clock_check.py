r"""What a stream's clock pairs say of its samples: the true sample rate, and samples that are missing.

A pair says that the host noticed sample :math:`i` at the monotonic time :math:`t`; it is never early, only late. With
the true rate :math:`f`, :math:`t_k - i_k / f` is a constant plus the lateness of each pair. Where samples were lost
between two pairs, the constant rises by the time that they would have lasted, and stays there: the least late pair
behind the loss is later than the least late one before it. A computer that stalls comes back to its old lateness.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]

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
    chosen = pairs[_least_late(pairs[:, 1] - rough * pairs[:, 0])]
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


def _least_late(late: Real) -> NDArray[np.intp]:
    """Number of the least late pair in each of at most thirty windows."""
    windows = int(np.clip(len(late) // 8, 2, 30))
    return np.array([part[np.argmin(late[part])] for part in np.array_split(np.arange(len(late)), windows)])


def _gaps(pairs: Real, period: float) -> tuple[Gap, ...]:
    """Where no later pair comes back to the lateness of those before, and several keep the new one."""
    late = pairs[:, 1] - period * pairs[:, 0]
    best = late[_least_late(late)]
    least = max(SMALLEST_GAP, TIMES_SCATTER * float(np.median(np.abs(np.diff(best)))))
    lowest_behind = np.minimum.accumulate(late[::-1])[::-1]
    rises = np.diff(lowest_behind)
    found = []
    for k in np.flatnonzero(rises > least):
        behind = late[k + 1 : k + 1 + AROUND]
        if np.sum(behind < lowest_behind[k + 1] + least) >= FEWEST:
            found.append(Gap(int(pairs[k, 0]), float(rises[k])))
    return tuple(found)
