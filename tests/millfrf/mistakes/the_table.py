"""The table of mistakes: TOML files under `tables/`, one row a mistake."""

import tomllib
from dataclasses import dataclass
from pathlib import Path

TABLES = Path(__file__).with_name("tables")
ENDS = ("refused", "warned", "either", "failed")


@dataclass(frozen=True)
class Mistake:
    """One row.

    Parameters
    ----------
    did
        What was done, after "somebody".
    spoil
        Calls of `spoiling`, each its name and its words.
    command
        What was typed after ``millfrf``, in a folder of good files.
    says
        Regular expressions; each is found in the line, capital letters or not.
    ends
        ``refused``: exit code 2 and one line; ``warned``: exit code 0 and a line ``warning: ...``;
        ``either`` of the two; ``failed``: exit code 1 and one line after the warnings.
    report
        Files from which ``report`` makes a page that holds the warning; empty: nothing is made that a report takes.
    page
        A page that the command itself writes, and which holds the warning.
    """

    area: str
    did: str
    spoil: tuple[tuple[str, ...], ...]
    command: str
    says: tuple[str, ...]
    ends: str = "refused"
    report: str = ""
    page: str = ""

    @property
    def name(self) -> str:
        """For the list of tests."""
        return f"{self.area}: {self.did}"


def mistakes() -> list[Mistake]:
    """All rows, file by file."""
    return [row for path in sorted(TABLES.glob("*.toml")) for row in _rows(path)]


def _rows(path: Path) -> list[Mistake]:
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    commands = content.get("commands", {})
    rows = []
    for stored in content["mistake"]:
        row = dict(stored)
        row["command"] = row["command"].format(**commands)
        row["spoil"] = tuple(tuple(call) for call in row.get("spoil", ()))
        rows.append(Mistake(path.stem, **(row | {"says": tuple(row["says"])})))
        assert rows[-1].ends in ENDS, rows[-1]
    return rows
