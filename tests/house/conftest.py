"""The house as a table: every module, what its front shows, and every import between modules, read from the sources."""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Import:
    """One imported name: who asks for it, of which module, on which line."""

    importer: str
    line: int
    module: str
    name: str
    typing_only: bool

    def __str__(self) -> str:
        return f"{self.importer}:{self.line}: from {self.module} import {self.name}"


@dataclass(frozen=True)
class House:
    """Modules of all rooms, and of benchmarks and examples, which only import from them."""

    root: Path = ROOT

    @cached_property
    def rooms(self) -> frozenset[str]:
        return frozenset(path.parent.name for path in self.root.glob("*/__init__.py"))

    @cached_property
    def files(self) -> dict[str, Path]:
        """Dotted name of each module, and its file."""
        folders = (*sorted(self.rooms), "benchmarks", "examples")
        paths = [path for folder in folders for path in sorted((self.root / folder).rglob("*.py"))]
        return {_dotted(path.relative_to(self.root)): path for path in paths}

    def is_package(self, module: str) -> bool:
        return self.files[module].name == "__init__.py"

    def package_of(self, module: str) -> str:
        """The folder in which a module stands, as a dotted name; a package is its own."""
        return module if self.is_package(module) else module.rpartition(".")[0]

    @cached_property
    def fronts(self) -> dict[str, dict[str, str]]:
        """For each package the names that its front shows, and the module from which each comes."""
        return {module: dict(self._shown(module)) for module in self.files if self.is_package(module)}

    def _shown(self, package: str) -> Iterator[tuple[str, str]]:
        stub = self.files[package].with_suffix(".pyi")
        tree = ast.parse((stub if stub.exists() else self.files[package]).read_text(encoding="utf-8"))
        for node in tree.body:
            if isinstance(node, ast.ImportFrom):
                yield from ((alias.name, self._source(package, node)) for alias in node.names)

    def _source(self, module: str, node: ast.ImportFrom) -> str:
        if not node.level:
            return node.module or ""
        parts = (module if self.is_package(module) else module.rpartition(".")[0]).split(".")
        parts = parts[: len(parts) - node.level + 1]
        return ".".join([*parts, *([node.module] if node.module else [])])

    @cached_property
    def imports(self) -> tuple[Import, ...]:
        """Every name that a module imports from a module of the house."""
        return tuple(one for module in self.files for one in self._imports_of(module))

    def _imports_of(self, module: str) -> Iterator[Import]:
        tree = ast.parse(self.files[module].read_text(encoding="utf-8"))
        guarded = {
            id(node)
            for block in ast.walk(tree)
            if isinstance(block, ast.If) and "TYPE_CHECKING" in ast.unparse(block.test)
            for node in ast.walk(block)
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom):
                source = self._source(module, node)
                if source.split(".")[0] in self.rooms:
                    for alias in node.names:
                        yield Import(module, node.lineno, source, alias.name, id(node) in guarded)
            elif isinstance(node, ast.Import):
                for alias in node.names:
                    if alias.name.split(".")[0] in self.rooms:
                        yield Import(module, node.lineno, alias.name, "", id(node) in guarded)

    def home_of(self, module: str, name: str) -> str:
        """The module in which a name is defined that `module` shows, through any number of fronts."""
        while module in self.fronts and name in self.fronts[module] and self.fronts[module][name] != module:
            module = self.fronts[module][name]
        return f"{module}.{name}" if f"{module}.{name}" in self.files else module

    def front_between(self, importer: str, home: str) -> str | None:
        """The front through which a module must reach another: of its room, or of the outermost shelf it is not on.

        None where the other stands in a folder around the importer, so that no front lies between them.
        """
        here, there = self.package_of(importer).split("."), self.package_of(home).split(".")
        if here[0] != there[0]:
            return there[0]
        shared = 0
        while shared < min(len(here), len(there)) and here[shared] == there[shared]:
            shared += 1
        return ".".join(there[: shared + 1]) if shared < len(there) else None


def _dotted(path: Path) -> str:
    parts = path.with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@pytest.fixture(scope="session")
def house() -> House:
    return House()
