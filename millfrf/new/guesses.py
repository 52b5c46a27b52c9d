"""Guesses of channels and clocks from the headings and units of a file, and questions where they do not suffice."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from millfrf.core import SI_UNITS, InputError, si_factor


@dataclass(frozen=True)
class Question:
    """A key that the user must fill in, with what must be known for it.

    Parameters
    ----------
    text
        The question, without a mark at its end.
    refused
        TOML value that the reading command refuses, for keys that it would otherwise fill in itself; empty: none.
    open
        Whether it must be answered; a key that may stay out carries the text without the mark.
    """

    text: str
    refused: str = ""
    open: bool = True


_UNIT = re.compile(r"^(?P<name>.*?)[\s_]*[\[(](?P<unit>[^\[\]()]+)[\])]\s*$")
_PLACES = {"tip": "TCP", "tcp": "TCP", "housing": "HOUSING", "spindle": "HOUSING"}
_TURNED = ("neg", "negative", "minus", "inv", "inverted")
_STEMS: Mapping[str, tuple[str, ...]] = {
    "force": ("hammer", "force", "kraft", "f"),
    "acceleration": ("acceleration", "beschleunigung", "accel", "acc", "a"),
    "velocity": ("velocity", "geschwindigkeit", "vel", "v"),
    "displacement": ("displacement", "weg", "disp", "d", "s"),
    "moment": ("moment", "torque", "m"),
}
"""Beginnings of names by quantity, longest first. A single letter counts only with an axis behind it: A1 may be a
joint, a1 an input, f1 a frequency."""

_AFTER_WORD, _AFTER_LETTER = r"[\s_.-]*[xyz]?[\s_.-]*\d*", r"[ _]?[xyz]\d*"
"""What may follow such a beginning: ``acc x 1``; ``fx``, ``fx1``."""

_TRIED = ("force", "acceleration", "velocity", "displacement", "moment", "voltage", "angular_velocity", "angle")
_PLACED = ("force", "moment", "acceleration", "velocity", "displacement")
_AXIS_ASKED = Question("along which axis does it count positive, such as +X, and at which node; else no FRF has it")
_COUNTS = "; its values are whole numbers: of a converter's counts give sensitivity (counts per unit) and offset too"


def split_heading(heading: str) -> tuple[str, str]:
    """Name and unit of a heading such as ``Fx [kN]``, ``acc (g)`` or ``Fx / kN``; where it has none the unit is empty.

    Examples
    --------
    >>> split_heading("Fx [kN]"), split_heading("Fx / kN"), split_heading("ax")
    (('Fx', 'kN'), ('Fx', 'kN'), ('ax', ''))
    """
    match = _UNIT.match(heading.strip())
    if match:
        return match["name"].strip(), match["unit"].strip()
    name, slash, unit = heading.partition("/")
    if slash and (
        unit.strip() in ("s", "ms", "us", "µs") or any(_is_unit(quantity, unit.strip()) for quantity in _TRIED)
    ):
        return name.strip(), unit.strip()
    return heading.strip(), ""


def guessed_channel(heading: str, unit: str = "", *, whole: bool = False) -> dict[str, Any]:
    """Keys of a mapping's channel that follow from heading and unit, and a question for each other key.

    A unit gives the quantity; without a unit the name does, and the unit is asked. Where name and unit contradict each
    other both are asked.

    Parameters
    ----------
    heading
        Heading of the column, or name of the array.
    unit
        Unit that stands elsewhere, such as in a row below; empty: none.
    whole
        Whether all values are whole numbers, as a converter counts them.

    Examples
    --------
    >>> guessed_channel("Fx", "kN")
    {'name': 'Fx', 'quantity': 'force', 'unit': 'kN', 'node': 'TCP', 'direction': '+X'}
    >>> guessed_channel("Fx", "g")["unit"].text
    'the name says force, g is a unit of acceleration: which is it'
    """
    name, bracketed = split_heading(heading)
    unit = unit or bracketed
    quantity, asked = _quantity(name, unit)
    keys: dict[str, Any] = {"name": name or heading.strip() or "channel"}
    keys["quantity"] = quantity or Question(asked or "what does it measure")
    if unit and not asked:
        keys["unit"] = unit
    else:
        keys["unit"] = Question((asked or "in which unit are its values") + (_COUNTS if whole else ""))
    return keys | _place(name, quantity)


def _quantity(name: str, unit: str) -> tuple[str, str]:
    """Quantity, empty where it is open; and the question on quantity and unit, empty where they agree."""
    named = _of_name(name)
    if not unit:
        return named, ""
    fitting = [quantity for quantity in _TRIED if _is_unit(quantity, unit)]
    if named in fitting or (not named and len(fitting) == 1):
        return named or fitting[0], ""
    if not fitting:
        hint = ", if it turns so: rpm" if unit in ("1/min", "min-1", "min^-1", "/min") else ""
        return named, f"the file says {unit}, which is no unit that is known here{hint}: how is it written"
    if not named:
        return "", f"{unit} is a unit of {' or '.join(fitting)}: which is it"
    if unit.endswith("V"):
        return "", f"the name says {named}, the values are in {unit}: give {named}, its unit and sensitivity"
    return "", f"the name says {named}, {unit} is a unit of {' or '.join(fitting)}: which is it"


def _place(name: str, quantity: str) -> dict[str, Any]:
    """Node and direction that follow from the name; a direction whose sign is in doubt is asked."""
    words = [word.lower() for word in re.split(r"[^A-Za-z]+", name) if word]
    axes = {axis for word in words if (axis := _axis(word))}
    places = {_PLACES[word] for word in words if word in _PLACES}
    if len(axes) != 1 or len(places) > 1 or not (places or quantity in _PLACED):
        return {"direction": _AXIS_ASKED} if quantity in _PLACED else {}
    axis = axes.pop()
    node = places.pop() if places else "TCP" if quantity in ("force", "moment") else "HOUSING"
    if re.search(rf"-\w*{axis}(?![A-Za-z])", name, re.IGNORECASE) or any(word in _TURNED for word in words):
        return {"node": node, "direction": Question(f"does it count positive along +{axis} or -{axis}", '"?"')}
    return {"node": node, "direction": f"+{axis}"}


def _axis(word: str) -> str:
    """The axis that a word of a name is, or ends on behind a quantity: ``x``, ``fx``, ``accx``."""
    stems = [stem for group in _STEMS.values() for stem in group]
    return word[-1].upper() if word[-1] in "xyz" and (word[:-1] in stems or len(word) == 1) else ""


def _is_unit(quantity: str, unit: str) -> bool:
    try:
        si_factor(quantity, unit)
    except InputError:
        return False
    return True


def _of_name(name: str) -> str:
    plain = re.sub(r"^(?:tip|tcp|housing|spindle)[\s_.-]+", "", name.strip().lower())
    for quantity, stems in _STEMS.items():
        for stem in stems:
            ending = _AFTER_WORD if len(stem) > 1 else _AFTER_LETTER
            if plain.startswith(stem) and re.fullmatch(ending, plain.removeprefix(stem)):
                return quantity
    return "" if plain not in SI_UNITS else plain


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
    """Whether a column holds times: by its name, and for a name such as ``t1`` by values that rise evenly."""
    plain = name.rpartition(".")[2].strip().lower()
    if plain in ("time", "times", "zeit", "timestamp"):
        return True
    return _TIME.fullmatch(plain) is not None and _even_step(np.asarray(values).reshape(-1)) > 0


def guessed_clock(times: Sequence[TimeColumn], fields: Mapping[str, Any], hint: str = "") -> dict[str, Any]:
    """The key that gives the sample rate: ``time`` with its unit, or ``sample_rate``; or a question.

    Parameters
    ----------
    times
        Columns and arrays of times.
    fields
        All that the file holds, by name; a single number of the right name is a rate.
    hint
        Further hint for whoever answers the question.
    """
    rates = {name: float(np.ravel(values)[0]) for name, values in fields.items() if _is_rate(name, values)}
    if len(times) > 1:
        names = " or ".join(time.name for time in times)
        return {"time": Question(f"which is the time of the samples, {names}")}
    if len(rates) > 1:
        return {"sample_rate": Question(f"which is the rate of the samples in Hz, {' or '.join(rates)}")}
    if times:
        keys = _of_time(times[0])
        rate = next(iter(rates.values()), None)
        if rate is not None and "time_unit" in keys:
            measured = 1 / (_even_step(times[0].values) * _SECONDS[keys["time_unit"]])
            if abs(measured / rate - 1) > _AGREED:
                asked = f"{times[0].name} says {measured:.6g} Hz, {next(iter(rates))} {rate:g}: which is it"
                return {"sample_rate": Question(asked)}
        return keys
    for name, rate in rates.items():
        if LEAST_RATE <= rate <= LARGEST_RATE:
            return {"sample_rate": name}
        return {"sample_rate": Question(f"the file says {name} = {rate:g}: how many samples a second are that")}
    return {"sample_rate": Question(f"how many samples a second{_candidates(fields) or hint}")}


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
    match = re.search(r"[\s_](s|ms|us)$", name.strip().lower())
    return match[1] if match else ""


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
