"""One name for one option everywhere: the table of all options, compared with what the parser knows."""

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
import typer

from millfrf.__main__ import app, run
from millfrf.usage import FORMER_NAMES, WRITING, commands_in, with_examples

TABLE: dict[str, list[str]] = tomllib.loads(Path(__file__).with_name("option_table.toml").read_text(encoding="utf-8"))[
    "options"
]
COMMANDS = dict(commands_in(with_examples(typer.main.get_command(app))))
OPTIONS = [
    (words, name, option)
    for words, command in COMMANDS.items()
    for option in command.params
    for name in option.opts
    if name.startswith("-") and option.name != "help"
]


def _takes(option: Any) -> str:
    """What an option takes, without the name of a file."""
    if option.is_flag:
        return "nothing"
    shown = option.metavar or "one of a list"
    if shown.startswith("DIR|"):
        return "FILE|DIR"
    return "FILE" if re.fullmatch(r"FILE|[A-Z]+\.\w+", shown) else str(shown)


def test_the_table_holds_every_option_and_no_other() -> None:
    assert {name for _, name, _ in OPTIONS} == set(TABLE)


def test_no_two_names_have_one_meaning() -> None:
    meanings = [meaning for meaning, _, _ in TABLE.values()]
    assert [one for one in meanings if meanings.count(one) > 1] == []


def test_a_name_takes_the_same_in_every_command() -> None:
    clashes = [
        f"{words} {name} takes {_takes(option)}, not {TABLE[name][1]}"
        for words, name, option in OPTIONS
        if _takes(option) not in TABLE[name][1].split("|") and _takes(option) != TABLE[name][1]
    ]
    assert clashes == []


SAID = {
    "m": r"\bm\b|metres|\bM\b",
    "mm": r"\bMM\b",
    "um": r"\bUM\b",
    "deg": r"\bDEG\b|degrees",
    "degrees": "degrees|DEG",
    "s": r"\bs\b",
    "Hz": r"\bHz\b",
    "rpm": r"\brpm\b|\bRPM\b",
    "kg": r"\bKG\b",
    "%": "PERCENT",
    "N": r"\bN\b",
}
"""How the unit is told in what an option takes or in its help."""


def test_help_tells_the_unit_of_every_option_that_has_one() -> None:
    silent = []
    for words, name, option in OPTIONS:
        unit = TABLE[name][2]
        said = f"{option.metavar} {option.help}"
        if unit and not re.search(SAID.get(unit, re.escape(unit)), said):
            silent.append(f"{words} {name}: no {unit} in '{said}'")
    assert silent == []


def test_types_are_told_in_plain_words() -> None:
    shown = {_takes(option) for _, _, option in OPTIONS}
    assert [one for one in shown if re.search(r"<|\bPath\b|\bfloat\b|\bstr\b|INTEGER|FLOAT|\blist\b\[", one)] == []


def test_options_that_write_are_known_to_the_guard() -> None:
    writes = {name for name, (meaning, _, _) in TABLE.items() if re.search(r"to write|^folder for|^file for", meaning)}
    assert writes == set(WRITING)


@pytest.mark.parametrize("words", FORMER_NAMES)
def test_former_names_are_hidden_and_lead_to_options_of_today(words: str) -> None:
    own = {name for one, name, _ in OPTIONS if one == words}
    for former, today in FORMER_NAMES[words].items():
        assert today in own
        assert former not in own


def test_a_former_name_still_works_and_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["robot", "modes", "staubli_rx170", "--modes", "2"]) == 0
    today = capsys.readouterr()
    assert run(["robot", "modes", "staubli_rx170", "--count", "2"]) == 0
    former = capsys.readouterr()
    assert former.out == today.out
    assert former.err == f"note: --count of robot modes is called --modes now\n{today.err}"
