"""From recordings of cuts to a table of verdicts."""

import math
import os
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition import Recording
from estimation import choose_channels
from foundation import InputError
from stability import classify_cut

from ..progress import Watch, silent
from ..tables import Table

SPEED_EVENTS = "spindle_speed_rpm"
"""Event series, and key of any table of the set-up, that states the spindle's speed."""


@dataclass(frozen=True)
class CutOptions:
    """How cuts are judged.

    Parameters
    ----------
    teeth
        Number of teeth.
    speed_rpm
        Spindle speed; None: what each recording states.
    runout
        Whether teeth may cut unequal chips.
    responses
        Channel names; empty: chosen by quantity.
    stream
        Sample clock; None: the only one.
    """

    teeth: int
    speed_rpm: float | None = None
    runout: bool = True
    responses: tuple[str, ...] = ()
    stream: str | None = None


def classify_recordings(paths: Sequence[str | os.PathLike[str]], options: CutOptions, watch: Watch = silent) -> Table:
    """One row a recording: verdict, size of what does not repeat, its growth, its frequency.

    Raises
    ------
    InputError
        A file that cannot be used, no speed, or too short a cut.
    """
    rows = []
    for path in paths:
        with Recording(path) as recording:
            stream = recording.stream(options.stream)
            _, responses = choose_channels(stream, None, options.responses or None)
            rpm = _speed(recording, options)
            with watch(f"judging {Path(path).name}"):
                samples = stream.read(channels=[channel.name for channel in responses])
                found = classify_cut(
                    samples, stream.sample_rate, rpm * math.pi / 30, options.teeth, runout=options.runout
                )
        line = "" if math.isnan(found.frequency) else f"{found.frequency:.2f}"
        rows.append(
            (Path(path).name, f"{rpm:.1f}", found.kind, f"{100 * found.deviation:.1f} %", f"{found.growth:.2f}", line)
        )
    columns = ("cut", "speed (rpm)", "verdict", "does not repeat", "last / first quarter", "line (Hz, folded)")
    return Table("Cuts; lines are folded into half the tooth passing", columns, tuple(rows))


def _speed(recording: Recording, options: CutOptions) -> float:
    """In rpm: as asked for, or as the recording's events or set-up say."""
    rpm = options.speed_rpm
    if rpm is None and SPEED_EVENTS in recording.events:
        rpm = float(np.median(recording.events[SPEED_EVENTS].read()[1]))
    if rpm is None:
        rpm = _stated(recording.setup)
    if rpm is None:
        raise InputError(f"{recording.path.name} states no {SPEED_EVENTS} in events or set-up; give --speed RPM")
    if not (math.isfinite(rpm) and rpm > 0):
        raise InputError(f"spindle speed {rpm!r} rpm must be positive")
    return rpm


def _stated(setup: str) -> float | None:
    try:
        tables = tomllib.loads(setup)
    except tomllib.TOMLDecodeError:
        return None
    for table in tables.values():
        if isinstance(table, dict) and isinstance(table.get(SPEED_EVENTS), int | float):
            return float(table[SPEED_EVENTS])
    return None
