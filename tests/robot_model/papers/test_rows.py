"""The tables of `docs/robot_papers.md`: a row for every equation, table and figure, and every name in them exists."""

import ast
import importlib
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
PAGE = ROOT / "docs" / "robot_papers.md"
HEADER = ("item", "what", "where", "verdict", "ours against the paper's", "test")
VERDICTS = {"implemented", "reproduced", "trend", "misprint", "disagrees", "not reproduced", "drawing"}
CHECKED = {"implemented", "reproduced", "trend", "misprint", "disagrees"}
"""Verdicts that a test must stand behind."""

NUMBERED = {
    "000": {"Eq.": 19, "Table": 4, "Fig.": 13},
    "001": {"Eq.": 21, "Table": 2, "Fig.": 13},
    "002": {"Eq.": 29, "Table": 4, "Fig.": 16},
    "004": {"Eq.": 41, "Fig.": 16},
}
"""How many of each a paper numbers; 001 has two more equations in its appendix."""


@cache
def rows() -> dict[str, list[dict[str, str]]]:
    """Rows of each paper's table."""
    found: dict[str, list[dict[str, str]]] = {}
    paper = ""
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        if heading := re.match(r"## (\d{3}):", line):
            paper = heading[1]
        cells = tuple(cell.strip() for cell in line.strip().strip("|").split("|")) if line.startswith("|") else ()
        if paper and len(cells) == len(HEADER) and cells != HEADER and set(cells) != {"---"}:
            found.setdefault(paper, []).append(dict(zip(HEADER, cells, strict=True)))
    return found


def numbers(item: str) -> Iterator[tuple[str, int]]:
    """``Figs. 8-9`` as ("Fig.", 8) and ("Fig.", 9)."""
    if match := re.fullmatch(r"(Eq|Fig|Table)s?\.? (\d+)(?:-(\d+))?", item):
        kind = match[1] if match[1] == "Table" else f"{match[1]}."
        yield from ((kind, number) for number in range(int(match[2]), int(match[3] or match[2]) + 1))


@pytest.mark.parametrize("paper", NUMBERED)
def test_every_number_of_a_paper_has_one_row(paper: str) -> None:
    found = [one for row in rows()[paper] for one in numbers(row["item"])]
    wanted = [(kind, number) for kind, last in NUMBERED[paper].items() for number in range(1, last + 1)]
    assert sorted(found) == sorted(wanted)


@pytest.mark.shared_data
@pytest.mark.parametrize("paper", NUMBERED)
def test_no_paper_numbers_more_than_that(paper: str, shared_data: Path) -> None:
    text = next((shared_data.parent / "papers").glob(f"{paper}_*.txt")).read_text(encoding="utf-8")
    for kind, pattern in (("Table", r"(?i)\btable\s*(?:\[\[)?(\d+)"), ("Fig.", r"\b(?:Fig\.|Figure)\s*\[?(\d+)")):
        named = [int(number) for number in re.findall(pattern, text) if int(number) < 100]
        assert max(named, default=0) <= NUMBERED[paper].get(kind, 0)


def test_verdicts_are_those_of_the_list_and_claims_name_a_test() -> None:
    for paper, table in rows().items():
        for row in table:
            assert row["verdict"] in VERDICTS, (paper, row["item"])
            if row["verdict"] in CHECKED:
                assert row["where"] != "-", (paper, row["item"])
                assert row["test"] != "-", (paper, row["item"])
            if row["verdict"] == "not reproduced":
                assert len(row["ours against the paper's"]) > 6, (paper, row["item"])


def test_every_place_in_the_code_exists() -> None:
    places = {name for table in rows().values() for row in table for name in re.findall(r"`([\w.]+)`", row["where"])}
    assert len(places) > 40
    for place in sorted(places):
        module, _, name = place.rpartition(".")
        assert hasattr(importlib.import_module(module), name), place


def test_every_test_exists() -> None:
    named = {test for table in rows().values() for row in table for test in re.findall(r"`([^`]+)`", row["test"])}
    assert len(named) > 40
    for test in sorted(named):
        path, _, name = test.partition("::")
        tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
        assert name in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}, test
