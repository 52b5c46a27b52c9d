"""Step ``chatter``: verdicts on recorded cuts."""

import math
import os
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from acquisition import Channel, Recording, all_opened, path_of
from estimation import choose_channels, derivative_orders, require_room
from millfrf.core import DegreeOfFreedom, InputError
from millfrf.core.progress import progress
from millfrf.core.provenance import of_chatter
from millfrf.core.steps import File, Names, Reads, Typed, Writes, names_of, step
from millfrf.core.terminal import say, say_written, show, tell, warn
from millfrf.cutting import MillingProcess
from millfrf.gate import check_one_speed, check_recordings, read_checked_cutting
from millfrf.reports.tables import tone_table, verdict_table
from millfrf.stability import (
    JudgedCut,
    KeptCut,
    ModelledCut,
    classify_cut,
    cut_spectrum,
    gather_evidence,
    write_cuts,
)
from modal_fit import ModalModel

from .answers import cuts_answer
from .given import ModelGiven, RecordingGiven, files_among, model_of

OTHERS = "name the other channels with --response"
"""Remedy of a channel that cannot be used."""
SPEED_EVENTS = "spindle_speed_rpm"
"""Event series, and key of any table of the set-up, that states the spindle's speed."""


@step
def chatter(
    *recordings: RecordingGiven,
    cutting: Annotated[File, Reads("CUT.toml")],
    speed: Annotated[float, Typed("RPM")] | None = None,
    responses: Names = (),
    model: ModelGiven | None = None,
    stream: str | None = None,
    out: Annotated[File | None, Writes(suffixes=(".json",))] = None,
) -> tuple[JudgedCut, ...]:
    """Classify cuts as stable, Hopf chatter, period doubling or inconclusive from their vibration.

    The spindle is followed in the recording (its speed within 1 % comes from --speed, from events `spindle_speed_rpm`
    or from the set-up), its orders are taken away, and lines that stand out of the noise are named: chatter, or a
    foreign tone. Where the cutting file gives the feed, a vibration is also judged by its effect on the chip. Where it
    gives a runout, teeth are taken to cut unequal chips: with an even number of teeth, period doubling is then only
    reported while it grows, or where the chip changes by more than runout explains.

    Parameters
    ----------
    recordings
        Recordings of cuts, each at one constant speed.
    cutting
        Cutting file: teeth, feed and runout.
    speed : rpm
        Spindle speed; without it what each recording states.
    responses
        Channels to judge by; without it all that respond.
    model
        Modal model of the structure: the line nearest to a mode is the chatter frequency.
    stream
        Sample clock; needed where a recording has several.
    out
        File of verdicts and spectra to write, for a report.

    Returns
    -------
    tuple of JudgedCut
        Verdict on each recording.

    Raises
    ------
    InputError
        A file that cannot be used, no speed, or too short a cut.

    Examples
    --------
    ::

        $ millfrf chatter rec1.h5 rec2.h5 --cutting cut.toml --model tip.json --out chatter.json
    """
    process, doubts = read_checked_cutting(cutting)
    structure = None if model is None else model_of(model)[0]
    chip = process.thickest_chip or math.nan
    runout = stated_runout(cutting, process)
    options = CutOptions(process.teeth, speed, runout, chip, names_of(responses), stream, structure, process)
    with all_opened(recordings) as cuts_recorded:
        doubts += doubts_of_cuts(cuts_recorded, process, options)
        cuts = judge_recordings(cuts_recorded, options)
        kept = keep_spectra(cuts_recorded, cuts, options) if out is not None else ()
    warn(doubts)
    tell(lambda: cuts_answer(cuts))
    show(verdict_table(cuts))
    if any(cut.verdict.foreign for cut in cuts):
        show(tone_table(cuts))
    for cut in cuts:
        say(f"{cut.name}: {cut.verdict.kind}: {cut.verdict.reason}")
        warn(cut.doubts)
    if out is not None:
        stored = [*doubts, *(doubt for cut in cuts for doubt in cut.doubts)]
        inputs = files_among(*map(path_of, recordings), cutting, model)
        asked = {"speed_rpm": speed, "responses": list(options.responses), "stream": stream}
        write_cuts(out, kept, of_chatter(inputs, asked, stored))
        say_written([out])
    return cuts


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


def judge_recordings(recordings: Sequence[Recording], options: CutOptions) -> tuple[JudgedCut, ...]:
    """The verdict on each recording.

    Raises
    ------
    InputError
        A file that cannot be used, no speed, or too short a cut.
    """
    cuts = []
    for recording in recordings:
        stream = recording.stream(options.stream)
        _, responses = choose_channels(stream, None, options.responses or None)
        rpm, tool = _speed(recording, options), tool_channels(responses)
        with progress(f"judging {recording.path.name}"):
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
        cuts.append(JudgedCut(recording.path.name, rpm, found))
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


def doubts_of_cuts(recordings: Sequence[Recording], process: MillingProcess, options: CutOptions) -> list[str]:
    """Judge recordings before they are classified: their channels, and what they state of speed and teeth.

    Raises
    ------
    InputError
        A channel that is dead or cannot be, a speed sweep, or a speed in another unit than rpm.
    """
    doubts = []
    for recording in recordings:
        stream = recording.stream(options.stream)
        _, responses = choose_channels(stream, None, options.responses or None)
        require_room(stream, len(responses), BYTES_A_VALUE)
        doubts += check_one_speed(recording.path.name, recording.setup, process, options.speed_rpm)
        names = [channel.name for channel in responses]
        doubts += check_recordings([recording], stream=options.stream, responses=names, remedy=OTHERS)
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


def keep_spectra(
    recordings: Sequence[Recording], cuts: Sequence[JudgedCut], options: CutOptions
) -> tuple[KeptCut, ...]:
    """Compute the spectrum behind each verdict.

    Parameters
    ----------
    recordings
        Recordings, in the order of their verdicts.
    cuts
        Judged cuts, from :func:`millfrf.chain.chatter.judge_recordings` with the same options.
    options
        Options with which they were judged.
    """
    kept = []
    for recording, cut in zip(recordings, cuts, strict=True):
        stream = recording.stream(options.stream)
        _, responses = choose_channels(stream, None, options.responses or None)
        samples = stream.read(channels=[channel.name for channel in responses])
        with progress(f"spectrum of {cut.name}"):
            speed = cut.stated_rpm * math.pi / 30
            evidence = gather_evidence(samples, stream.sample_rate, speed, options.teeth)
            spectrum = cut_spectrum(evidence, _highest(cut, options.teeth))
        channel = responses[spectrum.channel]
        kept.append(KeptCut(cut, channel.name, channel.unit, spectrum))
    return tuple(kept)


def _highest(cut: JudgedCut, teeth: int) -> float:
    """Hz up to which a spectrum is kept."""
    named = [tone.frequency for tone in cut.verdict.foreign]
    if math.isfinite(cut.verdict.frequency):
        named.append(cut.verdict.frequency)
    return max(PASSINGS * teeth * cut.verdict.spindle_speed / (2 * math.pi), ABOVE * max(named, default=0.0))


PASSINGS = 6
"""Tooth passings that a spectrum shows at least."""


ABOVE = 1.5
"""By how much it goes beyond the highest line that was named."""
