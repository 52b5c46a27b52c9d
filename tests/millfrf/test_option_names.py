"""One name for one option in all commands: it takes the same, in the same unit."""

import inspect
import re

import pytest

from millfrf.command_line import COMMON, flags_of, run
from millfrf.commands import FORMER_NAMES, STEPS, function_of
from millfrf.core.steps import Option, Writes, describe


def _named(words: str) -> list[Option]:
    options = describe(inspect.unwrap(function_of(words))).options
    return [option for option in options if option.public and not option.positional]


OPTIONS = [(words, option.typed, option) for words in STEPS for option in _named(words)]


def _takes(option: Option) -> str:
    """What an option takes, without the name of a file."""
    shown = option.marker.metavar
    if option.count == 0:
        return "nothing"
    if option.choices:
        return "one of a list"
    if shown.startswith("DIR|"):
        return "FILE|DIR"
    return "FILE" if re.fullmatch(r"FILE|[A-Z]+\.\w+", shown) else shown


def test_a_name_takes_the_same_in_every_command() -> None:
    uses: dict[str, set[tuple[str, str]]] = {}
    for _, name, option in OPTIONS:
        uses.setdefault(name, set()).add((_takes(option), option.unit))
    del uses["--out"]  # a file or a folder, by the command
    assert {name: use for name, use in uses.items() if len(use) > 1} == {}


def test_no_option_has_the_name_of_a_common_flag() -> None:
    assert {name for _, name, _ in OPTIONS} & {f"--{flag}" for flag in COMMON} == set()
    assert {flag for words in STEPS for flag in flags_of(words)} == set(COMMON)


def test_names_that_state_a_unit_have_it() -> None:
    """What is typed in another unit than the SI's says so in the unit of its docstring, which help and tables show."""
    angles = [option.unit for _, name, option in OPTIONS if re.search(r"turns|angle|joint-step|limit-margin", name)]
    assert angles
    assert set(angles) == {"deg"}


def test_types_are_told_in_plain_words() -> None:
    shown = {_takes(option) for _, _, option in OPTIONS}
    assert [word for word in shown if re.search(r"<|\bPath\b|\bfloat\b|\bstr\b|INTEGER|FLOAT|\blist\b\[", word)] == []


def test_options_that_write_are_known_to_the_guard() -> None:
    writes = re.compile(r"\bto write\b|^Folder for|^File for")
    assert {name for _, name, option in OPTIONS if writes.search(option.text)} <= {
        name for _, name, option in OPTIONS if isinstance(option.marker, Writes)
    }


@pytest.mark.parametrize("words", FORMER_NAMES)
def test_former_names_are_hidden_and_lead_to_options_of_today(words: str) -> None:
    own = {name for command, name, _ in OPTIONS if command == words}
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


def test_options_of_a_posture_have_one_description() -> None:
    """Commands that take a posture describe it alike: several signatures cannot drift apart."""
    group = ("--pose", "--joints", "--at", "--feed", "--turn", "--redundancy", "--links")
    commands = [words for words in STEPS if {"--pose", "--at"} <= {option.typed for option in _named(words)}]
    assert len(commands) >= 5
    for name in group:
        texts = {(o.unit, o.text) for words, typed, o in OPTIONS if typed == name and words in commands}
        assert len(texts) == 1, f"{name}: {texts}"
