"""Labels of a recording: from its setup text, from its name, or from a table."""

import csv
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from string import Formatter
from typing import Any

from millfrf.core import InputError

POSTURE = "posture_deg"  # the only label that is a list; joint angles in degrees, prismatic joints in m

# no leading zeros: "07" is a name
_NUMBER = re.compile(r"-?(0|[1-9]\d*)(\.\d*)?([eE][-+]?\d+)?")

Value = str | float


@dataclass(frozen=True)
class Labels:
    """Labels of one recording."""

    values: Mapping[str, Value]
    posture_deg: tuple[float, ...] | None = None  # (n_active,), deg or m


def number_or_text(text: str) -> Value:
    """Convert a text to a number if it is a number without leading zeros, else return the text.

    Examples
    --------
    >>> number_or_text("21.50"), number_or_text("-3"), number_or_text("07"), number_or_text("P07")
    (21.5, -3.0, '07', 'P07')
    """
    return float(text) if _NUMBER.fullmatch(text) else text


def shown_value(value: Value) -> str:
    """Format the value of a label for names, numbers as short as possible.

    Examples
    --------
    >>> shown_value(2.0), shown_value("up")
    ('2', 'up')
    """
    return value if isinstance(value, str) else f"{value:.10g}"


def labels_of_name(pattern: re.Pattern[str], name: str) -> dict[str, Value]:
    """Return the named groups of a pattern that matches the name of a file."""
    match = pattern.search(name)
    if match is None:
        raise InputError(f"the name {name} does not match the pattern {pattern.pattern}")
    return {label: number_or_text(text) for label, text in match.groupdict().items() if text is not None}


def checked_pattern(text: str) -> re.Pattern[str]:
    try:
        pattern = re.compile(text)
    except re.error as error:
        raise InputError(f"pattern {text!r} is no regular expression: {error}") from error
    if not pattern.groupindex:
        raise InputError(f"pattern {text!r} names no label; write one as (?P<pose>P\\d+)")
    return pattern


def labels_of_setup(setup: str, keys: Mapping[str, str]) -> dict[str, Any]:
    """Read labels from the setup text of a recording by their dotted keys; a missing key gives no label."""
    try:
        table: Any = tomllib.loads(setup)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"its setup is not TOML: {error}") from error
    labels: dict[str, Any] = {}
    for label, key in keys.items():
        value = _value_at(table, key)
        if value is None:
            continue
        if label == POSTURE:
            labels[label] = _numbers(value, key)
        elif isinstance(value, bool | list | dict) or not isinstance(value, str | int | float):
            raise InputError(f"its setup has {key} = {value!r}, which is no label; a label is text or a number")
        else:
            labels[label] = value if isinstance(value, str) else float(value)
    return labels


def _value_at(table: Any, key: str) -> Any:
    for part in key.split("."):
        if not isinstance(table, dict) or part not in table:
            return None
        table = table[part]
    return table


def _numbers(value: Any, place: str) -> tuple[float, ...]:
    """Convert a list, or a text with commas or semicolons, to joint values."""
    values = value.replace(";", ",").split(",") if isinstance(value, str) else value
    try:
        return tuple(float(number) for number in values)
    except (TypeError, ValueError) as error:
        raise InputError(f"{place} = {value!r} is no list of joint values") from error


def read_label_table(path: Path) -> dict[str, dict[str, Any]]:
    """Read a CSV table of labels, one row for each recording; keys are the names of files as written."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            rows = list(csv.reader(line for line in stream if line.strip() and not line.startswith("#")))
    except OSError as error:
        raise InputError(f"cannot read the table {path}: {error.strerror}; check the name") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"table {path} is not CSV: {error}; write it again") from error
    header = [cell.strip() for cell in rows[0]] if rows else []
    if "file" not in header or len(set(header)) < len(header):
        raise InputError(
            f"table {path} has the columns {', '.join(header)}; give each a name of its own, one of them file"
        )
    labels_by_file: dict[str, dict[str, Any]] = {}
    for number, row in enumerate(rows[1:], 2):
        if len(row) != len(header):
            raise InputError(f"table {path}, row {number}: {len(row)} cells, the header has {len(header)}")
        cells = {label: cell.strip() for label, cell in zip(header, row, strict=True)}
        file = cells.pop("file")
        if file in labels_by_file:
            raise InputError(f"table {path}, row {number}: {file} has a row already; give each recording one row")
        labels_by_file[file] = {
            label: _numbers(cell, label) if label == POSTURE else number_or_text(cell)
            for label, cell in cells.items()
            if cell
        }
    return labels_by_file


def joined_labels(sources: Sequence[Mapping[str, Any]]) -> Labels:
    """Merge labels of several sources; refuse contradictions."""
    joined: dict[str, Any] = {}
    for source in sources:
        for label, value in source.items():
            if joined.setdefault(label, value) != value:
                raise InputError(f"label {label} is {joined[label]!r} and {value!r}; state it once")
    posture = joined.pop(POSTURE, None)
    return Labels(joined, posture)


def labels_in(template: str) -> tuple[str, ...]:
    """Return the labels in braces in the name of a file.

    Examples
    --------
    >>> labels_in("taps/{pose}_{session}.h5")
    ('pose', 'session')
    """
    try:
        named = [field for _, field, _, _ in Formatter().parse(template) if field is not None]
    except ValueError as error:
        raise InputError(f"{template}: {error}; write a label as {{pose}}") from error
    if any(not name.isidentifier() for name in named):
        raise InputError(f"{template}: braces hold the name of a label, such as {{pose}}")
    return tuple(named)


def filled_in(template: str, values: Mapping[str, Value]) -> str:
    """Fill labels into the name of a file.

    Examples
    --------
    >>> filled_in("taps/{pose}_{session}.h5", {"pose": "P07", "session": 2.0})
    'taps/P07_2.h5'
    """
    missing = [label for label in labels_in(template) if label not in values]
    if missing:
        raise InputError(f"{template} needs the label {missing[0]}, which the recordings do not share")
    return template.format(**{label: shown_value(value) for label, value in values.items()})
