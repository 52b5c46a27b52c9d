"""From recordings of cuts to a table of verdicts."""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from acquisition import Recording
from estimation import choose_channels
from foundation import InputError
from stability import classify_cut

from ..progress import Watch, silent
from ..tables import Table


@dataclass(frozen=True)
class CutOptions:
    """How cuts are judged.

    Parameters
    ----------
    speed_rpm
        Spindle speed.
    teeth
        Number of teeth.
    runout
        Whether teeth may cut unequal chips.
    responses
        Channel names; empty: chosen by quantity.
    stream
        Sample clock; None: the only one.
    """

    speed_rpm: float
    teeth: int
    runout: bool = True
    responses: tuple[str, ...] = ()
    stream: str | None = None


def classify_recordings(paths: Sequence[str | os.PathLike[str]], options: CutOptions, watch: Watch = silent) -> Table:
    """One row a recording: verdict, size of what does not repeat, its growth, its frequency.

    Raises
    ------
    InputError
        A file that cannot be used, or too short a cut.
    """
    if not (math.isfinite(options.speed_rpm) and options.speed_rpm > 0):
        raise InputError(f"spindle speed {options.speed_rpm!r} rpm must be positive")
    rows = []
    for path in paths:
        with Recording(path) as recording:
            stream = recording.stream(options.stream)
            _, responses = choose_channels(stream, None, options.responses or None)
            with watch(f"judging {Path(path).name}"):
                samples = stream.read(channels=[channel.name for channel in responses])
                found = classify_cut(
                    samples, stream.sample_rate, options.speed_rpm * math.pi / 30, options.teeth, runout=options.runout
                )
        line = "" if math.isnan(found.frequency) else f"{found.frequency:.2f}"
        rows.append((Path(path).name, found.kind, f"{100 * found.deviation:.1f} %", f"{found.growth:.2f}", line))
    columns = ("cut", "verdict", "does not repeat", "last / first quarter", "line (Hz, folded to the tooth passing)")
    return Table("Cuts", columns, tuple(rows))
