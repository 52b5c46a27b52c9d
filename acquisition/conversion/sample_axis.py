"""The axis of samples as it was measured: rate, start and gaps, from a column of times or from what a file states."""

import re
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from millfrf.core import SECONDS, FileFormatError, InputError, Real, counted

from ..settings import SETTINGS

_TIME_NAMES = re.compile(
    r"(?:(?:rel\.?|elapsed|unix|epoch|host)[ _]?)?(?:t|time|times|zeit|timestamp|x_value|datetime)"
    r"(?:[\s_]?(?:s|ms|us))?|s|secs?|seconds?|ms|us"
)


def is_time_name(heading: str) -> bool:
    """Return whether a heading or the name of an array is that of a time, without or with its unit.

    Examples
    --------
    >>> is_time_name("Time (s)"), is_time_name("rig.t"), is_time_name("t_ms"), is_time_name("torque")
    (True, True, True, False)
    """
    name = re.sub(r"\s*(?:[\[(].*|/ *\w+)$", "", heading.rpartition(".")[2].strip().lower())
    return _TIME_NAMES.fullmatch(name) is not None


def looks_like_clock(values: NDArray[np.generic]) -> bool:
    """Return whether a first column without a heading may be a clock: it never falls, or only back to its start."""
    steps = np.diff(np.asarray(values, dtype=float))
    if len(steps) < 2 or not np.isfinite(steps).all() or not (steps > 0).any():
        return False
    return bool((np.asarray(values, dtype=float)[1:][steps < 0] == float(values[0])).all())


@dataclass(frozen=True)
class Gap:
    """Missing samples: ``missing`` of them after ``row`` rows."""

    row: int
    missing: int


@dataclass(frozen=True)
class SampleAxis:
    """Axis of evenly spaced samples, and who says so.

    Parameters
    ----------
    rate : Hz
        Sample rate.
    start : s
        Time of the first sample.
    source
        Part of the file that states rate and start, for messages.
    gaps
        Missing samples between the rows.
    error
        Relative error of the rate by the digits of the times; 0 of a stated rate.
    """

    rate: float
    start: float
    source: str
    gaps: tuple[Gap, ...] = ()
    error: float = 0.0

    def gaps_text(self) -> str:
        """Say where samples are missing, and how long: ``60 samples (0.06 s) missing after row 700``."""
        first = self.gaps[0]
        more = f", and in {len(self.gaps) - 1} more places" if len(self.gaps) > 1 else ""
        return (
            f"{counted(first.missing, 'sample')} ({first.missing / self.rate:.6g} s) missing after row {first.row}"
            f"{more} ({self.source})"
        )


def measured_axis(
    stored: NDArray[np.generic],
    source: str,
    unit: str = "s",
    stated: float | None = None,
    resolution: float | None = None,
) -> SampleAxis:
    """Measure rate, start and gaps of a column of times.

    Each time must lie on one raster, ``t[k] = start + n[k] / rate`` with rising whole numbers ``n``, except for the
    digits with which times are printed and for 1 % of a step. A drift may shift no sample by half a step.

    Parameters
    ----------
    stored
        Times, (n_samples,).
    source
        Name of the column, for messages.
    unit
        Unit of the times, one of `SECONDS`.
    stated : Hz
        Rate that a mapping states: then single times may be off by up to half a step, as those that a computer stamps.
    resolution
        Last digit with which the times were printed; None: found from the numbers.

    Raises
    ------
    FileFormatError
        Times that fall, stand still, drift or leave the raster; the message names the row and both values.
    """
    times = np.asarray(stored).reshape(-1)
    if np.iscomplexobj(times) or len(times) < 2 or not np.isfinite(times.astype(float)).all():
        raise FileFormatError(f"{source}: needs two or more finite times; give sample_rate and take the column out")
    digits = (resolution or _resolution(times)) * SECONDS[unit]
    t = times.astype(float) * SECONDS[unit]
    steps = np.diff(t)
    row = int(np.argmin(steps))
    if steps[row] < -digits / 2 or t[-1] <= t[0]:
        raise FileFormatError(
            f"{source}: time falls from {t[row]:.9g} to {t[row + 1]:.9g} s after row {row + 1}: the clock restarts; "
            "convert the parts before and after it from files of their own"
        )
    step = float(np.median(steps))
    if _is_exact(steps, step):
        digits = float(np.spacing(np.abs(t).max()))
    coarse = step < SETTINGS.coarse_times * digits
    counts = np.ones(len(steps)) if coarse else np.maximum(np.rint(steps / step), 0)
    raster = np.concatenate([[0.0], np.cumsum(counts)])
    step = float((t[-1] - t[0]) / raster[-1])
    _require_raster(t, raster, step, digits, source, SETTINGS.largest_time_deviation if stated is None else 0.5)
    if raster[-1] > SETTINGS.largest_gaps * len(t):
        raise FileFormatError(
            f"{source}: {raster[-1] + 1 - len(t):.0f} samples are missing between {len(t)} rows; convert the parts "
            "between the gaps from files of their own"
        )
    gaps = tuple(Gap(int(k) + 1, int(counts[k]) - 1) for k in np.flatnonzero(counts > 1))
    error = float(digits / (t[-1] - t[0]))
    if stated is None and error > SETTINGS.largest_rate_error:
        raise FileFormatError(
            f"{source}: its digits ({digits:g} s) give the rate to {100 * error:.2g} % only, about {1 / step:.4g} Hz; "
            "give sample_rate, or export more digits"
        )
    return SampleAxis(_rounded_rate(1 / step, error), float(t[0]), source, gaps, error)


def _require_raster(t: Real, raster: Real, step: float, digits: float, source: str, deviation: float) -> None:
    """Refuse times off the raster: single steps of another length, and a drift that adds up to half a step."""
    steps, counts = np.diff(t), np.diff(raster)
    allowed = deviation * step + 1.01 * digits
    errors = np.where(counts < 1, np.inf, np.abs(steps - counts * step))
    if errors.max() > allowed:
        row = int(errors.argmax())
        raise FileFormatError(
            f"{source} is not evenly spaced: {steps[row]:.6g} s after row {row + 1}, {step:.6g} s on average, which is "
            "no whole number of steps; resample the data, or convert the parts before and after it from files of their "
            "own"
        )
    if digits > SETTINGS.largest_time_deviation * step:
        rest = t - np.polynomial.Polynomial.fit(raster, t, 1)(raster)
        if digits < np.ptp(rest) - 2 * deviation * step:
            raise FileFormatError(
                f"{source} is not evenly spaced: its times lie up to {np.ptp(rest) / 2:.6g} s off an even raster of "
                f"{step:.6g} s, more than their digits explain; resample the data"
            )
    shift = np.abs(t - t[0] - raster * step)
    if shift.max() > 0.5 * step + digits:
        n = max(1, len(steps) // 20)
        first, last = float(np.mean(steps[:n] / counts[:n])), float(np.mean(steps[-n:] / counts[-n:]))
        raise FileFormatError(
            f"{source}: its step drifts from {first:.6g} to {last:.6g} s ({100 * (last / first - 1):.2g} %), so that "
            f"row {int(shift.argmax()) + 1} lies {shift.max() / step:.2g} steps off an even raster; resample the data"
        )


def _is_exact(steps: Real, step: float) -> bool:
    """Return whether nearly all steps are equal and the few others whole multiples: times on a raster of their digits.

    They were computed, not rounded, so that a longer step is a gap.
    """
    counts = np.rint(steps / step) if step > 0 else np.zeros(len(steps))
    on_raster = np.abs(steps - counts * step) < 1e-4 * step
    return bool(on_raster.all()) and int((counts != 1).sum()) <= max(1, len(steps) // 100)


def _resolution(times: NDArray[np.generic]) -> float:
    """Return the distance of the numbers between which times of this size were rounded: digits of text, or bits."""
    values = times.astype(float)
    ends = np.concatenate(
        [values[:8], values[-8:]]
    )  # of times that rise the largest; smaller ones may have more digits
    largest = ends[np.argsort(np.abs(ends))[-8:]]
    spacing = float(np.spacing(np.abs(largest).max()))
    if np.array_equal(values, values.astype(np.float32).astype(float)) or times.dtype == np.float32:
        spacing = float(np.spacing(np.float32(np.abs(largest).max())))
    for digits in range(13):
        scaled = largest * 10.0**digits
        if np.abs(scaled - np.rint(scaled)).max() < 1e-3 and np.abs(scaled).max() < 1e12:
            return max(10.0**-digits, spacing)
    return spacing


def _rounded_rate(rate: float, error: float) -> float:
    """Return a whole number of Hz, or the inverse of a short decimal step, if it lies within the error of the rate.

    Times printed with few digits give 999.99999 Hz instead of 1000 Hz.
    """
    tolerance = min(max(error, 1e-6), SETTINGS.largest_rate_error)
    for candidate in (float(round(rate)), 1 / float(f"{1 / rate:.6g}")):
        if candidate > 0 and abs(candidate / rate - 1) < tolerance:
            return candidate
    return rate


def stated_rate(step: float) -> float:
    """Return the rate of a stated step (s): a whole number of Hz where the step is its rounded inverse."""
    rate = 1 / step
    return float(round(rate)) if round(rate) and abs(rate / round(rate) - 1) < 1e-9 else rate


def are_one_rate(first: SampleAxis, second: SampleAxis, n_samples: int) -> bool:
    """Return whether two rates are one by their errors, or keep their samples together until the last one."""
    allowed = max(SETTINGS.largest_shift / n_samples, first.error + second.error)
    return abs(first.rate / second.rate - 1) <= allowed


def agreed_axis(stated: float, axis: SampleAxis, *, unit_is_known: bool) -> SampleAxis:
    """Return an axis with the sample rate (Hz) that a mapping states; refuse a rate that its times contradict.

    Times of unknown unit, measured as if they were seconds, may be in s, ms or us, as the rate says.
    """
    for factor in (1.0,) if unit_is_known else (1.0, 1e3, 1e6):
        if abs(axis.rate * factor / stated - 1) < max(SETTINGS.largest_rate_error, axis.error):
            return replace(axis, rate=stated, start=axis.start / factor)
    raise InputError(
        f"sample_rate = {stated:g} Hz in the mapping, but {axis.source} says {axis.rate:.7g} Hz; leave "
        "sample_rate out, or correct it"
    )


@dataclass(frozen=True)
class Cut:
    """Rows of one channel that lie in the span common to all: the first row, and the time by which it lags."""

    first: int
    lag: float  # s; from 0 to one step


Key = TypeVar("Key", bound=Hashable)


def common_span(axes: Mapping[Key, SampleAxis], n_samples: int) -> tuple[float, dict[Key, Cut]]:
    """Return the latest start (s) of channels of one rate, and where each channel is cut so that it begins there.

    A channel whose samples fall between those of the latest one keeps the sample before, and lags by the rest of a
    step, which spectra compensate.

    Raises
    ------
    FileFormatError
        Channels without common time.
    """
    start = max(axis.start for axis in axes.values())
    cuts = {}
    for name, axis in axes.items():
        offset = (start - axis.start) * axis.rate
        first = int(np.floor(offset + SETTINGS.largest_shift))
        rest = offset - first
        cuts[name] = Cut(first, rest / axis.rate if rest > SETTINGS.largest_shift else 0.0)
    if max(cut.first for cut in cuts.values()) > n_samples - 2:
        early = min(axes, key=lambda name: axes[name].start)
        late = max(axes, key=lambda name: axes[name].start)
        raise FileFormatError(
            f"{early} begins at {axes[early].start:.9g} s and ends before {late} begins, at {axes[late].start:.9g} s: "
            "they have no common time; convert them separately"
        )
    return start, cuts
