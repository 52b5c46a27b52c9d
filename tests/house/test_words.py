"""The words of the house: everything public has a docstring, and every documented parameter says what it is."""

import ast
import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from millfrf.commands import STEPS

ROOT = Path(__file__).resolve().parents[2]

LEAST_WORDS = 3
"""Words that a docstring's summary and the description of a parameter have at least."""

NO_SUBJECT = re.compile(r"(Of|Whose|Told)\b|As :")
"""A description that begins like this has no subject: "Of the cutter." does not say what of the cutter it is."""

SIGNED = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)


def _public_things(tree: ast.Module, names: set[str]) -> Iterator[tuple[ast.AST, str]]:
    """Give the functions and classes that are public, and the public methods of the classes, with their names."""
    for node in tree.body:
        if isinstance(node, SIGNED) and node.name in names:
            yield node, node.name
            if isinstance(node, ast.ClassDef):
                for inner in node.body:
                    if isinstance(inner, SIGNED) and not inner.name.startswith("_"):
                        yield inner, f"{node.name}.{inner.name}"


def _parameters_section(docstring: str) -> dict[str, tuple[str, str]]:
    """Give header and description of each name in the section ``Parameters`` of a numpydoc docstring."""
    lines = inspect.cleandoc(docstring).splitlines()
    starts = [i for i in range(len(lines) - 1) if lines[i] == "Parameters" and re.fullmatch("-{3,}", lines[i + 1])]
    if not starts:
        return {}
    entries: dict[str, tuple[str, str]] = {}
    names: list[str] = []
    for k in range(starts[0] + 2, len(lines)):
        line, following = lines[k], lines[k + 1] if k + 1 < len(lines) else ""
        if not line.strip() and not following.startswith(" ") and not re.match(r"[\w*, ]+ ?:", following):
            break
        if re.fullmatch("-{3,}", following):
            break
        if line and not line.startswith(" "):
            head, _, shape = line.partition(":")
            names = [name.strip().lstrip("*") for name in head.split(",")]
            entries.update({name: (shape.strip(), "") for name in names})
        else:
            entries.update({name: (entries[name][0], f"{entries[name][1]} {line.strip()}".strip()) for name in names})
    return entries


def _arguments(node: ast.AST) -> set[str]:
    """Give the names of a function's parameters, or of a class's fields and of its constructor's parameters."""
    if isinstance(node, ast.ClassDef):
        fields = {n.target.id for n in node.body if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name)}
        methods = [n for n in node.body if isinstance(n, ast.FunctionDef)]
        properties = {n.name for n in methods if any("property" in ast.unparse(d) for d in n.decorator_list)}
        return fields | properties | {name for n in methods if n.name == "__init__" for name in _arguments(n)}
    assert isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    signature = node.args
    named = [*signature.posonlyargs, *signature.args, *signature.kwonlyargs]
    return {a.arg for a in [*named, signature.vararg, signature.kwarg] if a is not None}


def _inherits(node: ast.AST) -> bool:
    return isinstance(node, ast.ClassDef) and any(ast.unparse(base) not in {"Protocol"} for base in node.bases)


def words(text: str) -> int:
    """Count the words of a description; symbols and numbers alone are none."""
    return len([word for word in text.split() if re.search(r"[^\W\d_]", word)])


def _mistakes(path: Path, names: set[str]) -> Iterator[str]:
    where = path.relative_to(ROOT).as_posix()
    tree = ast.parse(path.read_text(encoding="utf-8"))
    if not ast.get_docstring(tree):
        yield f"{where}: the module has no docstring"
    for node, name in _public_things(tree, names):
        place = f"{where}:{node.lineno} {name}"  # type: ignore[attr-defined]
        docstring = ast.get_docstring(node)  # type: ignore[arg-type]
        if not docstring:
            yield f"{place} has no docstring"
            continue
        summary = docstring.split("\n\n")[0]
        if words(summary) < LEAST_WORDS:
            yield f"{place} says only {summary!r}; name the thing, with its unit"
        yield from (f"{place}: {mistake}" for mistake in _mistakes_of_parameters(node, docstring))


def _mistakes_of_parameters(node: ast.AST, docstring: str) -> Iterator[str]:
    there = _arguments(node)
    for parameter, (shape, description) in _parameters_section(docstring).items():
        if words(description) < LEAST_WORDS:
            yield f"{parameter} is described as {description!r}; say what it is, its shape and its unit"
        if NO_SUBJECT.match(description):
            yield f"{parameter} is described as {description!r}; begin with the thing itself"
        if " : " in shape:
            yield f"{parameter} shares its line with another name; give each name its own line"
        if not _inherits(node) and parameter not in there:
            yield f"{parameter} is described but not there"


def test_everything_public_says_what_it_is(house: Any) -> None:
    """Public is what the fronts of the rooms offer, and the steps."""
    public: dict[str, set[str]] = {}
    offered = [(home, name) for names in house.fronts.values() for name, home in names.items()]
    for module, name in [*offered, *(tuple(place.split(":")) for place in STEPS.values())]:
        public.setdefault(house.home_of(module, name), set()).add(name)
    mistakes = [line for module, path in house.product.items() for line in _mistakes(path, public.get(module, set()))]
    assert sum(map(len, public.values())) > 400, "the fronts were not read"
    assert not mistakes, f"{len(mistakes)}:\n" + "\n".join(mistakes)


LONGEST = 119
"""Characters of a line in the docs at most; rows of tables cannot be broken and are excepted."""

UNWRAPPED: set[str] = set()
"""Pages that are not wrapped yet. A page leaves this list when it is; none is added."""


BUILT = ("docs/_build", "docs/reference")
"""What the build of the site writes."""


def _pages() -> list[str]:
    paths = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "tests").glob("*.md")]
    names = (path.relative_to(ROOT).as_posix() for path in paths)
    return sorted(name for name in names if not name.startswith(BUILT))


@pytest.mark.parametrize("page", [name for name in _pages() if name not in UNWRAPPED])
def test_lines_of_the_docs_fit_a_window(page: str) -> None:
    lines = (ROOT / page).read_text(encoding="utf-8").splitlines()
    long = [n for n, line in enumerate(lines, 1) if len(line) > LONGEST and not line.lstrip().startswith("|")]
    assert not long, f"{page}: lines {long} have more than {LONGEST} characters; wrap them"


@pytest.mark.parametrize("page", _pages())
def test_links_of_the_docs_lead_to_files(page: str) -> None:
    path = ROOT / page
    links = re.findall(r"\]\((?!https?:|#|mailto:)([^)#\s]+)", path.read_text(encoding="utf-8"))
    lost = [link for link in links if not (path.parent / link).exists()]
    assert not lost, f"{page}: links to {lost} lead nowhere; correct the path"


def test_terms_of_the_glossary_stand_in_order_and_lead_to_a_page() -> None:
    entries = (ROOT / "docs/glossary.md").read_text(encoding="utf-8").split("\n\n**")[1:]
    terms = [entry.split("**")[0].rstrip(".").lower() for entry in entries]
    assert terms == sorted(terms)
    assert len(terms) == len(set(terms))
    assert all(".md)" in entry or "See *" in entry for entry in entries)
