"""Frequency of a force line that sweeps evenly, such as the passing of teeth while the spindle speeds up."""

import numpy as np
import scipy

from millfrf.core import Real

N_WINDOWS = 24  # least windows over a recording, which overlap by half; a line may move by a few lines within each
MOST_LINES = 700  # lines of a window: a longer recording has more windows
CHANCE = 1e-6  # chance that noise alone has a line that stands out as much, over all possible lines
LEAST_CHANGE = 4.0  # change from beginning to end, in lines of a window, below which a line does not sweep
BLOCK = 64  # beginnings of courses that are added up together

# mean and standard deviation of the logarithm of an exponentially distributed power over its mean
LOG_MEAN, LOG_DEVIATION = -float(np.euler_gamma), float(np.pi / np.sqrt(6))


def swept_line(force: Real, rate: float) -> tuple[float, float] | None:
    """Find the strongest line of the forces whose frequency changes evenly from beginning to end.

    The logarithm of the power of each window and line, relative to its median over time and over frequency, is averaged
    along all straight courses of the frequency (a Radon transform of the spectrogram). Without a line it is the average
    of the logarithms of exponentially distributed powers.

    Parameters
    ----------
    force : (n_samples, n_forces), SI
        Samples of the forces; their powers are added.
    rate : Hz
        Samples in a second of each force.

    Returns
    -------
    tuple[float, float] or None
        Frequency at the beginning and at the end, Hz; None where no line stands out from noise, or it does not sweep.

    Examples
    --------
    >>> time = np.arange(8192) / 256
    >>> noise = np.random.default_rng(1).normal(size=8192)
    >>> line = 3 * np.sin(2 * np.pi * (12 + 0.25 * time) * time)  # 12 Hz at the beginning, 28 Hz at the end
    >>> [round(frequency, 1) for frequency in swept_line((noise + line)[:, None], 256)]
    [12.0, 28.0]
    >>> swept_line(noise[:, None], 256) is None
    True
    """
    count = max(N_WINDOWS, -(-len(force) // (2 * MOST_LINES)))
    length = 2 * (len(force) // (2 * count))
    if length < 2 * N_WINDOWS:
        return None
    logarithms, shares = _logarithms(force, length)
    averages = _along_courses(logarithms, shares)
    best = np.unravel_index(np.argmax(averages), averages.shape)
    needed = LOG_MEAN + LOG_DEVIATION / np.sqrt(count) * scipy.stats.norm.isf(CHANCE / averages.size)
    if averages[best] < needed or abs(float(best[1]) - float(best[0])) < LEAST_CHANGE:
        return None
    start, end = _refined(force, length, np.array(best, dtype=float)) * rate / length
    return float(start), float(end)


def _windows(force: Real, length: int) -> tuple[Real, Real]:
    """Return the windows, (n_windows, n_forces, length), and their middles as shares of the recording."""
    centred = np.ascontiguousarray((force - force.mean(axis=0)).T)
    starts = np.arange(0, len(force) - length + 1, length // 2)
    windows = np.stack([centred[:, start : start + length] for start in starts]) * np.hanning(length)
    return windows, (starts + length / 2) / len(force)


def _logarithms(force: Real, length: int) -> tuple[Real, Real]:
    """Return the logarithms of the relative powers, (n_windows, n_lines), and the middles of the windows.

    Lines that are as strong at all times, and windows that are as strong at all lines, become noise.
    """
    windows, shares = _windows(force, length)
    power = np.sum(np.abs(scipy.fft.rfft(windows, axis=2)) ** 2, axis=1)
    power /= np.maximum(np.median(power, axis=0), 1e-300)
    power /= np.maximum(np.median(power, axis=1, keepdims=True), 1e-300) / np.log(2)
    return np.log(np.maximum(power, 1e-300)), shares


def _along_courses(logarithms: Real, shares: Real) -> Real:
    """Return the average along each course, (n_lines, n_lines): from the line of the row to that of the column."""
    n = logarithms.shape[1]
    ends, rows = np.arange(n), np.arange(len(shares))[:, None, None]
    averages = np.empty((n, n))
    for begin in range(0, n, BLOCK):
        starts = np.arange(begin, min(begin + BLOCK, n))
        lines = np.rint(starts[:, None] + shares[:, None, None] * (ends - starts[:, None])).astype(np.intp)
        averages[starts] = logarithms[rows, lines].mean(axis=0)
    return averages


def _refined(force: Real, length: int, course: Real) -> Real:
    """Return the course, (2,), in lines of a window, whose mean logarithm of power is largest near a given one.

    Each window is turned back by the phase of the course within it, so that the line does not smear.
    """
    windows, shares = _windows(force, length)
    samples = np.arange(length) - length / 2

    def lost(ends: Real) -> float:
        cycles = (ends[0] + shares * (ends[1] - ends[0])) / length  # for each sample
        rate = (ends[1] - ends[0]) / length / len(force)
        turn = np.exp(-2j * np.pi * (cycles[:, None] * samples + 0.5 * rate * samples**2))
        return -float(np.log(np.sum(np.abs(np.einsum("wck,wk->wc", windows, turn)) ** 2, axis=1)).mean())

    simplex = course + 0.25 * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    options = {"initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-6}
    return np.asarray(scipy.optimize.minimize(lost, course, method="Nelder-Mead", options=options).x)
