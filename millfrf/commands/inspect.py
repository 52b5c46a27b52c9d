"""`millfrf inspect`: what is in a file, and what looks wrong."""

from pathlib import Path
from typing import Annotated

import typer

from millfrf.core.terminal import answer, say, tell


def inspect(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="Recording, FRF, model, lobes, cutting file or geometry.")
    ],
) -> None:
    """Say what is in a file, and what looks wrong: levels, overload, dead channels, missing samples.

    Where forces repeat: their period, the noise between periods, and distortion.
    """
    from millfrf.core.progress import bar
    from millfrf.core.terminal import show
    from millfrf.steps.answers import inspected
    from millfrf.steps.inspect import inspect_file

    findings = inspect_file(file, bar)
    tell(lambda: inspected(file, findings))
    say(f"{file.name}: {findings.summary}")
    for table in findings.tables:
        show(table)
    for note in findings.notes:
        say(note)
    for concern in findings.concerns:
        answer(f"warning: {concern}")
    if not findings.concerns:
        say("nothing looks wrong")
