"""Forms of steps: one field for each option, with the name, unit, choices and meaning that the step describes."""

import inspect
import shlex
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import panel as pn
import panel_material_ui as pmui

from millfrf.command_line import default_text, help_text
from millfrf.commands import function_of
from millfrf.core import InputError
from millfrf.core.steps import Option, Reads, Writes, describe

from .command_lines import CommandLine
from .folder import FolderFile, files_for

WIDTH = 420
"""Width of a field, pixels."""

NONE = "none"


class StepForm:
    """Fields of the options of a step, and the command that they state.

    Parameters
    ----------
    name
        Words of the command, such as ``cut identify``.
    shown
        Options that stand open, in this order; the others stand under "More options".
    proposed
        Texts with which fields begin, such as names of outputs.
    """

    def __init__(self, name: str, shown: Sequence[str] = (), proposed: Mapping[str, str] | None = None) -> None:
        self.name = name
        described = describe(inspect.unwrap(function_of(name)))
        self.summary = described.summary
        self.options = {option.name: option for option in described.options if option.public}
        self.fields = {key: _field(option, (proposed or {}).get(key, "")) for key, option in self.options.items()}
        needed = [key for key, option in self.options.items() if option.positional or option.needed]
        self.shown = tuple(dict.fromkeys([*needed, *shown])) if shown else tuple(self.options)
        self.replace = pmui.Checkbox(label="Replace files that are there", value=False)

    @property
    def view(self) -> Any:
        """The fields as a column."""
        more = [field for key, field in self.fields.items() if key not in self.shown]
        parts = [self.fields[key] for key in self.shown]
        folded = [pmui.Accordion(("More options", pmui.Column(*more)), width=WIDTH)] if more else []
        return pmui.Column(*parts, *folded, *([self.replace] if self._writes else []))

    @property
    def _writes(self) -> bool:
        return any(isinstance(option.marker, Writes) for option in self.options.values())

    def offer(self, files: tuple[FolderFile, ...]) -> None:
        """Offer the files of the folder in the fields of inputs; what was chosen stays chosen where it is there."""
        for key, option in self.options.items():
            if isinstance(option.marker, Reads):
                _offer(self.fields[key], files_for(files, option.marker.metavar), option)

    def watch(self, changed: Callable[[], None]) -> None:
        """Call a function whenever a field changes."""
        for field in (*self.fields.values(), self.replace):
            field.param.watch(lambda _: changed(), "value")

    def fill(self, texts: Mapping[str, str]) -> None:
        """Write texts into fields."""
        for key, text in texts.items():
            field = self.fields[key]
            if isinstance(field, pmui.RadioBoxGroup) and text not in field.options.values():
                field.options = {**field.options, text: text}
            field.value = text

    def command(self) -> CommandLine:
        """Return the command that the fields state.

        Raises
        ------
        InputError
            A field that must be filled in is empty.
        """
        positional, named = [], []
        for key, option in self.options.items():
            words = _words(option, self.fields[key].value)
            if not words and (option.needed or option.several):
                raise InputError(f"{_label(option)}: choose or type it first ({option.text.rstrip('.')})")
            if option.positional:
                positional += words
            elif words:
                named += _named(option, words)
        forced = ["--force"] if self._writes and self.replace.value else []
        return CommandLine((*self.name.split(), *positional, *named, *forced))


def _label(option: Option) -> str:
    name = "save as" if option.name == "out" else option.name.replace("_", " ")
    unit = f" ({option.unit})" if option.unit else ""
    return f"{name[0].upper()}{name[1:]}{unit}"


def _field(option: Option, proposed: str) -> Any:
    """Return the field of an option."""
    common = {"label": _label(option), "description": help_text(option), "width": WIDTH}
    if isinstance(option.marker, Reads):
        if option.several:
            return pmui.CheckBoxGroup(label=common["label"], options=[], value=[], width=WIDTH)
        return file_choice(_label(option))
    if option.kind is bool:
        return pmui.Checkbox(label=common["label"], description=common["description"], value=False)
    if option.choices:
        choices = ["", *map(str, option.choices)]
        # the list of the browser: menus of the other library have roles that no screen reader knows
        return pn.widgets.Select(options=choices, value=proposed, **common)
    placeholder = default_text(option) or option.marker.metavar
    return pmui.TextInput(value=proposed, placeholder=placeholder, **common)


def file_choice(label: str) -> Any:
    """Return a field that chooses one of the files of the folder, or none."""
    return pmui.RadioBoxGroup(label=label, options={NONE: ""}, value="", width=WIDTH)


def offer_files(field: Any, names: list[str], only: bool = False) -> None:
    """Offer files in a field of `file_choice`; with ``only``, the only file is chosen at once."""
    chosen = field.value if field.value in names else names[0] if only and len(names) == 1 else ""
    field.param.update(options={NONE: "", **{name: name for name in names}}, value=chosen)


def _offer(field: Any, names: list[str], option: Option) -> None:
    if option.several:
        field.param.update(options=names, value=[name for name in field.value if name in names])
    else:
        offer_files(field, names, option.needed)


def _words(option: Option, value: Any) -> list[str]:
    """Return the words that a field states."""
    if isinstance(value, list):
        return [str(part) for part in value]
    if isinstance(value, bool):
        return ["yes"] if value else []
    text = str(value or "").strip()
    if not text:
        return []
    if option.is_file or not (option.several or option.repeatable or option.count > 1):
        return [text]
    try:
        return shlex.split(text.replace(",", " ") if option.count > 1 else text)
    except ValueError as error:
        raise InputError(f"{_label(option)} {text!r}: {error}") from error


def _named(option: Option, words: list[str]) -> list[str]:
    if option.kind is bool:
        return [option.typed]
    if option.repeatable:
        return [part for word in words for part in (option.typed, word)]
    return [option.typed, *words]
