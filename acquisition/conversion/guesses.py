"""Guesses of channels and clocks from headings and units, and questions if these are not sufficient."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from millfrf.core import PLACED, SI_UNITS, FileFormatError, is_unit, quantities_of, time_unit

from .sample_axis import is_time_name, measured_axis


@dataclass(frozen=True)
class Question:
    """A question to the user for the value of a key."""

    text: str  # without question mark
    refused: str = ""  # TOML value that the reading command refuses, for keys with a default
    open: bool = True  # False: the key is optional, so the text has no mark FILL IN
    said: str = ""  # what the file, or the name, says of it


_UNIT = re.compile(r"^(?P<name>.*?)[\s_]*[\[(](?P<unit>[^\[\]()]+)[\])]\s*$")
_PLACES = {"tip": "TCP", "tcp": "TCP", "housing": "HOUSING", "spindle": "HOUSING"}
_TURNED = ("neg", "negative", "minus", "inv", "inverted")
# stems of names by quantity, longest first. A single letter counts only before an axis: A1 may be a joint, a1 an
# input, f1 a frequency.
_STEMS: Mapping[str, tuple[str, ...]] = {
    "force": ("hammer", "force", "kraft", "f"),
    "acceleration": ("acceleration", "beschleunigung", "accel", "acc", "a"),
    "velocity": ("velocity", "geschwindigkeit", "vel", "v"),
    "displacement": ("displacement", "weg", "disp", "d", "s"),
    "moment": ("moment", "torque", "m"),
}

# what may follow a stem: ``acc x 1``; ``fx``, ``fx1``
_AFTER_WORD, _AFTER_LETTER = r"[\s_.-]*[xyz]?[\s_.-]*\d*", r"[ _]?[xyz]\d*"
_TRIED = ("force", "acceleration", "velocity", "displacement", "moment", "voltage", "angular_velocity", "angle")
_AXIS_ASKED = Question("along which axis does it count positive, such as +X; else no FRF has it")
_NODE_ASKED = Question("at which point: TCP is the tool tip, HOUSING the spindle housing, other names are free")
_COUNTS = "; its values are whole numbers: of a converter's counts give sensitivity (counts per unit) and offset too"


def split_heading(heading: str) -> tuple[str, str]:
    """Split a heading such as ``Fx [kN]``, ``acc (g)``, ``Fx / kN`` or ``fx_kN`` into name and unit (empty: none).

    Examples
    --------
    >>> split_heading("Fx [kN]"), split_heading("Fx / kN"), split_heading("acc_x")
    (('Fx', 'kN'), ('Fx', 'kN'), ('acc_x', ''))
    >>> split_heading("hammer_V"), split_heading("fx_kN")
    (('hammer', 'V'), ('fx', 'kN'))
    """
    match = _UNIT.match(heading.strip())
    if match:
        return match["name"].strip(), match["unit"].strip()
    name, slash, unit = heading.partition("/")
    if slash and (time_unit(unit) is not None or set(_TRIED) & set(quantities_of(unit.strip()))):
        return name.strip(), unit.strip()
    name, _, unit = heading.strip().rpartition("_")
    if (quantity := _of_name(name)) and {quantity, "voltage"} & set(quantities_of(unit)):
        return name, unit
    return heading.strip(), ""


def is_open_hammer(heading: str) -> bool:
    """Return whether a heading names the hammer of a tap test without its direction, so that the user is asked."""
    words = [word.lower() for word in re.split(r"[^A-Za-z]+", split_heading(heading)[0]) if word]
    return "hammer" in words and not any(_axis(word) for word in words)


def guessed_channel(heading: str, unit: str = "", *, whole: bool = False, tapped: bool = False) -> dict[str, Any]:
    """Guess the keys of a channel from heading and unit; ask a question for each unknown key.

    The unit determines the quantity; without a unit, the name determines it. If name and unit contradict each other,
    quantity and unit become questions. In a tap test whose mapping is needed (``tapped``), the points of the sensors
    are questions, too, as they sit at the tip as often as elsewhere.

    Examples
    --------
    >>> guessed_channel("Fx", "kN")
    {'name': 'Fx', 'quantity': 'force', 'unit': 'kN', 'node': 'TCP', 'direction': '+X'}
    >>> guessed_channel("Fx", "g")["unit"].text
    'the name says force, g is a unit of acceleration: which is it'
    """
    name, bracketed = split_heading(heading)
    unit = unit or bracketed
    quantity, question = _quantity(name, unit)
    keys: dict[str, Any] = {"name": name or heading.strip() or "channel"}
    keys["quantity"] = quantity or Question(question or "what does it measure", said=_of_name(name))
    if unit and not question:
        keys["unit"] = unit
    else:
        keys["unit"] = Question((question or "in which unit are its values") + (_COUNTS if whole else ""), said=unit)
    return keys | _place(name, quantity, tapped)


def _quantity(name: str, unit: str) -> tuple[str, str]:
    """Return the quantity (empty: unknown) and a question on quantity and unit (empty: none)."""
    by_name = _of_name(name)
    if not unit:
        return by_name, ""
    measured = quantities_of(unit)
    fitting = [quantity for quantity in _TRIED if quantity in measured]
    if by_name in fitting or (not by_name and len(fitting) == 1):
        return by_name or fitting[0], ""
    if not fitting:
        hint = ", if it turns so: rpm" if unit in ("1/min", "min-1", "min^-1", "/min") else ""
        return by_name, f"the file says {unit}, which is no unit that is known here{hint}: how is it written"
    if not by_name:
        return "", f"{unit} is a unit of {' or '.join(fitting)}: which is it"
    if unit.endswith("V"):
        asked = f"the values are in {unit}: give the unit of the {by_name}, and the sensitivity in {unit} per unit"
        return by_name, asked
    return "", f"the name says {by_name}, {unit} is a unit of {' or '.join(fitting)}: which is it"


def _place(name: str, quantity: str, tapped: bool) -> dict[str, Any]:
    """Guess node and direction from the name; ask a question if the sign is uncertain."""
    words = [word.lower() for word in re.split(r"[^A-Za-z]+", name) if word]
    axes = {axis for word in words if (axis := _axis(word))}
    places = {_PLACES[word] for word in words if word in _PLACES}
    if len(axes) != 1 or len(places) > 1 or not (places or quantity in PLACED):
        return {"node": _NODE_ASKED, "direction": _AXIS_ASKED} if quantity in PLACED else {}
    axis = axes.pop()
    guessed: str | Question = _NODE_ASKED if tapped else "HOUSING"
    node = places.pop() if places else "TCP" if quantity in ("force", "moment") else guessed
    if re.search(rf"-\w*{axis}(?![A-Za-z])", name, re.IGNORECASE) or any(word in _TURNED for word in words):
        return {"node": node, "direction": Question(f"does it count positive along +{axis} or -{axis}", '"?"')}
    return {"node": node, "direction": f"+{axis}"}


def _axis(word: str) -> str:
    """Return the axis in a word such as ``x``, ``fx`` or ``accx``; empty: none."""
    stems = [stem for group in _STEMS.values() for stem in group]
    return word[-1].upper() if word[-1] in "xyz" and (word[:-1] in stems or len(word) == 1) else ""


def _of_name(name: str) -> str:
    plain = re.sub(r"^(?:tip|tcp|housing|spindle)[\s_.-]+", "", name.strip().lower())
    for quantity, stems in _STEMS.items():
        for stem in stems:
            ending = _AFTER_WORD if len(stem) > 1 else _AFTER_LETTER
            if plain.startswith(stem) and re.fullmatch(ending, plain.removeprefix(stem)):
                return quantity
    return "" if plain not in SI_UNITS else plain


# names of rates, without their underscores
_RATES = {
    *("fs", "samplerate", "samplingrate", "srate", "rate", "samplefrequency", "samplingfrequency"),
    *("samplefreq", "samplingfreq", "abtastrate", "abtastfrequenz"),
}

_LIKE_RATES = re.compile(r"freq|rate|sampl|abtast|hz|^f_?s|^dt$|^ts$|delta_?t|interval", re.IGNORECASE)
# Hz; within these rates a time without unit is in seconds, and a rate without unit in Hz
LEAST_RATE, LARGEST_RATE = 100.0, 5e6
_EVEN, _AGREED = 0.01, 0.01  # relative tolerances of a uniform time step, and of two rates


@dataclass(frozen=True)
class TimeColumn:
    """A column or array with the name of a time."""

    name: int | str  # as in the mapping
    unit: str  # empty: none
    values: NDArray[np.float64]  # (n_samples,)
    resolution: float | None = None  # last printed digit


def is_time(name: str, values: Any, unit: str = "") -> bool:
    """Return whether a column holds times, by its name or unit; an uncertain name also needs values that rise."""
    plain = name.rpartition(".")[2].strip().lower()
    column = np.asarray(values).reshape(-1)
    is_stated = len(plain) > 1 or (time_unit(unit) is not None and bool(np.isfinite(column.astype(float)).all()))
    if is_time_name(plain) and (is_stated or _rises(column)):
        return True
    if re.fullmatch(r"(?:t|time|zeit)[\s_]?\d+", plain):
        return _even_step(column) > 0
    return (time_unit(unit) is not None or re.match(r"time|zeit", plain) is not None) and _rises(column)


def _rises(values: NDArray[Any]) -> bool:
    """Return whether values rise, as times with gaps or restarts do."""
    steps = _steps(values)
    return len(steps) > 1 and bool(np.isfinite(steps).all()) and float((steps > 0).mean()) > 0.9


def guessed_clock(times: Sequence[TimeColumn], fields: Mapping[str, Any], hint: str = "") -> dict[str, Any]:
    """Guess the key of the sample rate: ``time`` with its unit, or ``sample_rate``; ask a question if both fail."""
    rates = {name: float(np.ravel(values)[0]) for name, values in fields.items() if _is_rate(name, values)}
    if len(times) > 1 and all(np.array_equal(time.values, times[0].values) for time in times):
        times = times[:1]  # LabVIEW repeats the times for each channel
    times = [time for time in times if time.name == "X_Value"] or times
    if len(times) > 1:
        names = " or ".join(str(time.name) for time in times)
        return {"time": Question(f"which is the time of the samples, {names}")}
    if len(rates) > 1:
        return {"sample_rate": Question(f"which is the rate of the samples in Hz, {' or '.join(rates)}")}
    if times:
        keys = _of_time(times[0])
        rate = next(iter(rates.values()), None)
        if rate is not None and "time_unit" in keys:
            measured = measured_axis(times[0].values, "time", keys["time_unit"]).rate
            if abs(measured / rate - 1) > _AGREED:
                question = f"{times[0].name} says {measured:.6g} Hz, {next(iter(rates))} {rate:g}: which is it"
                return {"sample_rate": Question(question)}
        return keys
    for name, rate in rates.items():
        if LEAST_RATE <= rate <= LARGEST_RATE:
            return {"sample_rate": name}
        return {"sample_rate": Question(f"the file says {name} = {rate:g}: how many samples a second are that")}
    return {"sample_rate": Question(f"how many samples a second{_candidates(fields) or hint}")}


def _of_time(time: TimeColumn) -> dict[str, Any]:
    stated = time.unit or _unit_of_name(str(time.name))
    unit = time_unit(stated) if stated else "s"
    try:
        axis = measured_axis(time.values, f"time {time.name}", unit or "s", None, time.resolution)
    except FileFormatError as error:
        return {"sample_rate": Question(f"{error}; else how many samples a second")}
    if unit not in ("s", "ms", "us", "ns"):
        step = 1 / axis.rate
        return {"sample_rate": Question(f"{time.name} is in {stated}, steps {step:.6g}: how many samples a second")}
    if not stated and not LEAST_RATE <= axis.rate <= LARGEST_RATE:
        question = f"{time.name}, in steps of {1 / axis.rate:.6g}: in which time_unit, s, ms or us"
        return {"time": Question(f"{question}; write time = {_toml(time.name)} too")}
    return {"time": time.name, "time_unit": unit}


def _toml(name: int | str) -> str:
    return str(name) if isinstance(name, int) else f'"{name}"'


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
    """Return the numbers of the file that may be a sample rate or time step, as a hint after the question."""
    hints = []
    for name, values in fields.items():
        number = float(np.ravel(values)[0]) if _is_number(values) else 0.0
        if number <= 0 or not _LIKE_RATES.search(re.split(r"[./]", name)[-1]):
            continue
        if LEAST_RATE <= number <= LARGEST_RATE:
            hints.append(f"{name} = {number:.10g}?")
        elif LEAST_RATE <= 1 / number <= LARGEST_RATE:
            hints.append(f"1/{name} = {1 / number:.10g}?")
    return f"; {', '.join(hints)}" if hints else ""


def even_step(values: Any) -> float:
    """Return the step of values that increase uniformly; 0 for other values."""
    return _even_step(np.asarray(values).reshape(-1))


def _even_step(values: NDArray[Any]) -> float:
    steps = _steps(values)
    if len(steps) < 2 or not (np.isfinite(steps).all() and steps.min() > 0):
        return 0.0
    mean = float((steps / len(steps)).sum())  # the sum of the steps may overflow
    return mean if float(np.abs(steps / mean - 1).max()) <= _EVEN else 0.0


def _steps(values: NDArray[Any]) -> NDArray[np.float64]:
    """Return the differences of real numbers, infinite beyond the largest number; none of other values."""
    if not np.issubdtype(values.dtype, np.number) or np.iscomplexobj(values):
        return np.zeros(0)
    with np.errstate(over="ignore", invalid="ignore"):
        return np.diff(values.astype(float))


_NAMES = re.compile(
    r"name|label|channel|kanal|kan\u00e4le|kanaele|signal|sensor|bezeichn|column|spalte|head", re.IGNORECASE
)
_PATHS = re.compile(r"path|pfad", re.IGNORECASE)
_UNITS = re.compile(r"unit|einheit|unidad|eu$", re.IGNORECASE)
_DATES = re.compile(r"date|datum|recorded|start_?time|zeitstempel", re.IGNORECASE)
# limits of the comments in a mapping: characters of a text, notes, numbers of an array
_LONGEST_TEXT, _MOST_NOTES, _MOST_NUMBERS = 60, 24, 6


@dataclass(frozen=True)
class ColumnTexts:
    """Names and units of the columns of an array, from other fields of the file."""

    names: tuple[str, ...] = ()  # one for each column; empty: none or ambiguous
    units: tuple[str, ...] = ()  # likewise
    source: str = ""  # sentence on the fields that were used


def column_texts(fields: Mapping[str, Any], array: str, count: int) -> ColumnTexts:
    """Find names and units of the ``count`` columns of an array in lists of ``count`` texts.

    A list contains units if its name says so or if most of its texts are units; any other list may be names.
    """
    lists = _nearest({name: texts for name, value in fields.items() if len(texts := texts_of(value)) == count}, array)
    if count < 2:
        return ColumnTexts()
    units = {name: texts for name, texts in lists.items() if _are_units(name, texts)}
    other_texts = {name: texts for name, texts in lists.items() if name not in units and len(set(texts)) == count}
    unit, name = _only(units, _UNITS), _only(other_texts, _NAMES)
    sources = [f"{what} from {key}" for what, key in (("names", name), ("units", unit)) if key]
    return ColumnTexts(
        other_texts.get(name, ()),
        units.get(unit, ()),
        f"Columns of {array} have {' and '.join(sources)}: check them." if sources else "",
    )


def member_texts(fields: Mapping[str, Any], array: str) -> tuple[str, str]:
    """Return name and unit that a structure states for its only array of numbers, such as ``Y(2).Data``; empty: none.

    A name with slashes is the path of a signal, of which the last part is taken.
    """
    place = array.rpartition(".")[0]
    beside = {name: value for name, value in fields.items() if place and name.rpartition(".")[0] == place}
    if sum(isinstance(value, np.ndarray) and value.dtype.kind in "iufb" for value in beside.values()) > 1:
        return "", ""
    texts = {name: own[0] for name, value in beside.items() if len(own := texts_of(value)) == 1 and own[0]}
    names = [name for pattern in (_NAMES, _PATHS) for name in texts if pattern.search(name.rpartition(".")[2])]
    units = [name for name in texts if _UNITS.search(name.rpartition(".")[2])]
    return texts[names[0]].rstrip("/").rpartition("/")[2] if names else "", texts[units[0]] if units else ""


def texts_of(value: Any) -> tuple[str, ...]:
    """Return the texts of a cell array or an array of characters; return no texts for other values."""
    if isinstance(value, str):
        return (value.strip(),)
    if isinstance(value, np.ndarray) and value.dtype.kind == "U":
        return tuple(str(text).strip() for text in value.reshape(-1))
    return ()


def notes(fields: Mapping[str, Any]) -> Iterator[str]:
    """Yield short texts and small arrays of a file, each on a line: ``Hdr.machine: ABB IRB6660``."""
    lines = [f"  {name}: {shown}" for name, value in fields.items() if (shown := _shown(value))]
    yield from lines[:_MOST_NOTES]
    if len(lines) > _MOST_NOTES:
        yield f"  and {len(lines) - _MOST_NOTES} more"


def dates(fields: Mapping[str, Any]) -> str:
    """Return the texts with the name of a date or time, as ``Hdr.date = 2026-03-11``."""
    texts = [f"{name} = {_shown(value)}" for name, value in fields.items() if _DATES.search(name.rpartition(".")[2])]
    return ", ".join(text for text in texts if any(sign.isdigit() for sign in text.partition(" = ")[2]))


def _shown(value: Any) -> str:
    """Format a few numbers or texts in one line; empty for larger values."""
    texts = texts_of(value)
    if texts:
        joined = " ".join(", ".join(texts).split())
        plain = "".join(sign if sign.isprintable() else "?" for sign in joined)
        return plain if len(plain) <= _LONGEST_TEXT * (1 + (len(texts) > 1)) else f"{plain[:_LONGEST_TEXT]} ..."
    if not isinstance(value, np.ndarray | np.generic | int | float) or not 0 < np.size(value) <= _MOST_NUMBERS:
        return ""
    array = np.asarray(value)
    return ", ".join(f"{number:.10g}" for number in array.reshape(-1)) if array.dtype.kind in "iuf" else ""


def _nearest(lists: dict[str, tuple[str, ...]], array: str) -> dict[str, tuple[str, ...]]:
    """Return the lists that are in the same structure as the array; if there are none, return all lists."""
    in_structure = {name: texts for name, texts in lists.items() if name.rpartition(".")[0] == array.rpartition(".")[0]}
    return in_structure or lists


def _are_units(name: str, texts: tuple[str, ...]) -> bool:
    n_units = sum(bool(text) and is_unit(text.strip("[]()")) for text in texts)
    return bool(_UNITS.search(name.rpartition(".")[2])) or n_units > len(texts) / 2


def _only(lists: Mapping[str, tuple[str, ...]], pattern: re.Pattern[str]) -> str:
    """Return the name of the list whose name matches, or of the only list; empty if none or several fit."""
    matching = [name for name in lists if pattern.search(name.rpartition(".")[2])]
    names = matching or list(lists)
    return names[0] if len(names) == 1 else ""
