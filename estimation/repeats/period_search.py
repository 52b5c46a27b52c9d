"""The period of forces: where in a recording they repeat, and after how many samples, fractions included."""

from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import Complex, InputError, Real

from ..settings import PERIODS
from ..spectra.trusted_samples import runs_of_true


@dataclass(frozen=True)
class Stretch:
    """Part of a recording over which the forces repeat: one realisation."""

    start: int  # number of the first sample, counted from 0
    n_periods: int  # whole periods


@dataclass(frozen=True)
class RepeatedForce:
    """Period of the forces of a recording, and the stretches in which the forces repeat, in the order of time."""

    period: float  # samples; a whole number where its fraction is not significant
    error: float  # standard error of the period, samples
    stretches: tuple[Stretch, ...]


def repeat_of(force: Real, least: int, most: int) -> int | None:
    """Find the shortest lag after which forces repeat.

    Parameters
    ----------
    force : (n_samples, n_excitations)
        Forces, any unit.
    least, most : samples
        Shortest and longest lag.

    Returns
    -------
    int or None
        Lag in samples; None where the forces do not repeat.

    Examples
    --------
    >>> saw = np.tile(np.random.default_rng(0).normal(size=(500, 1)), (6, 1))
    >>> repeat_of(saw, 100, 1500), repeat_of(np.random.default_rng(1).normal(size=(3000, 1)), 100, 1500)
    (500, None)
    """
    if least >= most:
        return None
    correlation = _correlation(force, least, most)
    runs = runs_of_true(correlation > PERIODS.alike)
    if not runs:
        return None
    start, stop = runs[0]  # later runs are multiples of the period
    return int(least + start + np.argmax(correlation[start:stop]))


def find_repeats(force: Real, least: int | None = None, most: int | None = None) -> RepeatedForce | None:
    """Find the period of forces and the stretches over which they repeat with it.

    Forces repeat after a lag L where ``<f(t) f(t + L)> > 0.99 <f^2>`` over a quarter of L. The period is the shortest
    of these lags whose misfit is at most three times the smallest misfit: nearly periodic forces have shorter lags with
    a larger misfit. The phase of the cross spectrum of a stretch and the samples m periods later, ``-w (L m - T m)``,
    gives the fraction of a sample (Bendat & Piersol, Random Data, 4th ed., section 5.2).

    Parameters
    ----------
    force : (n_samples, n_excitations)
        Forces, any unit.
    least, most : samples
        Shortest and longest lag; None: 64 samples or 1/128 of the recording, and half of it.

    Returns
    -------
    RepeatedForce or None
        None where the forces do not repeat.

    Raises
    ------
    InputError
        Forces that are not (n_samples, n_excitations).

    Examples
    --------
    >>> saw = np.tile(np.random.default_rng(0).normal(size=(500, 1)), (6, 1))
    >>> repeated = find_repeats(saw)
    >>> repeated.period, repeated.stretches
    (500.0, (Stretch(start=0, n_periods=6),))
    """
    if force.ndim != 2:
        raise InputError(f"forces have shape {force.shape}, expected (n_samples, n_excitations); give one column each")
    n = len(force)
    first, last = max(64, n // 128) if least is None else least, n // 2 if most is None else most
    if first >= last or not np.any(np.ptp(force, axis=0)):
        return None
    centred = force - force.mean(axis=0)
    examined = [_repeats_at(centred, lag) for lag in _candidate_lags(centred, first, last)]
    candidates = [candidate for candidate in examined if candidate is not None]
    if not candidates:
        return None
    best = min(misfit for misfit, _ in candidates)
    return next(repeated for misfit, repeated in candidates if misfit <= 3 * best + 1e-12)


def _correlation(force: Real, least: int, most: int) -> Real:
    """Return the correlation of forces with themselves at the lags from ``least`` to ``most``."""
    centred = force - force.mean(axis=0)
    n = scipy.fft.next_fast_len(2 * len(centred), real=True)  # zeros prevent circular correlation
    own = np.sum(scipy.fft.irfft(np.abs(scipy.fft.rfft(centred, n=n, axis=0)) ** 2, n=n, axis=0), axis=1)[: most + 1]
    energy = np.concatenate([[0.0], np.cumsum(np.sum(centred**2, axis=1))])
    lags = np.arange(least, most + 1)
    # normalised by the overlapping parts: forces that begin late or end early still reach 1
    overlap = np.sqrt(energy[len(centred) - lags] * (energy[-1] - energy[lags]))
    return np.asarray(own[least:] / np.maximum(overlap, 1e-300))


def _candidate_lags(force: Real, least: int, most: int) -> list[int]:
    """Return the lags of the highest and of the first high peaks of the correlation, rising."""
    correlation = _correlation(force, least, most)
    padded = np.concatenate([[-1.0], correlation, [-1.0]])
    is_peak = (padded[1:-1] >= padded[:-2]) & (padded[1:-1] > padded[2:])
    peaks = np.flatnonzero(is_peak & (correlation > PERIODS.candidate))
    if not len(peaks):
        return []
    # the shortest high lags are examined as well: the highest peaks may all be multiples of the period
    high = peaks[correlation[peaks] > correlation[peaks].max() - 0.1]
    highest = peaks[np.argsort(-correlation[peaks])[: PERIODS.lags // 2]]
    return [int(least + k) for k in np.unique(np.concatenate([high[: PERIODS.lags // 2], highest]))]


def _repeats_at(force: Real, lag: int) -> tuple[float, RepeatedForce] | None:
    """Return the misfit at a lag, and the period with its stretches; None where no two periods are alike."""
    period, error = _period_by_phase(force[:-lag], force[lag:], lag, 1)
    # slow forces resemble themselves at any short lag; their phase then gives another period, or NaN
    if not abs(period - lag) <= PERIODS.period_error * lag:
        return None
    misfit, runs = _runs(force, period)
    stretches = [stretch for stretch in (_stretch(*run, period) for run in runs) if stretch.n_periods >= 2]
    if not stretches:
        return None
    longest = max(stretches, key=lambda stretch: stretch.n_periods)
    m = 1
    while True:  # the fraction of a sample is twice as precise at a lag of twice as many periods
        far = round(m * period)
        segment = force[longest.start : longest.start + round(longest.n_periods * period)]
        if len(segment) - far < _width(period):
            if m == 1:  # slow forces: there are two periods only because of the tolerance of the ends
                return None
            break
        period, error = _period_by_phase(segment[:-far], segment[far:], far, m)
        if 2 * m >= longest.n_periods:
            break
        m *= 2
    if abs(period - round(period)) <= max(3 * error, 1e-6):
        period = float(round(period))
    placed = [_best_place(_stretch(*run, period), force, period) for run in runs]
    return misfit, RepeatedForce(period, error, tuple(stretch for stretch in placed if stretch.n_periods >= 2))


def _stretch(first: int, last: int, period: float) -> Stretch:
    """Return the whole periods in the middle of a run of samples, whose ends are uncertain by :func:`_tolerance`."""
    n_periods = int((last - first + _tolerance(period) + 0.5) // period)
    return Stretch(max(0, round((first + last - n_periods * period) / 2)), n_periods)


def _best_place(stretch: Stretch, force: Real, period: float) -> Stretch:
    """Move a stretch within the tolerance to where its periods are most alike, and into the recording."""
    last, lag = int(len(force) - stretch.n_periods * period + 0.5), round(period)
    if last < 0:
        return Stretch(0, stretch.n_periods - 1)
    tolerance = int(_tolerance(period)) + 1
    starts = np.arange(max(0, min(stretch.start - tolerance, last)), min(stretch.start + tolerance, last) + 1)
    later = _advanced(force, period - lag)[lag:]
    total = np.concatenate([[0.0], np.cumsum(np.sum((later - force[: len(later)]) ** 2, axis=1))])
    length = round((stretch.n_periods - 1) * period)
    misfit = total[np.minimum(starts + length, len(total) - 1)] - total[starts]
    return Stretch(int(starts[np.argmin(misfit)]), stretch.n_periods)


def _tolerance(period: float) -> float:
    """Return by how many samples both ends of a run together are uncertain: the share of a window that may differ."""
    return 2 * (1 - PERIODS.alike) * _width(period)


def _width(period: float) -> int:
    """Return the length of the window (samples) in which forces are compared."""
    return max(8, round(period) // 4)


def _period_by_phase(first: Real, later: Real, lag: int, m: int) -> tuple[float, float]:
    """Estimate the period and its standard error (samples) from the phase of two segments m periods apart.

    The second segment begins ``lag`` samples after the first.
    """
    window = np.hanning(len(first))[:, None]
    n = scipy.fft.next_fast_len(len(first) + len(first) % 2, real=True)
    n += n % 2  # the last line then lies at half the sample rate
    a, b = (scipy.fft.rfft((x - x.mean(axis=0)) * window, n=n, axis=0) for x in (first, later))
    cross: Complex = np.sum(np.conj(a) * b, axis=1)
    w = np.pi * np.arange(len(cross)) / (len(cross) - 1)
    size = np.abs(cross)
    size[size < 1e-4 * size.max()] = 0.0  # lines that were not excited hold only noise
    angle = np.angle(cross)
    scale = max(float(np.sum(w**2 * size)), 1e-300)
    delay = -float(np.sum(w * size * angle)) / scale
    residual = angle + w * delay
    error = float(np.sqrt(np.sum((w * size * residual) ** 2))) / scale
    return (lag + delay) / m, error / m


def _runs(force: Real, period: float) -> tuple[float, list[tuple[int, int]]]:
    """Return the mean misfit where forces repeat after ``period``, and the runs of samples [first, last) there."""
    lag = round(period)
    later = _advanced(force, period - lag)[lag:]
    first = force[: len(later)]
    width = _width(period)
    error = _moving_mean(np.sum((later - first) ** 2, axis=1), width)
    power = _moving_mean(np.sum(later**2 + first**2, axis=1), width)
    # silence repeats after any time
    loud = power > PERIODS.silent_power * 2 * np.mean(np.sum(force**2, axis=1))
    misfit = np.where(loud, error / np.maximum(power, 1e-300), np.inf)
    alike = misfit < 1 - PERIODS.alike
    if not alike.any():
        return np.inf, []
    runs = [(start, stop - 1 + width + lag) for start, stop in runs_of_true(alike)]
    return float(misfit[alike].mean()), runs


def _moving_mean(values: Real, width: int) -> Real:
    total = np.concatenate([[0.0], np.cumsum(values)])
    return np.asarray(total[width:] - total[:-width]) / width


def _advanced(signals: Real, samples: float) -> Real:
    """Return the values that signals (n_samples, n) have a fraction of a sample later; zeros beyond the edges."""
    if abs(samples) < 1e-9:
        return signals
    n = scipy.fft.next_fast_len(len(signals) + 64, real=True)  # zeros between the last sample and the first
    w = 2 * np.pi * np.fft.rfftfreq(n)
    moved = scipy.fft.irfft(scipy.fft.rfft(signals, n=n, axis=0) * np.exp(1j * w * samples)[:, None], n=n, axis=0)
    return np.asarray(moved[: len(signals)])
