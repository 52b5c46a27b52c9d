"""The pages of the reference hold every option of every command and every key of every file."""

import importlib
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from millfrf.__main__ import app
from millfrf.core.described_tables import TomlFile, schemas_in
from millfrf.new.toml_files import toml_files

EXTENSIONS = Path(__file__).resolve().parents[2] / "docs" / "extensions"


@pytest.fixture(scope="module")
def pages() -> Iterator[Any]:
    """The extension that writes the pages of commands."""
    sys.path.insert(0, str(EXTENSIONS))
    yield importlib.import_module("command_pages"), importlib.import_module("file_pages")
    sys.path.remove(str(EXTENSIONS))


def _parsed(group: Any, before: str = "") -> Iterator[tuple[str, Any]]:
    """Commands as the parser knows them, which the pages do not ask."""
    for name, command in group.commands.items():
        words = f"{before} {name}".strip()
        if hasattr(command, "commands"):
            yield from _parsed(command, words)
        else:
            yield words, command


def test_every_option_of_every_command_stands_on_its_page(pages: Any) -> None:
    commands, _ = pages
    written = {command.words: commands.command_page(command) for command in commands.commands()}
    parsed = dict(_parsed(typer.main.get_command(app)))
    assert set(written) == set(parsed)
    for words, command in parsed.items():
        typed = [option for one in command.params if one.name != "help" for option in one.opts if option[0] == "-"]
        shown = {name for cell in re.findall(r"^\| `(.*?)`", written[words], re.MULTILINE) for name in cell.split(", ")}
        missing = [option for option in typed if option not in shown]
        assert not missing, f"{words}: {missing}"


@pytest.mark.parametrize("file", toml_files(), ids=lambda file: file.name)
def test_every_key_of_every_file_stands_on_its_page(file: TomlFile, pages: Any) -> None:
    page = pages[1].file_page(file)
    keys = {name for schema in schemas_in(file.schema) for name in schema.model_fields}
    assert keys
    assert not [key for key in keys if f"| `{key}` |" not in page]


def test_needed_options_are_marked_and_defaults_told(pages: Any) -> None:
    commands, _ = pages
    fit = next(command for command in commands.commands() if command.words == "fit")
    page = commands.command_page(fit)
    assert "| `--band` | `LO HI` | **needed** |" in page
    session = next(command for command in commands.commands() if command.words == "new session")
    assert "| `--driver` | `ni \\| replay \\| simulated` | `ni` |" in commands.command_page(session)
