"""The period of forces: where in a recording they repeat, after how many samples, fractions included."""

from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import InputError, Real

ALIKE = 0.99
"""Correlation of the forces with themselves a lag later from which they repeat."""

CANDIDATE = 0.2
"""Correlation over the whole recording from which a lag is looked at: several realisations share it."""

SILENT = 1e-3
"""Share of the mean power below which a force says nothing of its period."""

TRIED = 12
"""Number of lags that are looked at closely."""

NEAR = 0.1
"""Share by which the period from the phase may differ from the lag at which forces are alike."""


@dataclass(frozen=True)
class Stretch:
    """Part of a recording over which the forces repeat: one realisation.

    Parameters
    ----------
    start
        Number of the first sample, counted from 0.
    n_periods
        Number of whole periods.
    """

    start: int
    n_periods: int


@dataclass(frozen=True)
class RepeatedForce:
    """Period of the forces of a recording.

    Parameters
    ----------
    period : samples
        Length of a period; whole where its fraction cannot be told from none.
    error : samples
        Standard error of the period.
    stretches
        Parts in which the forces repeat, one behind the other.
    """

    period: float
    error: float
    stretches: tuple[Stretch, ...]


def repeat_of(force: Real, least: int, most: int) -> int | None:
    """Lag (samples) from ``least`` to ``most`` after which forces (n_samples, n) are the same again; None if none is.

    Examples
    --------
    >>> saw = np.tile(np.random.default_rng(0).normal(size=(500, 1)), (6, 1))
    >>> repeat_of(saw, 100, 1500), repeat_of(np.random.default_rng(1).normal(size=(3000, 1)), 100, 1500)
    (500, None)
    """
    if least >= most:
        return None
    likeness = _likeness(force, least, most)
    alike = np.flatnonzero(likeness > ALIKE)
    if not len(alike):
        return None
    run = alike[: 1 + int(np.argmax(np.diff(alike, append=alike[-1] + 2) > 1))]
    return int(least + run[np.argmax(likeness[run])])


def find_repeats(force: Real, least: int | None = None, most: int | None = None) -> RepeatedForce | None:
    """Find the period of forces and the stretches over which they keep it; None where they do not repeat.

    A lag L repeats where ``<f(t) f(t + L)> > .99 <f^2>`` over a quarter of it. Of the lags that repeat the shortest is
    taken whose misfit is no worse than three times the best: nearly periodic forces have shorter lags that fit worse.
    The phase of the cross spectrum of a stretch and of the same m periods later, ``-w (L m - T m)``, gives the fraction
    of a sample (Bendat & Piersol, Random Data, 4th ed., section 5.2).

    Parameters
    ----------
    force : (n_samples, n_excitations)
        Forces, any unit.
    least, most : samples
        Shortest and longest lag looked for; None: 64 samples or 1/128 of the recording, and half of it.

    Raises
    ------
    InputError
        Forces that are not (n_samples, n_excitations).

    Examples
    --------
    >>> saw = np.tile(np.random.default_rng(0).normal(size=(500, 1)), (6, 1))
    >>> found = find_repeats(saw)
    >>> found.period, found.stretches
    (500.0, (Stretch(start=0, n_periods=6),))
    """
    if force.ndim != 2:
        raise InputError(f"forces have shape {force.shape}, expected (n_samples, n_excitations); give one column each")
    n = len(force)
    first, last = max(64, n // 128) if least is None else least, n // 2 if most is None else most
    if first >= last or not np.any(np.ptp(force, axis=0)):
        return None
    centred = force - force.mean(axis=0)
    tried = [_looked_at(centred, lag) for lag in _candidates(centred, first, last)]
    good = [one for one in tried if one is not None]
    if not good:
        return None
    best = min(misfit for misfit, _ in good)
    return next(found for misfit, found in good if misfit <= 3 * best + 1e-12)


def _likeness(force: Real, least: int, most: int) -> Real:
    """Correlation of forces with themselves at the lags from ``least`` to ``most``."""
    centred = force - force.mean(axis=0)
    n = scipy.fft.next_fast_len(2 * len(centred), real=True)
    own = np.sum(scipy.fft.irfft(np.abs(scipy.fft.rfft(centred, n=n, axis=0)) ** 2, n=n, axis=0), axis=1)[: most + 1]
    energy = np.concatenate([[0.0], np.cumsum(np.sum(centred**2, axis=1))])
    lags = np.arange(least, most + 1)
    overlap = np.sqrt(energy[len(centred) - lags] * (energy[-1] - energy[lags]))
    return np.asarray(own[least:] / np.maximum(overlap, 1e-300))


def _candidates(force: Real, least: int, most: int) -> list[int]:
    """Lags where the forces are most like themselves, rising."""
    likeness = _likeness(force, least, most)
    padded = np.concatenate([[-1.0], likeness, [-1.0]])
    peaks = np.flatnonzero((padded[1:-1] >= padded[:-2]) & (padded[1:-1] > padded[2:]) & (likeness > CANDIDATE))
    if not len(peaks):
        return []
    near = peaks[likeness[peaks] > likeness[peaks].max() - 0.1]
    strongest = peaks[np.argsort(-likeness[peaks])[: TRIED // 2]]
    return [int(least + k) for k in np.unique(np.concatenate([near[: TRIED // 2], strongest]))]


def _looked_at(force: Real, lag: int) -> tuple[float, RepeatedForce] | None:
    """Misfit at a lag, and the period with its stretches; None where no two periods are alike."""
    period, error = _refined(force[:-lag], force[lag:], lag, 1)
    if not abs(period - lag) <= NEAR * lag:  # alike because they are slow: the phase knows of no such period
        return None
    misfit, runs = _runs(force, period)
    stretches = [one for one in (_stretch(a, b, period) for a, b in runs) if one.n_periods >= 2]
    if not stretches:
        return None
    longest = max(stretches, key=lambda one: one.n_periods)
    m = 1
    while True:  # a lag of twice as many periods says the fraction twice as well
        far = round(m * period)
        first = force[longest.start : longest.start + round(longest.n_periods * period)]
        if len(first) - far < _width(period):  # slow forces: two periods by the slack of their ends alone
            if m == 1:
                return None
            break
        period, error = _refined(first[:-far], first[far:], far, m)
        if 2 * m >= longest.n_periods:
            break
        m *= 2
    if abs(period - round(period)) <= max(3 * error, 1e-6):
        period = float(round(period))
    again = [_placed(_stretch(a, b, period), force, period) for a, b in runs]
    return misfit, RepeatedForce(period, error, tuple(one for one in again if one.n_periods >= 2))


def _stretch(first: int, last: int, period: float) -> Stretch:
    """Whole periods in the middle of a run: its ends are known to the share of a window that may differ."""
    n_periods = int((last - first + _slack(period) + 0.5) // period)
    return Stretch(max(0, round((first + last - n_periods * period) / 2)), n_periods)


def _placed(stretch: Stretch, force: Real, period: float) -> Stretch:
    """The same number of periods, moved by the slack to where they are most alike and inside the recording."""
    last, lag = int(len(force) - stretch.n_periods * period + 0.5), round(period)
    if last < 0:
        return Stretch(0, stretch.n_periods - 1)
    slack = int(_slack(period)) + 1
    starts = np.arange(max(0, min(stretch.start - slack, last)), min(stretch.start + slack, last) + 1)
    later = _advanced(force, period - lag)[lag:]
    total = np.concatenate([[0.0], np.cumsum(np.sum((later - force[: len(later)]) ** 2, axis=1))])
    length = round((stretch.n_periods - 1) * period)
    misfit = total[np.minimum(starts + length, len(total) - 1)] - total[starts]
    return Stretch(int(starts[np.argmin(misfit)]), stretch.n_periods)


def _slack(period: float) -> float:
    """Samples by which the ends of a run may be off together."""
    return 2 * (1 - ALIKE) * _width(period)


def _width(period: float) -> int:
    """Samples over which forces are compared."""
    return max(8, round(period) // 4)


def _refined(first: Real, later: Real, lag: int, m: int) -> tuple[float, float]:
    """Period and its standard error (samples) from the phase of two stretches ``lag``, about m periods, apart."""
    window = np.hanning(len(first))[:, None]
    n = scipy.fft.next_fast_len(len(first) + len(first) % 2, real=True)
    a, b = (scipy.fft.rfft((x - x.mean(axis=0)) * window, n=n + n % 2, axis=0) for x in (first, later))
    cross = np.sum(np.conj(a) * b, axis=1)
    w = np.pi * np.arange(len(cross)) / (len(cross) - 1)
    size = np.abs(cross)
    size[size < 1e-4 * size.max()] = 0.0  # lines that were not excited hold noise alone
    angle = np.angle(cross)
    scale = max(float(np.sum(w**2 * size)), 1e-300)
    delay = -float(np.sum(w * size * angle)) / scale
    rest = angle + w * delay
    error = float(np.sqrt(np.sum((w * size * rest) ** 2))) / scale
    return (lag + delay) / m, error / m


def _runs(force: Real, period: float) -> tuple[float, list[tuple[int, int]]]:
    """Mean misfit where forces repeat after ``period``, and the runs of samples [first, last) that do."""
    lag = round(period)
    later = _advanced(force, period - lag)[lag:]
    first = force[: len(later)]
    width = _width(period)
    error = _moving_mean(np.sum((later - first) ** 2, axis=1), width)
    power = _moving_mean(np.sum(later**2 + first**2, axis=1), width)
    loud = power > SILENT * 2 * np.mean(np.sum(force**2, axis=1))
    misfit = np.where(loud, error / np.maximum(power, 1e-300), np.inf)
    alike = misfit < 1 - ALIKE
    if not alike.any():
        return np.inf, []
    edges = np.flatnonzero(np.diff(np.concatenate([[False], alike, [False]]).astype(int)))
    runs = [(int(a), int(b) - 1 + width + lag) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return float(misfit[alike].mean()), runs


def _moving_mean(values: Real, width: int) -> Real:
    total = np.concatenate([[0.0], np.cumsum(values)])
    return np.asarray(total[width:] - total[:-width]) / width


def _advanced(signals: Real, samples: float) -> Real:
    """Signals (n_samples, n) a fraction of a sample later in time; zeros stand beyond its edges."""
    if abs(samples) < 1e-9:
        return signals
    n = scipy.fft.next_fast_len(len(signals) + 64, real=True)  # zeros stand between the last sample and the first
    w = 2 * np.pi * np.fft.rfftfreq(n)
    moved = scipy.fft.irfft(scipy.fft.rfft(signals, n=n, axis=0) * np.exp(1j * w * samples)[:, None], n=n, axis=0)
    return np.asarray(moved[: len(signals)])
