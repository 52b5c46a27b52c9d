"""The architecture as a table: every module, what its front offers, and every import between modules."""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("acquisition", "estimation", "modal_fit", "replay_data", "millfrf")


@dataclass(frozen=True)
class Import:
    """One imported name: the importing module and line, and the module that the name is taken from."""

    importer: str
    line: int
    module: str
    name: str
    typing_only: bool

    def __str__(self) -> str:
        return f"{self.importer}:{self.line}: from {self.module} import {self.name}"


@dataclass(frozen=True)
class House:
    """Modules of the product, and of benchmarks, docs and examples, which only import from them."""

    root: Path = ROOT

    @cached_property
    def files(self) -> dict[str, Path]:
        """Dotted name of each module, and its file."""
        folders = (*PACKAGES, "benchmarks", "docs", "examples")
        paths = [path for folder in folders for path in sorted((self.root / folder).rglob("*.py"))]
        return {_dotted(path.relative_to(self.root)): path for path in paths}

    @cached_property
    def product(self) -> dict[str, Path]:
        return {name: path for name, path in self.files.items() if name.split(".")[0] in PACKAGES}

    @staticmethod
    def room_of(module: str) -> str:
        """Room in which a module stands: a package at the root, or a folder of ``millfrf``."""
        first, *rest = module.split(".")
        return f"{first}.{rest[0]}" if first == "millfrf" and rest else first

    @cached_property
    def fronts(self) -> dict[str, dict[str, str]]:
        """For each room with a front, the names that it offers and the module that defines each."""
        rooms = {self.room_of(name) for name in self.product}
        shown = {room: dict(self._shown(room)) for room in rooms if self._is_package(room)}
        return {room: names for room, names in shown.items() if names}

    def _is_package(self, module: str) -> bool:
        return module in self.files and self.files[module].name == "__init__.py"

    def _shown(self, package: str) -> Iterator[tuple[str, str]]:
        stub = self.files[package].with_suffix(".pyi")
        listed = stub if stub.exists() else self.files[package]
        for node in ast.parse(listed.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ImportFrom) and (node.level or stub.exists()):
                yield from ((alias.name, self._source(package, node)) for alias in node.names)

    def _source(self, module: str, node: ast.ImportFrom) -> str:
        if not node.level:
            return node.module or ""
        parts = (module if self._is_package(module) else module.rpartition(".")[0]).split(".")
        parts = parts[: len(parts) - node.level + 1]
        return ".".join([*parts, *([node.module] if node.module else [])])

    @cached_property
    def imports(self) -> tuple[Import, ...]:
        """Every name that a module imports from a module of the product, inside functions as well."""
        return tuple(result for module in self.files for result in self._imports_of(module))

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
                if source.split(".")[0] in PACKAGES:
                    for alias in node.names:
                        yield Import(module, node.lineno, source, alias.name, id(node) in guarded)
            elif isinstance(node, ast.Import):
                for alias in node.names:
                    if alias.name.split(".")[0] in PACKAGES:
                        yield Import(module, node.lineno, alias.name, "", id(node) in guarded)

    def home_of(self, module: str, name: str) -> str:
        """The module that defines a name which ``module`` offers."""
        if f"{module}.{name}" in self.files:
            return f"{module}.{name}"
        return self.fronts.get(module, {}).get(name, module)


def _dotted(path: Path) -> str:
    parts = path.with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@pytest.fixture(scope="session")
def house() -> House:
    return House()
