"""`millfrf chatter`: was a recorded cut stable?"""

from pathlib import Path
from typing import Annotated

import typer

from .options import Stream, names


def chatter(
    recordings: Annotated[list[Path], typer.Argument(metavar="REC...", help="Cuts at one constant speed each.")],
    cutting: Annotated[Path, typer.Option("--cutting", metavar="CUT.toml", help="Cutter: teeth and runout.")],
    speed: Annotated[
        float | None, typer.Option("--speed", metavar="RPM", help="Spindle speed; default: what the recording states.")
    ] = None,
    response: Annotated[
        list[str] | None, typer.Option("--response", help="Channel to judge by; default: all that respond.")
    ] = None,
    stream: Stream = None,
) -> None:
    """Classify cuts as stable, Hopf chatter or period doubling from their vibration.

    Where the cutting file gives a runout, teeth are taken to cut unequal chips; two teeth then hide period doubling.
    The spindle speed (within 1 %) is taken from events `spindle_speed_rpm` or from the set-up where --speed is missing.
    """
    from cutting import read_cutting_process

    from ..chain.chatter import CutOptions, classify_recordings
    from ..progress import bar
    from ..tables import show

    process = read_cutting_process(cutting)
    options = CutOptions(process.teeth, speed, process.runout > 0, names(response), stream)
    show(classify_recordings(recordings, options, bar))
