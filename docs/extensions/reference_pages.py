"""Sphinx extension: the pages of the reference (commands, files, Python), written from the code before the build."""

import ast
import importlib
import inspect
import shutil
from collections.abc import Iterable, Iterator, Mapping
from itertools import groupby
from pathlib import Path
from typing import Any

from command_pages import command_page, slug
from file_pages import file_page
from sphinx.pycode import ModuleAnalyzer

from millfrf.commands import STEPS
from millfrf.core.described_tables import TomlFile
from millfrf.new.templates import toml_files

ROOT = Path(__file__).resolve().parents[2]
ACRONYMS = ("csv", "frf", "json", "uff")
LONGEST_VALUE = 80
"""Characters of a constant's value that are shown at most."""


def setup(app: Any) -> dict[str, Any]:
    """Connect to Sphinx."""
    app.connect("config-inited", _write_pages)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def _write_pages(app: Any, config: Any) -> None:
    del config
    folder = Path(app.srcdir) / "reference"
    shutil.rmtree(folder, ignore_errors=True)
    for name, text in reference_pages():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")


def reference_pages() -> Iterator[tuple[str, str]]:
    """Path below ``reference`` and text of each page.

    Commands share a page by their first word, files by the first command that reads them, names of Python by their
    import package.
    """
    for first, commands in groupby(STEPS, key=lambda words: words.split()[0]):
        pages = [command_page(words) for words in commands]
        yield f"commands/{slug(first)}.md", pages[0] if len(pages) == 1 else _joined(f"millfrf {first}", pages)
    for _, kinds in groupby(toml_files(), key=lambda file: file.read_by[0]):
        files: list[TomlFile] = list(kinds)
        title = ", ".join(file.name for file in files)
        pages = [file_page(file) for file in files]
        yield f"files/{files[0].name}.md", pages[0] if len(pages) == 1 else _joined(title, pages)
    for room in rooms():
        yield f"python/{room}.rst", room_page(room)


def _joined(title: str, pages: Iterable[str]) -> str:
    """One page of several, whose titles become headings."""
    texts = [line for page in pages for line in page.splitlines()]
    return "\n".join([f"# {title}", "", *(f"#{line}" if line.startswith("#") else line for line in texts), ""])


def rooms() -> list[str]:
    """Import packages with a front, the stub file that lists their names."""
    stubs = [*ROOT.glob("*/__init__.pyi"), *ROOT.glob("millfrf/*/__init__.pyi")]
    return sorted(".".join(stub.parent.relative_to(ROOT).parts) for stub in stubs)


def room_page(room: str) -> str:
    """reST text of the page of an import package: what it is for, a list of its names, and each with its docstring."""
    package = importlib.import_module(room)
    own, others = _names(package)
    lines = [room, "=" * len(room), "", inspect.getdoc(package) or "", "", f".. currentmodule:: {room}", ""]
    for heading, names in own.items():
        lines += [f"- `{heading}`_: " + ", ".join(f":py:obj:`{name}`" for name in sorted(names, key=str.lower))]
    for home, listed in others.items():
        lines += [f"- From ``{home}``: " + ", ".join(f":py:obj:`{name} <{home}.{name}>`" for name in sorted(listed))]
    for heading, names in own.items():
        lines += ["", heading, "-" * len(heading), ""]
        for name in sorted(names, key=str.lower):
            lines += _entry(package, name, names[name])
    return "\n".join([*lines, ""])


def _names(package: Any) -> tuple[dict[str, dict[str, str]], dict[str, list[str]]]:
    """Names of a front and their modules by heading, and those of other packages by package, from its stub file."""
    own: dict[str, dict[str, str]] = {}
    others: dict[str, list[str]] = {}
    stub = ast.parse(Path(str(package.__file__)).with_suffix(".pyi").read_text(encoding="utf-8"))
    for node in (node for node in stub.body if isinstance(node, ast.ImportFrom) and node.module):
        names = [alias.name for alias in node.names if alias.name in package.__all__ and alias.name[0] != "_"]
        if names and node.level:
            heading = _heading(str(node.module).partition(".")[0])
            module = f"{package.__name__}.{node.module}"
            own.setdefault(heading, {}).update(dict.fromkeys(names, module))
        elif names:
            others.setdefault(str(node.module), []).extend(names)
    return own, others


def _heading(module: str) -> str:
    """Name of a module or folder in words."""
    first, *rest = [word.upper() if word in ACRONYMS else word for word in module.split("_")]
    return " ".join([first[0].upper() + first[1:], *rest])


def _entry(package: Any, name: str, module: str) -> list[str]:
    """Directive that documents one name: its docstring, or, of a constant, its value and the text below it."""
    value = getattr(package, name)
    if inspect.isclass(value):
        return [f".. autoclass:: {name}", "   :members:", ""]
    if callable(value) and not _is_alias(value):
        return [f".. autofunction:: {name}", ""]
    shown = repr(value) if not _is_alias(value) else str(value)
    lines = [f".. py:data:: {name}"] + ([f"   :value: {shown}"] if len(shown) <= LONGEST_VALUE else [])
    texts: Mapping[tuple[str, str], list[str]] = ModuleAnalyzer.for_module(module).find_attr_docs()
    return [*lines, "", *(f"   {line}" for line in texts.get(("", name), [])), ""]


def _is_alias(value: object) -> bool:
    """Whether a name stands for a type with arguments, such as a pair of numbers."""
    return hasattr(value, "__origin__")
