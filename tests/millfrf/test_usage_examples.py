"""Each command shows an example, which the parser takes, and says in plain words what its options take."""

import inspect
import re
import shlex

import pytest

from millfrf.command_line import help_of, parse, run
from millfrf.commands import STEPS, function_of, summary_of, words_of
from millfrf.core import InputError
from millfrf.core.steps import describe
from millfrf.typed_arguments import with_lists_apart


def _example(words: str) -> str:
    return describe(inspect.unwrap(function_of(words))).example


@pytest.mark.parametrize("words", STEPS)
def test_the_parser_takes_the_example(words: str) -> None:
    typed = shlex.split(_example(words))
    assert typed[: 1 + len(words.split())] == ["millfrf", *words.split()]
    assert words_of(typed[1:]) == words
    parse(words, typed[1 + len(words.split()) :])  # raises where an option is unknown, missing or not a number


@pytest.mark.parametrize("words", STEPS)
def test_help_shows_the_example_and_no_word_of_a_programming_language(words: str) -> None:
    shown = help_of(words)
    assert _example(words) in shown
    assert not re.search(r"<(list|str|float|int|tuple|Path)|\bNone\b|``", shown)
    assert max(map(len, shown.splitlines())) <= 120


@pytest.mark.parametrize("words", STEPS)
def test_the_overview_reads_the_summary_of_the_step(words: str) -> None:
    assert summary_of(words) == (inspect.getdoc(function_of(words)) or "").split("\n")[0]
    assert len(summary_of(words)) > 20


def test_the_overview_lists_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--help"]) == 0
    shown = capsys.readouterr().out
    assert all(f"  {words} " in shown for words in STEPS)
    assert run(["robot", "--help"]) == 0
    group = capsys.readouterr().out
    assert all((f"  {words} " in group) == words.startswith("robot ") for words in STEPS)


def test_unknown_commands_end_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["mill"]) == 2
    assert capsys.readouterr().err == "millfrf: there is no command 'mill'. Try 'millfrf --help'.\n"
    assert run(["robot", "mill"]) == 2
    assert capsys.readouterr().err == "millfrf: there is no command 'robot mill'. Try 'millfrf robot --help'.\n"


@pytest.mark.parametrize(
    ("typed", "apart"),
    [
        (["--band", "5,20"], ["--band", "5", "20"]),
        (["--band=5,20"], ["--band", "5", "20"]),
        (["--band", "5", "20"], ["--band", "5", "20"]),
        (["--lab-error", "0.02"], ["--lab-error", "0.02", "0.02", "0.02"]),
        (["--lab-error", "0.02", "0.1", "0.03"], ["--lab-error", "0.02", "0.1", "0.03"]),
    ],
)
def test_lists_of_numbers_are_typed_with_commas_or_spaces(typed: list[str], apart: list[str]) -> None:
    assert with_lists_apart(["m.json", *typed], function_of("diagnose")) == ["m.json", *apart]


def test_a_list_of_another_length_is_refused() -> None:
    with pytest.raises(InputError, match="--band 5,20,30: give 2 numbers with commas"):
        with_lists_apart(["--band", "5,20,30"], function_of("diagnose"))
