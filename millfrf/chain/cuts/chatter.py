"""The step from recordings of cuts to verdicts, and tables of them."""

import math
import os
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition import Channel, Recording
from estimation import choose_channels, derivative_orders, require_room
from millfrf.core import DegreeOfFreedom, InputError
from millfrf.cutting import MillingProcess
from millfrf.stability import ChatterVerdict, ModelledCut, classify_cut
from modal_fit import ModalModel

from ...gate import check_one_speed, check_recordings
from ...progress import Progress, silent
from ...tables import Table

OTHERS = "name the other channels with --response"
"""Remedy of a channel that cannot be used."""
SPEED_EVENTS = "spindle_speed_rpm"
"""Event series, and key of any table of the set-up, that states the spindle's speed."""
_SPEED_OFF = 0.002  # relative error of the stated speed from which it is told
_CERTAIN = 0.01  # p-value below which its order of magnitude is enough


@dataclass(frozen=True)
class CutOptions:
    """Options with which cuts are judged.

    Parameters
    ----------
    teeth
        Number of teeth.
    speed_rpm : rpm
        Spindle speed; None: the speed that each recording states.
    runout : m
        Radial offset of the spindle's axis; NaN: not stated, see :func:`millfrf.stability.classify_cut`.
    chip : m
        Thickest chip of the cut; NaN: not known.
    responses
        Names of the channels; empty: chosen by quantity.
    stream
        Name of the sample clock; None: the only one.
    model
        Modal model of the structure; with it the line nearest to a mode is the chatter frequency. Where it is of the
        tip and the tip's motion was recorded, unequal teeth are judged with it too. None: not known.
    process
        Milling process of the cut, to go with the model.
    """

    teeth: int
    speed_rpm: float | None = None
    runout: float = math.inf
    chip: float = math.nan
    responses: tuple[str, ...] = ()
    stream: str | None = None
    model: ModalModel | None = None
    process: MillingProcess | None = None


MOTION = ("displacement", "velocity", "acceleration")
"""Quantities whose size tells by how much the chip changes."""
BYTES_A_VALUE = 110.0
"""Memory for each sample of a cut that is judged, seen at the peak."""
TIP_NODE = "TCP"
"""Node of the tool's tip."""


@dataclass(frozen=True)
class JudgedCut:
    """A recording of a cut, with its verdict.

    Parameters
    ----------
    name
        Name of the recording's file.
    stated_rpm : rpm
        Spindle speed that the recording or the user states.
    verdict
        Verdict on the cut, see :class:`millfrf.stability.ChatterVerdict`.
    """

    name: str
    stated_rpm: float
    verdict: ChatterVerdict

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why nothing could be concluded, and what else is doubtful; one sentence each."""
        doubts = self.verdict.warnings
        if self.verdict.kind == "inconclusive":
            doubts = (f"inconclusive: {self.verdict.reason}", *doubts)
        found = self.verdict.spindle_speed * 30 / math.pi
        if abs(found / self.stated_rpm - 1) > _SPEED_OFF:
            doubts = (*doubts, f"the spindle turned at {found:.1f} rpm, stated are {self.stated_rpm:.1f} rpm")
        return tuple(f"{self.name}: {doubt}" for doubt in doubts)


def judge_recordings(
    paths: Sequence[str | os.PathLike[str]], options: CutOptions, progress: Progress = silent
) -> tuple[JudgedCut, ...]:
    """The verdict on each recording.

    Raises
    ------
    InputError
        A file that cannot be used, no speed, or too short a cut.
    """
    cuts = []
    for path in paths:
        with Recording(path) as recording:
            stream = recording.stream(options.stream)
            _, responses = choose_channels(stream, None, options.responses or None)
            rpm, tool = _speed(recording, options), tool_channels(responses)
            with progress(f"judging {Path(path).name}"):
                samples = stream.read(channels=[channel.name for channel in responses])
                found = classify_cut(
                    samples,
                    stream.sample_rate,
                    rpm * math.pi / 30,
                    options.teeth,
                    runout=options.runout,
                    derivatives=derivative_orders(responses).tolist(),
                    natural_frequencies=() if options.model is None else options.model.natural_frequencies.tolist(),
                    chip=options.chip if tool else math.nan,
                    tool=tool,
                    modelled=modelled_cut(options, responses),
                )
        cuts.append(JudgedCut(Path(path).name, rpm, found))
    return tuple(cuts)


def tool_channels(channels: Sequence[Channel]) -> tuple[int, ...]:
    """Places of the channels that hold motion across the tool's axis: of the tip, else of the node that comes first."""
    across = [
        (number, channel)
        for number, channel in enumerate(channels)
        if channel.quantity in MOTION and channel.direction[1:] in ("X", "Y")
    ]
    nodes = [channel.node for _, channel in across]
    if not nodes:
        return ()
    chosen = TIP_NODE if TIP_NODE in nodes else nodes[0]
    return tuple(number for number, channel in across if channel.node == chosen)


def modelled_cut(options: CutOptions, channels: Sequence[Channel]) -> ModelledCut | None:
    """Cutter and structure where both are of the tip whose motion in X and Y was recorded; else None."""
    model, process = options.model, options.process
    if model is None or process is None or math.isnan(options.runout) or model.quantity != "receptance":
        return None
    there = {
        channel.direction[1:]: (number, -1 if channel.direction[:1] == "-" else 1)
        for number, channel in enumerate(channels)
        if channel.quantity in MOTION and channel.node == TIP_NODE
    }
    for axis in "XY":
        ends = [
            any((one.node, one.axis) == (TIP_NODE, axis) for one in map(DegreeOfFreedom.parse, names))
            for names in (model.responses, model.excitations)
        ]
        if axis not in there or not all(ends):
            return None
    columns, signs = zip(there["X"], there["Y"], strict=True)
    return ModelledCut(process, model, columns, signs)


def stated_runout(cutting: str | os.PathLike[str], process: MillingProcess) -> float:
    """Give the runout of a cutting file that was read into ``process``, m; NaN where the file states none."""
    table = tomllib.loads(Path(cutting).read_text(encoding="utf-8"))["cutting"]
    return process.runout if "runout_m" in table else math.nan


def verdict_table(cuts: Sequence[JudgedCut]) -> Table:
    """One row a recording: verdict, its p-value, size of what does not repeat, growth, frequency, spindle."""
    rows = []
    for cut in cuts:
        found = cut.verdict
        rows.append(
            (
                cut.name,
                f"{found.spindle_speed * 30 / math.pi:.1f}",
                found.kind,
                f"{found.p_value:.0e}" if found.p_value < _CERTAIN else f"{found.p_value:.2g}",
                f"{100 * found.deviation:.1f} %",
                "" if math.isnan(found.growth) else f"{found.growth:.2f}",
                "" if math.isnan(found.frequency) else f"{found.frequency:.2f}",
            )
        )
    columns = ("cut", "speed (rpm)", "verdict", "p of noise", "does not repeat", "last / first eighth", "line (Hz)")
    return Table("Cuts", columns, tuple(rows))


def tone_table(cuts: Sequence[JudgedCut]) -> Table:
    """Tones that are neither the spindle's nor chatter, one row each."""
    rows = [
        (cut.name, f"{tone.frequency:.2f}", f"{100 * tone.share:.1f} %", tone.name)
        for cut in cuts
        for tone in cut.verdict.foreign
    ]
    return Table("Foreign tones", ("cut", "frequency (Hz)", "of the motion", "what it is"), tuple(rows))


def doubts_of_cuts(
    paths: Sequence[str | os.PathLike[str]], process: MillingProcess, options: CutOptions, progress: Progress = silent
) -> list[str]:
    """Judge recordings before they are classified: their channels, and what they state of speed and teeth.

    Raises
    ------
    InputError
        A channel that is dead or cannot be, a speed sweep, or a speed in another unit than rpm.
    """
    doubts = []
    for path in paths:
        with Recording(path) as recording:
            stream = recording.stream(options.stream)
            _, responses = choose_channels(stream, None, options.responses or None)
            require_room(stream, len(responses), BYTES_A_VALUE)
            doubts += check_one_speed(recording.path.name, recording.setup, process, options.speed_rpm)
        names = [channel.name for channel in responses]
        doubts += check_recordings([path], stream=options.stream, responses=names, progress=progress, remedy=OTHERS)
    return doubts


def _speed(recording: Recording, options: CutOptions) -> float:
    """Give the spindle speed in rpm: as asked for, or as the recording's events or set-up say."""
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
