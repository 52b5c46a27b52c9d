"""`paper_items.toml`: an item for every equation, table and figure of the papers, and every name in it exists."""

import ast
import importlib
import re
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
ITEMS = Path(__file__).with_name("paper_items.toml")
PAGE = ROOT / "docs" / "robot_papers.md"
KEYS = ("item", "what", "where", "verdict", "ours", "test")
VERDICTS = {"implemented", "reproduced", "trend", "misprint", "disagrees", "not reproduced", "drawing"}
CHECKED = {"implemented", "reproduced", "trend", "misprint", "disagrees"}
"""Verdicts that a test must stand behind."""

NUMBERED = {
    "000": {"Eq.": 19, "Table": 4, "Fig.": 13},
    "001": {"Eq.": 21, "Table": 2, "Fig.": 13},
    "002": {"Eq.": 29, "Table": 4, "Fig.": 16},
    "003": {"Eq.": 15, "Table": 1, "Fig.": 20},
    "004": {"Eq.": 41, "Fig.": 16},
}
"""How many of each a paper numbers; 001 has two more equations in its appendix."""


@cache
def rows() -> dict[str, list[dict[str, str]]]:
    """Items of each paper; what an item does not have is "-"."""
    papers = tomllib.loads(ITEMS.read_text(encoding="utf-8"))
    return {paper: [{key: item.get(key, "-") for key in KEYS} for item in items] for paper, items in papers.items()}


def numbers(item: str) -> Iterator[tuple[str, int]]:
    """``Figs. 8-9`` as ("Fig.", 8) and ("Fig.", 9)."""
    if match := re.fullmatch(r"(Eq|Fig|Table)s?\.? (\d+)(?:-(\d+))?", item):
        kind = match[1] if match[1] == "Table" else f"{match[1]}."
        yield from ((kind, number) for number in range(int(match[2]), int(match[3] or match[2]) + 1))


def test_the_page_says_how_many_items_there_are() -> None:
    assert f"All {sum(map(len, rows().values()))} equations" in PAGE.read_text(encoding="utf-8")


@pytest.mark.parametrize("paper", NUMBERED)
def test_every_number_of_a_paper_has_one_row(paper: str) -> None:
    result = [each for row in rows()[paper] for each in numbers(row["item"])]
    wanted = [(kind, number) for kind, last in NUMBERED[paper].items() for number in range(1, last + 1)]
    assert sorted(result) == sorted(wanted)


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
                assert len(row["ours"]) > 6, (paper, row["item"])


def test_every_place_in_the_code_exists() -> None:
    places = {row["where"] for table in rows().values() for row in table} - {"-"}
    assert len(places) > 40
    for place in sorted(places):
        module, _, name = place.rpartition(".")
        assert hasattr(importlib.import_module(module), name), place


def test_every_test_exists() -> None:
    named = {row["test"] for table in rows().values() for row in table} - {"-"}
    assert len(named) > 40
    for test in sorted(named):
        path, _, name = test.partition("::")
        tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
        assert name in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}, test
