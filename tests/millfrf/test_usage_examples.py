"""Each command shows an example, which the parser takes, and says in plain words what its options take."""

import re
import shlex
from typing import Any

import pytest
import typer

from millfrf.__main__ import app, run
from millfrf.usage import EXAMPLES, commands_in, options_of_several, with_examples, with_lists_apart

PROGRAM = with_examples(typer.main.get_command(app))
COMMANDS = dict(commands_in(PROGRAM))


def test_there_is_one_example_for_each_command() -> None:
    assert set(EXAMPLES) == set(COMMANDS)


@pytest.mark.parametrize("words", EXAMPLES)
def test_the_parser_takes_the_example(words: str) -> None:
    typed = shlex.split(EXAMPLES[words])
    assert typed[: 1 + len(words.split())] == ["millfrf", *words.split()]
    rest = with_lists_apart(typed[1:], options_of_several(PROGRAM, typed[1:]))[len(words.split()) :]
    command: Any = COMMANDS[words]
    command.make_context(words, rest)  # raises where an option is unknown, missing or not a number


@pytest.mark.parametrize("words", EXAMPLES)
def test_help_shows_the_example_and_no_word_of_a_programming_language(
    words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*words.split(), "--help"]) == 0
    shown = capsys.readouterr().out
    assert EXAMPLES[words] in shown
    assert not re.search(r"<(list|str|float|int|tuple|Path)", shown)
