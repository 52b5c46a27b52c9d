"""Form that says what the channels of another program's file are: quantity, unit, place and direction of each."""

from pathlib import Path
from typing import Any

import panel as pn
import panel_material_ui as pmui
import tomlkit

from acquisition import Question, proposed_mapping
from millfrf.core import SI_UNITS, InputError

from .own_files import write_own

DIRECTIONS = ("+X", "+Y", "+Z", "-X", "-Y", "-Z")
NUMBERS = ("sample_rate", "sensitivity", "offset", "full_scale")
"""Keys whose answers are numbers."""

_WIDTHS = {"quantity": 170, "unit": 110, "node": 140, "direction": 110}


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
        self._used: dict[int, Any] = {}
        self._fields: dict[tuple[str, int, str], Any] = {}
        for heading, rows in self._proposal.rows.items():
            for number, row in enumerate(rows):
                self._add(heading, number, row)

    def _add(self, heading: str, number: int, row: Any) -> None:
        of_channel = heading == "[[channels]]"
        if of_channel:
            self._used[number] = pmui.Checkbox(label=f"{row['name']}", value=True, width=160)
        for key, value in row.items():
            if isinstance(value, Question) and (value.open or (of_channel and key in _WIDTHS)):
                self._fields[heading, number, key] = _field(key, "", value.text, of_channel)
            elif of_channel and key in _WIDTHS:
                self._fields[heading, number, key] = _field(key, str(value), "guessed from the name", of_channel)

    @property
    def view(self) -> Any:
        """What the file says, its open questions, and a row for each channel."""
        said = [pmui.Typography(line, variant="body2") for line in self._proposal.lines]
        asked = [field for (heading, _, _), field in self._fields.items() if heading != "[[channels]]"]
        rows = []
        for number, used in self._used.items():
            places = [place for place in self._fields if place[:2] == ("[[channels]]", number)]
            of_row = [self._fields[place] for place in places]
            rows.append(pmui.Row(used, *of_row))
        return pmui.Column(*said, *asked, *rows, sizing_mode="stretch_width")

    def write(self, path: Path) -> None:
        """Write the mapping as the fields state it.

        Raises
        ------
        InputError
            A question is open, or no channel is chosen.
        """
        document = tomlkit.document()
        channels = tomlkit.aot()
        for heading, rows in self._proposal.rows.items():
            for number, row in enumerate(rows):
                answered = self._answered(heading, number, row)
                if heading == "[[channels]]":
                    if self._used[number].value:
                        channels.append(tomlkit.item(answered))
                elif not heading:
                    document.update(answered)
                else:
                    document.setdefault("arrays", {})[heading.strip("[]").removeprefix("arrays.").strip('"')] = answered
        if not len(channels):
            raise InputError("no channel is chosen; tick the channels to read")
        document["channels"] = channels
        write_own(path, tomlkit.dumps(document), f"channels of {self._proposal.file.path.name}")

    def _answered(self, heading: str, number: int, row: Any) -> dict[str, Any]:
        """Return a row with the answers of the fields."""
        answered = {key: value for key, value in row.items() if not isinstance(value, Question)}
        for (place, index, key), field in self._fields.items():
            if (place, index) != (heading, number):
                continue
            text = str(field.value or "").strip()
            left_out = heading == "[[channels]]" and not self._used[number].value
            if text:
                answered[key] = _value(key, text)
            elif isinstance(row[key], Question) and row[key].open and not left_out:
                raise InputError(f"{row.get('name', '')} {key}: {row[key].text}?".strip())
        return answered


def _field(key: str, value: str, meaning: str, of_channel: bool) -> Any:
    label = key.replace("_", " ")
    if not of_channel:
        return pmui.TextInput(label=label, value=value, helper_text=meaning, width=420)
    if key in ("quantity", "direction"):
        choices = [*SI_UNITS] if key == "quantity" else [*DIRECTIONS]
        options = ["", *choices] if value in ("", *choices) else ["", value, *choices]
        return pn.widgets.Select(label=label, options=options, value=value, width=_WIDTHS[key])
    return pmui.TextInput(label=label, value=value, width=_WIDTHS.get(key, 140), description=meaning)


def _value(key: str, text: str) -> Any:
    if key not in NUMBERS:
        return text
    try:
        return float(text)
    except ValueError:
        return text  # the name of a number in the file
