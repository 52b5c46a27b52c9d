"""The pages of the reference hold every option of every command and every key of every file."""

import importlib
import inspect
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from millfrf.command_line import flags_of
from millfrf.commands import STEPS, function_of
from millfrf.core.described_tables import TomlFile, schemas_in
from millfrf.core.steps import describe
from millfrf.new.templates import toml_files

EXTENSIONS = Path(__file__).resolve().parents[2] / "docs" / "extensions"


@pytest.fixture(scope="module")
def pages() -> Iterator[Any]:
    """The extension that writes the pages of commands."""
    sys.path.insert(0, str(EXTENSIONS))
    yield importlib.import_module("command_pages"), importlib.import_module("file_pages")
    sys.path.remove(str(EXTENSIONS))


@pytest.mark.parametrize("words", STEPS)
def test_every_option_of_a_command_stands_on_its_page(words: str, pages: Any) -> None:
    page = pages[0].command_page(words)
    typed = [option.typed for option in describe(inspect.unwrap(function_of(words))).options if option.public]
    assert not [name for name in typed if f"| `{name}" not in page.replace("\\|", "|")]
    assert all(f"| `--{flag}` |" in page for flag in flags_of(words))


@pytest.mark.parametrize("file", toml_files(), ids=lambda file: file.name)
def test_every_key_of_every_file_stands_on_its_page(file: TomlFile, pages: Any) -> None:
    page = pages[1].file_page(file)
    keys = {name for schema in schemas_in(file.schema) for name in schema.model_fields}
    assert keys
    assert not [key for key in keys if f"| `{key}` |" not in page]


def test_needed_options_are_marked_and_defaults_told(pages: Any) -> None:
    assert "| `--out` | `FILE` | **needed** |" in pages[0].command_page("fit")
    assert "| `--segment` | `NUMBER` | `8.0` | Duration of a segment. [s] |" in pages[0].command_page("estimate")
