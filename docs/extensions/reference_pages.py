"""Sphinx extension: the pages of the reference (commands, files, Python), written from the code before the build."""

import ast
import importlib
import shutil
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from command_pages import command_page, slug
from file_pages import file_page

from millfrf.commands import STEPS
from millfrf.new.templates import toml_files

ROOMS = (
    "millfrf",
    "acquisition",
    "estimation",
    "modal_fit",
    "millfrf.cutting",
    "millfrf.stability",
    "millfrf.robot_model",
    "millfrf.mismatch",
    "replay_data",
    "millfrf.figures",
    "millfrf.core",
)
"""Import packages in the order in which a reader meets them."""


def setup(app: Any) -> dict[str, Any]:
    """Connect to Sphinx."""
    app.connect("config-inited", _write_pages)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def _write_pages(app: Any, config: Any) -> None:
    del config
    folder = Path(app.srcdir) / "reference"
    for part in ("commands", "files", "python"):
        shutil.rmtree(folder / part, ignore_errors=True)
        (folder / part).mkdir(parents=True)
    for words in STEPS:
        _write(folder / "commands" / f"{slug(words)}.md", command_page(words))
    for file in toml_files():
        _write(folder / "files" / f"{file.name}.md", file_page(file))
    for room in ROOMS:
        _write(folder / "python" / f"{room}.rst", _room_page(room))


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def _room_page(room: str) -> str:
    """A page of one import package: what it is for, and its names in the groups of its front."""
    package = importlib.import_module(room)
    lines = [room, "=" * len(room), "", (package.__doc__ or "").strip(), ""]
    for heading, names in _groups(room):
        lines += [heading, "-" * len(heading), "", f".. currentmodule:: {room}", ""]
        own = [name for name in names if _belongs(package, name) and not _is_alias(getattr(package, name))]
        if own:
            lines += [
                ".. autosummary::",
                "   :toctree: .",
                "   :nosignatures:",
                "",
                *(f"   {name}" for name in own),
                "",
            ]
        for name in names:
            if _is_alias(getattr(package, name)):
                lines += [f".. py:data:: {name}", f"   :value: {getattr(package, name)}", ""]
            elif name not in own:
                home = str(getattr(package, name).__module__).partition(".")[0]
                lines += [f"- :py:obj:`{home}.{name}`", ""]
    return "\n".join(lines)


def _belongs(package: Any, name: str) -> bool:
    """Whether a name is defined in this package, not shown here for convenience."""
    home = str(getattr(getattr(package, name), "__module__", package.__name__))
    return home.partition(".")[0] == package.__name__ or not hasattr(
        importlib.import_module(home.partition(".")[0]), name
    )


def _groups(room: str) -> Iterator[tuple[str, list[str]]]:
    """Names by the module that the front takes them from, as its stub file lists them."""
    package = importlib.import_module(room)
    stub = ast.parse(Path(str(package.__file__)).with_suffix(".pyi").read_text(encoding="utf-8"))
    shown = set(package.__all__)
    for node in stub.body:
        if isinstance(node, ast.ImportFrom):
            names = sorted(
                alias.name for alias in node.names if alias.name in shown and not alias.name.startswith("__")
            )
            if names:
                yield str(node.module).replace("_", " ").capitalize(), names


def _is_alias(value: object) -> bool:
    """Whether a name stands for a type with arguments, such as a pair of numbers."""
    return isinstance(value, types.GenericAlias) or hasattr(value, "__origin__")
