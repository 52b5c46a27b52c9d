"""`millfrf plan`: speeds, immersions and durations that excite a band in all directions."""

from pathlib import Path
from typing import Annotated

import typer

from millfrf.core.terminal import say, tell


def plan(
    session: Annotated[Path, typer.Argument(metavar="SESSION.toml", help="File with tables [cutting] and [plan].")],
) -> None:
    """Propose three speed sweeps whose forces are independent, long enough for the FRF error that is wanted."""
    from millfrf.core.terminal import show
    from millfrf.steps.answers import plan_answer
    from millfrf.steps.plan import plan_from_file, plan_tables

    found, doubts = plan_from_file(session)
    for doubt in doubts:
        say(f"warning: {doubt}")
    tell(lambda: plan_answer(found))
    for table in plan_tables(found):
        show(table)
