"""docs/mistakes.md of the table and of what the commands said."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from the_table import Mistake

PAGE = Path(__file__).parents[3] / "docs" / "mistakes.md"
TITLES = {
    "calibrate": "Carrying a model to the tool tip",
    "convert": "Converting files",
    "cut": "Judging cuts",
    "cutting": "Cutting files",
    "diagnose": "Comparing a model with recordings",
    "estimate": "Estimating FRFs",
    "fit": "Fitting models",
    "import": "Importing FRFs",
    "inspect": "Looking at files",
    "lobes": "Asking for lobes",
    "plan": "Plans and sessions",
    "report": "Reports",
    "robot": "Robots",
    "tap": "Hammer tests",
}
MARK = "<!-- the table follows: tests/millfrf/mistakes/page.py writes it -->"


def rows_of_page(rows: Sequence[Mistake], said: Mapping[str, str]) -> str:
    """Tables in Markdown, one an area: what was done, what the tool says.

    Parameters
    ----------
    rows
        Of the table.
    said
        Line by a row's name.
    """
    text = []
    for area in dict.fromkeys(row.area for row in rows):
        text += [f"\n## {TITLES[area]}\n", "| somebody ... | the tool says |", "|---|---|"]
        text += [f"| {row.did} | {_cell(said[row.name])} |" for row in rows if row.area == area]
    return "\n".join(text) + "\n"


def write_page(rows: Sequence[Mistake], said: Mapping[str, str]) -> None:
    """Replace what follows the mark."""
    head = PAGE.read_text(encoding="utf-8").partition(MARK)[0]
    PAGE.write_text(head + MARK + "\n" + rows_of_page(rows, said), encoding="utf-8")


def lines_of_page() -> dict[str, list[str]]:
    """What the page says, by what was done."""
    found: dict[str, list[str]] = {}
    for line in PAGE.read_text(encoding="utf-8").partition(MARK)[2].splitlines():
        if line.startswith("| ") and not line.startswith("| somebody"):
            did, _, said = line.removeprefix("| ").removesuffix(" |").partition(" | ")
            found.setdefault(did, []).append(said.strip("`").replace("\\|", "|"))
    return found


def _cell(line: str) -> str:
    return "`" + line.replace("|", "\\|") + "`"
