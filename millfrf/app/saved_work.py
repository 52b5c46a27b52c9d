"""A session of the page as a file, and step ``repeat``, which runs its commands again."""

import io
import os
import sys
from collections.abc import Sequence
from contextlib import ExitStack, chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Annotated, Literal

import tomlkit
from pydantic import BaseModel, ConfigDict, Field

from millfrf.command_line import run
from millfrf.core import InputError, MillfrfError, checked_toml
from millfrf.core.steps import File, Reads, step
from millfrf.core.terminal import manner, note

from .command_lines import CommandLine
from .own_files import write_own

FORMAT = "millfrf.work"


class _Work(BaseModel):
    """Content of the file."""

    model_config = ConfigDict(extra="forbid", strict=True)

    format: Literal["millfrf.work"]
    format_version: Literal[1]
    steps: list["_Step"] = Field(min_length=1)


class _Step(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

    command: str


def write_work(path: str | os.PathLike[str], commands: Sequence[CommandLine]) -> None:
    """Write commands in their order; each replaces its own earlier outputs when it is repeated."""
    document = tomlkit.document()
    document["format"] = FORMAT
    document["format_version"] = 1
    steps = tomlkit.aot()
    for command in commands:
        steps.append(tomlkit.item({"command": command.repeatable.text}))
    document["steps"] = steps
    write_own(Path(path), tomlkit.dumps(document), f"a session; millfrf repeat {Path(path).name} runs it again")


def read_work(path: str | os.PathLike[str]) -> tuple[CommandLine, ...]:
    """Read the commands of a session.

    Raises
    ------
    InputError
        The file is no session, or a command does not exist.
    """
    work = checked_toml(Path(path), _Work, "session")
    commands = tuple(CommandLine.from_text(each.command) for each in work.steps)
    for command in commands:
        if command.name == "repeat":
            raise InputError(f"{path}: a session cannot repeat a session; leave out {command.text!r}")
    return commands


def _run(command: CommandLine) -> tuple[int, str]:
    """Run a command, printing as the running one does; return its exit code, and its error where nothing is printed."""
    now, errors = manner(), io.StringIO()
    flags = ["--quiet"] if now.quiet and "--quiet" not in command.words else []
    with ExitStack() as stack:
        if now.silent:
            stack.enter_context(redirect_stdout(io.StringIO()))
            stack.enter_context(redirect_stderr(errors))
        elif now.as_json:  # the only text on standard output is the document
            stack.enter_context(redirect_stdout(sys.stderr))
        code = run([*command.words, *flags])
    lines = errors.getvalue().strip().splitlines()
    return code, f" ({lines[-1]})" if lines else ""


@step
def repeat(work: Annotated[File, Reads("WORK.toml")], /) -> tuple[str, ...]:
    """Run the commands of a session that was saved on the page of `millfrf app`, in the folder of the file.

    Each command replaces the outputs that it wrote before. The first that fails ends the run.

    Parameters
    ----------
    work
        Session that the page saved.

    Returns
    -------
    tuple of str
        The commands that were run.

    Raises
    ------
    InputError
        The file is no session.
    MillfrfError
        A command failed.

    Examples
    --------
    ::

        $ millfrf repeat work.toml
    """
    commands = read_work(work)
    with chdir(Path(work).resolve().parent):
        for number, command in enumerate(commands, start=1):
            note(f"{number} of {len(commands)}: {command.text}")
            code, reason = _run(command)
            if code:
                failed = f"step {number} of {len(commands)} failed: {command.text}"
                raise MillfrfError(f"{failed}; correct it and repeat{reason}")
    return tuple(command.text for command in commands)
