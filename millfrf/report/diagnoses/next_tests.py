"""Meaning of a diagnosis in a workshop, and the test that would tell a cause from its rivals."""

import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files


@dataclass(frozen=True)
class NextTest:
    """A meaning and a test, each one or two sentences, the meaning without a full stop."""

    meaning: str
    test: str


@cache
def _table() -> dict[str, dict[str, str]]:
    return tomllib.loads(files("millfrf.report.diagnoses").joinpath("next_tests.toml").read_text(encoding="utf-8"))


def next_test(name: str) -> NextTest:
    """Entry of a physics or a verdict; a general one for names that the table does not hold.

    Examples
    --------
    >>> next_test("backlash").meaning
    'one joint has play: it is soft inside a gap'
    """
    table = _table()
    return NextTest(**table.get(name, table["other"]))
