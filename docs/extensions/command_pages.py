"""The page of one command: usage, arguments, options with type and default, from the description of its step."""

import inspect

from millfrf.command_line import COMMON, default_text, flags_of, help_text
from millfrf.commands import function_of
from millfrf.core.steps import Option, describe


def slug(words: str) -> str:
    """Name of a command's page."""
    return words.replace(" ", "-")


def command_page(words: str) -> str:
    """MyST text of the page of a command."""
    described = describe(inspect.unwrap(function_of(words)))
    options = [option for option in described.options if option.public]
    arguments = [option for option in options if option.positional]
    usage = " ".join(["millfrf", words, *(option.typed for option in arguments), "[OPTIONS]"])
    lines = [f"# millfrf {words}", "", described.summary, ""]
    lines += [line for paragraph in described.paragraphs for line in (paragraph, "")]
    lines += ["```text", usage, "```", "", "```console", described.example, "```", ""]
    if arguments:
        lines += ["| argument | |", "|---|---|"]
        lines += [*(f"| `{_cell(option.typed)}` | {_cell(help_text(option))} |" for option in arguments), ""]
    lines += ["| option | takes | default | |", "|---|---|---|---|"]
    lines += [_row(option) for option in options if not option.positional]
    lines += [f"| `--{name}` | | | {COMMON[name]} |" for name in flags_of(words)]
    return "\n".join([*lines, ""])


def _row(option: Option) -> str:
    default = "**needed**" if option.needed else f"`{default_text(option)}`" if default_text(option) else ""
    takes = f"`{_cell(option.marker.metavar)}`" if option.marker.metavar else ""
    meaning = help_text(option).split(" [needed]")[0].split(" [default:")[0]
    return f"| `{option.typed}` | {takes} | {default} | {_cell(meaning)} |"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("*", "\\*")
