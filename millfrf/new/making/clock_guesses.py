"""`guessed_clock`: the key of a mapping that tells the sample rate, or the question that the file leaves open."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .questions import Question

_RATES = {
    *("fs", "samplerate", "samplingrate", "srate", "rate", "samplefrequency", "samplingfrequency"),
    *("samplefreq", "samplingfreq", "abtastrate", "abtastfrequenz"),
}
"""Names of rates, without their underscores."""

_LIKE_RATES = re.compile(r"freq|rate|sampl|abtast|hz|^f_?s|^dt$|^ts$|delta_?t|interval", re.IGNORECASE)
_TIME = re.compile(r"(?:t|time|times|zeit|timestamp)(?:[\s_]?(?:s|ms|us|\d+))?")
_TIME_UNITS = {"s": "s", "sec": "s", "ms": "ms", "us": "us", "µs": "us", "μs": "us"}
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
LEAST_RATE, LARGEST_RATE = 100.0, 5e6
"""Hz. Rates between which a time without a unit is taken for seconds, and a rate without one for Hz."""

_EVEN, _AGREED = 0.01, 0.01
"""Departure of a time from an even raster, and of two rates from each other, as shares."""


@dataclass(frozen=True)
class TimeColumn:
    """A column or array that a name calls time.

    Parameters
    ----------
    name
        Name as the mapping gives it.
    unit
        Unit that the file states; empty: none.
    values : (n_samples,)
        Its values, in that unit.
    """

    name: str
    unit: str
    values: NDArray[np.float64]


def is_time(name: str, values: Any) -> bool:
    """Whether a column is one of times: by its name, and for a name such as ``t1`` by values that rise evenly."""
    plain = name.rpartition(".")[2].strip().lower()
    if plain in ("time", "times", "zeit", "timestamp"):
        return True
    return _TIME.fullmatch(plain) is not None and _even_step(np.asarray(values).reshape(-1)) > 0


def guessed_clock(times: Sequence[TimeColumn], fields: Mapping[str, Any], beside: str = "") -> dict[str, Any]:
    """The key that tells the sample rate: ``time`` with its unit, or ``sample_rate``; or a question.

    Parameters
    ----------
    times
        Columns and arrays of times.
    fields
        All that the file holds, by name; a single number of the right name is a rate.
    beside
        What else may help whoever answers the question.
    """
    rates = {name: float(np.ravel(values)[0]) for name, values in fields.items() if _is_rate(name, values)}
    if len(times) > 1:
        names = " or ".join(one.name for one in times)
        return {"time": Question(f"which is the time of the samples, {names}")}
    if len(rates) > 1:
        return {"sample_rate": Question(f"which is the rate of the samples in Hz, {' or '.join(rates)}")}
    if times:
        found = _of_time(times[0])
        rate = next(iter(rates.values()), None)
        if rate is not None and "time_unit" in found:
            measured = 1 / (_even_step(times[0].values) * _SECONDS[found["time_unit"]])
            if abs(measured / rate - 1) > _AGREED:
                asked = f"{times[0].name} says {measured:.6g} Hz, {next(iter(rates))} {rate:g}: which is it"
                return {"sample_rate": Question(asked)}
        return found
    for name, rate in rates.items():
        if LEAST_RATE <= rate <= LARGEST_RATE:
            return {"sample_rate": name}
        return {"sample_rate": Question(f"the file says {name} = {rate:g}: how many samples a second are that")}
    return {"sample_rate": Question(f"how many samples a second{_candidates(fields) or beside}")}


def _of_time(time: TimeColumn) -> dict[str, Any]:
    step = _even_step(time.values)
    if not step > 0:
        return {"sample_rate": Question(f"{time.name} does not rise evenly: how many samples a second")}
    stated = time.unit or _unit_of_name(time.name)
    if stated:
        unit = _TIME_UNITS.get(stated.strip().lower())
        if unit is None:
            return {"sample_rate": Question(f"{time.name} is in {stated}, steps {step:.6g}: how many samples a second")}
        return {"time": time.name, "time_unit": unit}
    if not LEAST_RATE <= 1 / step <= LARGEST_RATE:
        return {"time": Question(f"{time.name}, in steps of {step:.6g}: in which time_unit, s, ms or us")}
    return {"time": time.name, "time_unit": "s"}


def _unit_of_name(name: str) -> str:
    found = re.search(r"[\s_](s|ms|us)$", name.strip().lower())
    return found[1] if found else ""


def _is_rate(name: str, values: Any) -> bool:
    plain = re.sub(r"[\s_-]", "", re.split(r"[./]", name)[-1].lower())
    return plain in _RATES and _is_number(values)


def _is_number(values: Any) -> bool:
    numeric = np.issubdtype(np.asarray(values).dtype, np.number) and not np.iscomplexobj(values)
    return np.size(values) == 1 and numeric and bool(np.isfinite(np.ravel(values)[0]))


def _candidates(fields: Mapping[str, Any]) -> str:
    """Single numbers whose name or size is that of a rate or a step of time, as a hint behind the question."""
    shown = []
    for name, values in fields.items():
        number = float(np.ravel(values)[0]) if _is_number(values) else 0.0
        if number <= 0 or not _LIKE_RATES.search(re.split(r"[./]", name)[-1]):
            continue
        if LEAST_RATE <= number <= LARGEST_RATE:
            shown.append(f"{name} = {number:.10g}?")
        elif LEAST_RATE <= 1 / number <= LARGEST_RATE:
            shown.append(f"1/{name} = {1 / number:.10g}?")
    return f"; {', '.join(shown)}" if shown else ""


def even_step(values: Any) -> float:
    """Step of values that rise evenly, else 0."""
    return _even_step(np.asarray(values).reshape(-1))


def _even_step(values: NDArray[Any]) -> float:
    if len(values) < 3 or not np.issubdtype(values.dtype, np.number) or np.iscomplexobj(values):
        return 0.0
    steps = np.diff(values.astype(float))
    mean = float(steps.mean())
    if not (np.isfinite(steps).all() and mean > 0):
        return 0.0
    return mean if float(np.abs(steps / mean - 1).max()) <= _EVEN else 0.0
