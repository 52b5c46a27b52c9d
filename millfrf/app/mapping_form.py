"""Form that says what the channels of another program's file are: quantity, unit, sensitivity, place, direction."""

import re
from pathlib import Path
from typing import Any

import panel as pn
import panel_material_ui as pmui
import tomlkit

from acquisition import Question, proposed_mapping
from millfrf.core import SI_UNITS, InputError

from .own_files import write_own

DIRECTIONS = ("+X", "+Y", "+Z", "-X", "-Y", "-Z")
WIDTHS = {"quantity": 170, "unit": 110, "sensitivity": 170, "node": 140, "direction": 110}
"""Keys of a channel that have a field, and its width in pixels."""

CHANNELS = "[[channels]]"
_SENSITIVITY = re.compile(r"^\s*([-+\d.eE]+)\s*(?:([mµuk]?)V\s*/\s*\(?\s*(\S.*?)\s*\)?)?\s*$")
_VOLTS = re.compile(r"^([mµuk]?)V$")
_PREFIXES = {"": 1.0, "m": 1e-3, "µ": 1e-6, "u": 1e-6, "k": 1e3}


def sensitivity_of(text: str, stored: str) -> tuple[float, str]:
    """Read a sensitivity as a data sheet states it; return stored numbers per unit, and the unit if it is named.

    Parameters
    ----------
    text
        Such as ``2.25 mV/N``; a plain number where the stored numbers are no volts.
    stored
        Unit of the stored numbers as the file states it, such as ``mV``; empty if it does not.

    Raises
    ------
    InputError
        Neither, or the unit of the stored numbers leaves open what is meant.

    Examples
    --------
    >>> sensitivity_of("2.25 mV/N", "V"), sensitivity_of("10.2 mV/(m/s^2)", "mV"), sensitivity_of("0.1", "")
    ((0.00225, 'N'), (10.2, 'm/s^2'), (0.1, ''))
    """
    match = _SENSITIVITY.match(text)
    try:
        number = float(match[1]) if match else 0.0
    except ValueError:
        number = 0.0
    if match is None or not number:
        raise InputError(f"sensitivity {text!r}: give it as its data sheet does, such as 2.25 mV/N or 100 mV/g")
    volts = _VOLTS.match(stored)
    if match[3] is None:
        if volts:
            raise InputError(f"sensitivity {text!r}: the numbers are in {stored}; name the unit, such as 2.25 mV/N")
        return number, ""
    if not volts:
        raise InputError(
            f"sensitivity {text!r}: the file says {stored or 'no unit'} for its numbers, not V or mV; give the stored "
            f"numbers per {match[3]}, such as {number * _PREFIXES[match[2]]:g} if they are volts"
        )
    return float(f"{number * _PREFIXES[match[2]] / _PREFIXES[volts[1]]:.10g}"), match[3]


class MappingForm:
    """Fields for what a file does not say of its channels; guesses from names stand in them.

    Parameters
    ----------
    path
        File of another program.

    Raises
    ------
    InputError
        The file holds no samples.
    """

    def __init__(self, path: Path) -> None:
        self._proposal = proposed_mapping(path)
        self.used = [pmui.Checkbox(label=str(row["name"]), value=True, width=160) for row in self._channels]
        self.fields = [{key: _channel_field(key, row) for key in WIDTHS} for row in self._channels]
        self._asked: dict[tuple[str, int, str], Any] = {}
        for heading, rows in self._proposal.rows.items():
            for number, row in enumerate(rows):
                for key, value in row.items():
                    if isinstance(value, Question) and heading != CHANNELS:
                        text = value.text if value.open else f"{value.text} (may stay empty)"
                        field = pmui.TextInput(label=key.replace("_", " "), helper_text=text, width=420)
                        self._asked[heading, number, key] = field

    @property
    def _channels(self) -> list[Any]:
        return list(self._proposal.rows[CHANNELS])

    @property
    def view(self) -> Any:
        """What the file says, its open questions, and a row for each channel."""
        said = [pmui.Typography(line, variant="body2") for line in self._proposal.lines]
        rows = [pmui.Row(used, *fields.values()) for used, fields in zip(self.used, self.fields, strict=True)]
        hint = "Of volts give the sensitivity, as 2.25 mV/N; node is the place, such as TCP for the tip of the tool."
        asked = self._asked.values()
        return pmui.Column(*said, *asked, pmui.Typography(hint, variant="body2"), *rows, sizing_mode="stretch_width")

    def write(self, path: Path) -> None:
        """Write the mapping as the fields state it.

        Raises
        ------
        InputError
            A question is open, or no channel is chosen.
        """
        document = tomlkit.document()
        for heading, rows in self._proposal.rows.items():
            if heading == CHANNELS:
                continue
            for number, row in enumerate(rows):
                answered = self._answered(heading, number, row)
                if not heading:
                    document.update(answered)
                else:
                    key = heading.strip("[]").removeprefix("arrays.").strip('"')
                    document.setdefault("arrays", {})[key] = answered
        channels = tomlkit.aot()
        for number, row in enumerate(self._channels):
            if self.used[number].value:
                channels.append(tomlkit.item(self._channel(number, row)))
        if not len(channels):
            raise InputError("no channel is chosen; tick the channels to read")
        document["channels"] = channels
        write_own(path, tomlkit.dumps(document), f"channels of {self._proposal.file.path.name}")

    def _answered(self, heading: str, number: int, row: Any) -> dict[str, Any]:
        """Return a row with the answers of the fields."""
        answered = {key: value for key, value in row.items() if not isinstance(value, Question)}
        for key, question in row.items():
            if isinstance(question, Question):
                text = str(self._asked[heading, number, key].value or "").strip()
                if text:
                    answered[key] = _number_or_text(text)
                elif question.open:
                    raise InputError(f"{key.replace('_', ' ')}: {question.text}?")
        return answered

    def _channel(self, number: int, row: Any) -> dict[str, Any]:
        """Return a channel as its fields state it."""
        stated = {key: str(field.value or "").strip() for key, field in self.fields[number].items()}
        channel = {key: value for key, value in row.items() if not isinstance(value, Question) and key not in WIDTHS}
        if stated["sensitivity"]:
            channel["sensitivity"], unit = sensitivity_of(stated["sensitivity"], _stored_unit(row))
            if unit and stated["unit"] not in ("", unit, _stored_unit(row)):
                raise InputError(
                    f"{row['name']}: sensitivity per {unit}, but unit {stated['unit']}; correct one of both"
                )
            stated["unit"] = unit or stated["unit"]
        for key in ("quantity", "unit", "node", "direction"):
            if stated[key]:
                channel[key] = stated[key]
            elif key in ("quantity", "unit"):
                raise InputError(f"{row['name']}: give its {key}, or untick the channel")
        return channel


def _stored_unit(row: Any) -> str:
    """Return the unit of the stored numbers as the file states it; empty if it does not."""
    unit = row.get("unit", "")
    return unit.said if isinstance(unit, Question) else str(unit)


def _channel_field(key: str, row: Any) -> Any:
    """Return the field of a key of a channel, with what the file says or its name suggests."""
    value, in_volts = row.get(key), bool(_VOLTS.match(_stored_unit(row)))
    said = value.text if isinstance(value, Question) else ""
    text = "" if value is None or isinstance(value, Question) else str(value)
    if key == "quantity" and isinstance(value, Question) and in_volts:
        text = value.said
    if key in ("quantity", "direction"):
        choices = [*SI_UNITS] if key == "quantity" else [*DIRECTIONS]
        options = list(dict.fromkeys(["", text, *choices]))
        return pn.widgets.Select(label=key, options=options, value=text, width=WIDTHS[key])
    return pmui.TextInput(label=key, value=text, width=WIDTHS[key], description=said or "from the file or its name")


def _number_or_text(text: str) -> Any:
    """Return a number where the text is one; else the text, such as the name of an array of the file."""
    try:
        return float(text)
    except ValueError:
        return text
