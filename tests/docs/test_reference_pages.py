"""The pages of the reference hold every option of a command, every key of a file, every public name of a package."""

import importlib
import inspect
import re
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
    """The extensions that write the pages: of commands, of files, of all."""
    sys.path.insert(0, str(EXTENSIONS))
    yield tuple(importlib.import_module(name) for name in ("command_pages", "file_pages", "reference_pages"))
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


def test_every_command_and_file_stands_on_one_page(pages: Any) -> None:
    texts = dict(pages[2].reference_pages())
    lines = [line for text in texts.values() for line in text.splitlines()]
    assert not [words for words in STEPS if lines.count(f"# millfrf {words}") + lines.count(f"## millfrf {words}") != 1]
    titles = [f"{file.name}: {file.title}" for file in toml_files()]
    assert not [title for title in titles if lines.count(f"# {title}") + lines.count(f"## {title}") != 1]


ENTRY = re.compile(r"^\.\. (?:autoclass|autofunction|py:data):: (\w+)$", re.MULTILINE)


def test_every_public_name_has_one_place(pages: Any) -> None:
    """A name stands on the page of the package that defines it, in its list at the head; other packages link to it."""
    places = {room: ENTRY.findall(pages[2].room_page(room)) for room in pages[2].rooms()}
    for room, names in places.items():
        text = pages[2].room_page(room)
        assert len(names) == len(set(names))
        assert all(f":py:obj:`{name}`" in text for name in names)
        public = {name for name in importlib.import_module(room).__all__ if not name.startswith("_")}
        linked = set(re.findall(r":py:obj:`(\w+) <[\w.]+>`", text))
        assert public == {*names, *linked}
        homes = re.findall(r":py:obj:`\w+ <([\w.]+)\.(\w+)>`", text)
        assert not [name for home, name in homes if name not in places[home]]


def test_constants_keep_their_text(pages: Any) -> None:
    page = pages[2].room_page("millfrf.stability")
    assert "\n.. py:data:: CONFIDENCE\n   :value: 0.975\n" in page


MOST_PAGES = 120


def test_the_site_stays_small_enough_to_search(pages: Any) -> None:
    docs = EXTENSIONS.parent
    written = [path for path in docs.rglob("*.md") if not path.is_relative_to(docs / "reference")]
    read = [path for path in written if not path.name.startswith("0") and "_build" not in path.parts]
    gallery = list((docs.parent / "examples" / "gallery").glob("show_*.py"))
    made = len(list(pages[2].reference_pages())) + len(gallery) + 3  # the gallery's list, the index and the search
    assert len(read) + made < MOST_PAGES
