"""`millfrf chatter`: was a recorded cut stable?"""

from pathlib import Path
from typing import Annotated

import typer

from .options import Stream, names


def chatter(
    recordings: Annotated[list[Path], typer.Argument(metavar="REC...", help="Cuts at one constant speed each.")],
    speed: Annotated[float, typer.Option("--speed", metavar="RPM", help="Spindle speed, rpm, within 1 %.")],
    teeth: Annotated[int, typer.Option("--teeth", help="Number of teeth.")],
    response: Annotated[
        list[str] | None, typer.Option("--response", help="Channel to judge by; default: all that respond.")
    ] = None,
    equal_teeth: Annotated[
        bool, typer.Option("--equal-teeth", help="Teeth cut equal chips (no runout): sees period doubling.")
    ] = False,
    stream: Stream = None,
) -> None:
    """Classify cuts as stable, Hopf chatter or period doubling from their vibration."""
    from ..chain.chatter import CutOptions, classify_recordings
    from ..progress import bar
    from ..tables import show

    options = CutOptions(speed, teeth, not equal_teeth, names(response), stream)
    show(classify_recordings(recordings, options, bar))
