"""The page of one command: usage, arguments, options with type and default, read from the command line itself."""

import inspect
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

import typer
from typer.models import ArgumentInfo

from millfrf.usage import EXAMPLES

_WORDS = {int: "N", float: "NUMBER", str: "TEXT", Path: "FILE"}


@dataclass(frozen=True)
class Parameter:
    """One argument or option: its name as typed, what it takes, its default (None: needed) and its help."""

    name: str
    takes: str
    default: str | None
    text: str
    is_argument: bool


@dataclass(frozen=True)
class Command:
    """A command by its words, such as ``robot frf``, with the function behind it."""

    words: str
    function: Callable[..., Any]

    @property
    def slug(self) -> str:
        """Name of its page."""
        return self.words.replace(" ", "-")

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its arguments and options in their order."""
        hints = get_type_hints(self.function, include_extras=True)
        signature = inspect.signature(self.function).parameters
        return tuple(_parameter(name, hints[name], one.default) for name, one in signature.items())


def commands() -> tuple[Command, ...]:
    """All commands, those of groups after the others."""
    from millfrf.__main__ import app

    return tuple(_commands(app, ""))


def _commands(app: typer.Typer, before: str) -> Iterator[Command]:
    for one in app.registered_commands:
        assert one.callback is not None
        name = one.name or one.callback.__name__.replace("_", "-")
        yield Command(f"{before} {name}".strip(), one.callback)
    for group in app.registered_groups:
        assert group.typer_instance is not None
        yield from _commands(group.typer_instance, f"{before} {group.typer_instance.info.name}".strip())


def command_page(command: Command) -> str:
    """MyST text of the page."""
    arguments = [one for one in command.parameters if one.is_argument]
    options = [one for one in command.parameters if not one.is_argument]
    usage = " ".join([f"millfrf {command.words}", *(one.name for one in arguments), "[OPTIONS]" if options else ""])
    text = " ".join((inspect.getdoc(command.function) or "").split("\f")[0].split())
    lines = [f"# millfrf {command.words}", "", text, "", "```text", usage.strip(), "```", ""]
    lines += ["```console", EXAMPLES[command.words], "```", ""]
    if arguments:
        lines += [
            "| argument | |",
            "|---|---|",
            *(f"| `{_cell(one.name)}` | {_cell(one.text)} |" for one in arguments),
            "",
        ]
    if options:
        lines += ["| option | takes | default | |", "|---|---|---|---|", *map(_row, options), ""]
    return "\n".join(lines)


def _row(one: Parameter) -> str:
    default = "**needed**" if one.default is None else f"`{one.default}`" if one.default else ""
    takes = f"`{_cell(one.takes)}`" if one.takes else ""
    return f"| `{one.name}` | {takes} | {default} | {_cell(one.text)} |"


def _parameter(name: str, hint: Any, given: Any) -> Parameter:
    kind, info = get_args(hint)[:2]
    flag = kind is bool
    default = None if given is inspect.Parameter.empty else _default(given)
    if isinstance(info, ArgumentInfo):
        return Parameter(info.metavar or name.upper(), "", default, info.help or "", True)
    declared = [one for one in (info.default, *(info.param_decls or ())) if isinstance(one, str) and one[:1] == "-"]
    typed = ", ".join(declared or [f"--{name.replace('_', '-')}"])
    return Parameter(typed, "" if flag else info.metavar or _words(kind), default, info.help or "", False)


def _default(value: Any) -> str:
    if value is None or value is False or value == () or value == []:
        return ""
    if isinstance(value, Enum):
        return str(value.value)
    return " ".join(f"{one:g}" for one in value) if isinstance(value, tuple) else str(value)


def _words(kind: Any) -> str:
    """Plain words for a type."""
    inner = [one for one in get_args(kind) if one is not type(None)]
    if get_origin(kind) is tuple:
        return " ".join(_WORDS.get(one, "value") for one in inner)
    if inner:
        return _words(inner[0])
    if isinstance(kind, type) and issubclass(kind, Enum):
        return " | ".join(str(one.value) for one in kind)
    return _WORDS.get(kind, "value")


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("*", "\\*")
