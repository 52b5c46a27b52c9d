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
from millfrf.core import DegreeOfFreedom, InputError, tables_of_setup
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
from .settings import RPM, SPEED_EVENTS, STEPS

TIP_NODE = "TCP"
MOTION = ("displacement", "velocity", "acceleration")  # quantities whose amplitude shows the change of the chip


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

    The spindle speed is estimated from the recording, within 1 % of --speed, of the events `spindle_speed_rpm` or of
    the set-up. Orders of the spindle are removed; lines above the noise are classified as chatter or as foreign tones.
    With the feed in the cutting file, a vibration is also compared with the chip thickness. With a runout in the file,
    teeth may cut unequal chips: with an even number of teeth, period doubling is then reported only where the
    vibration grows, or where the chip changes by more than the runout explains.

    Parameters
    ----------
    recordings
        Recordings of cuts, each at one constant speed.
    cutting
        Cutting file: teeth, feed and runout.
    speed : rpm
        Spindle speed; without it the speed that each recording states.
    responses
        Channels to classify by; without it all response channels.
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
    process, warnings = read_checked_cutting(cutting)
    structure = None if model is None else model_of(model)[0]
    chip = process.thickest_chip or math.nan
    runout = stated_runout(cutting, process)
    options = CutOptions(process.teeth, speed, runout, chip, names_of(responses), stream, structure, process)
    with all_opened(recordings) as cuts_recorded:
        warnings += check_cuts(cuts_recorded, process, options)
        cuts = judge_recordings(cuts_recorded, options)
        kept = keep_spectra(cuts_recorded, cuts, options) if out is not None else ()
    warn(warnings)
    tell(lambda: cuts_answer(cuts))
    show(verdict_table(cuts))
    if any(cut.verdict.foreign for cut in cuts):
        show(tone_table(cuts))
    for cut in cuts:
        say(f"{cut.name}: {cut.verdict.kind}: {cut.verdict.reason}")
        warn(cut.doubts)
    if out is not None:
        stored = [*warnings, *(warning for cut in cuts for warning in cut.doubts)]
        inputs = files_among(*map(path_of, recordings), cutting, model)
        settings = {"speed_rpm": speed, "responses": list(options.responses), "stream": stream}
        write_cuts(out, kept, of_chatter(inputs, settings, stored))
        say_written([out])
    return cuts


@dataclass(frozen=True)
class CutOptions:
    """Options of the classification."""

    teeth: int
    speed_rpm: float | None = None  # None: the speed that each recording states
    # Radial offset of the spindle's axis, m; NaN: not stated, see :func:`millfrf.stability.classify_cut`
    runout: float = math.inf
    chip: float = math.nan  # thickest chip of the cut, m; NaN: not known
    responses: tuple[str, ...] = ()  # empty: all response channels
    stream: str | None = None
    # Modal model of the structure; with it the line nearest to a mode is the chatter frequency. Where it is of the
    # tip and the tip's motion was recorded, unequal teeth are judged with it too. None: not known
    model: ModalModel | None = None
    process: MillingProcess | None = None  # needed with the model


def judge_recordings(recordings: Sequence[Recording], options: CutOptions) -> tuple[JudgedCut, ...]:
    """Classify the cut of each recording."""
    cuts = []
    for recording in recordings:
        stream = recording.stream(options.stream)
        _, responses = choose_channels(stream, None, options.responses or None)
        rpm, tool = _speed(recording, options), tool_channels(responses)
        with progress(f"classifying {recording.path.name}"):
            samples = stream.read(channels=[channel.name for channel in responses])
            verdict = classify_cut(
                samples,
                stream.sample_rate,
                rpm * RPM,
                options.teeth,
                runout=options.runout,
                derivatives=derivative_orders(responses).tolist(),
                natural_frequencies=() if options.model is None else options.model.natural_frequencies.tolist(),
                chip=options.chip if tool else math.nan,
                tool=tool,
                modelled=modelled_cut(options, responses),
            )
        cuts.append(JudgedCut(recording.path.name, rpm, verdict))
    return tuple(cuts)


def tool_channels(channels: Sequence[Channel]) -> tuple[int, ...]:
    """Columns of the channels that measure motion across the tool's axis: at the tip, else at the first node."""
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
    """Cutter and structure if the model and the recording hold the tip's motion in X and Y; else None."""
    model, process = options.model, options.process
    if model is None or process is None or math.isnan(options.runout) or model.quantity != "receptance":
        return None
    recorded = {
        channel.direction[1:]: (number, -1 if channel.direction[:1] == "-" else 1)
        for number, channel in enumerate(channels)
        if channel.quantity in MOTION and channel.node == TIP_NODE
    }
    for axis in "XY":
        ends = [
            any((point.node, point.axis) == (TIP_NODE, axis) for point in map(DegreeOfFreedom.parse, names))
            for names in (model.responses, model.excitations)
        ]
        if axis not in recorded or not all(ends):
            return None
    columns, signs = zip(recorded["X"], recorded["Y"], strict=True)
    return ModelledCut(process, model, columns, signs)


def stated_runout(cutting: str | os.PathLike[str], process: MillingProcess) -> float:
    """Runout of a cutting file that was read into ``process``, m; NaN where the file states none."""
    table = tomllib.loads(Path(cutting).read_text(encoding="utf-8"))["cutting"]
    return process.runout if "runout_m" in table else math.nan


def check_cuts(recordings: Sequence[Recording], process: MillingProcess, options: CutOptions) -> list[str]:
    """Check channels, memory, and stated speed and teeth before the classification; warnings."""
    warnings = []
    for recording in recordings:
        stream = recording.stream(options.stream)
        _, responses = choose_channels(stream, None, options.responses or None)
        require_room(stream, len(responses), STEPS.bytes_per_sample)
        warnings += check_one_speed(recording.path.name, recording.setup, process, options.speed_rpm)
        names = [channel.name for channel in responses]
        remedy = "name the other channels with --response"
        warnings += check_recordings([recording], stream=options.stream, responses=names, remedy=remedy)
    return warnings


def _speed(recording: Recording, options: CutOptions) -> float:
    """Return the spindle speed (rpm) from the option, else from the recording's events, else from its set-up."""
    rpm = options.speed_rpm
    if rpm is None and SPEED_EVENTS in recording.events:
        rpm = float(np.median(recording.events[SPEED_EVENTS].read()[1]))
    if rpm is None:
        rpm = _speed_in_setup(recording.setup)
    if rpm is None:
        raise InputError(f"{recording.path.name} states no {SPEED_EVENTS} in events or set-up; give --speed RPM")
    if not (math.isfinite(rpm) and rpm > 0):
        raise InputError(f"spindle speed {rpm!r} rpm must be positive")
    return rpm


def _speed_in_setup(setup: str) -> float | None:
    for table in tables_of_setup(setup).values():
        if isinstance(table.get(SPEED_EVENTS), int | float):
            return float(table[SPEED_EVENTS])
    return None


def keep_spectra(
    recordings: Sequence[Recording], cuts: Sequence[JudgedCut], options: CutOptions
) -> tuple[KeptCut, ...]:
    """Spectrum of the channel that decided each verdict; ``cuts`` in the order of the recordings."""
    kept = []
    for recording, cut in zip(recordings, cuts, strict=True):
        stream = recording.stream(options.stream)
        _, responses = choose_channels(stream, None, options.responses or None)
        samples = stream.read(channels=[channel.name for channel in responses])
        with progress(f"spectrum of {cut.name}"):
            evidence = gather_evidence(samples, stream.sample_rate, cut.stated_rpm * RPM, options.teeth)
            spectrum = cut_spectrum(evidence, _highest(cut, options.teeth))
        channel = responses[spectrum.channel]
        kept.append(KeptCut(cut, channel.name, channel.unit, spectrum))
    return tuple(kept)


def _highest(cut: JudgedCut, teeth: int) -> float:
    """Return the upper end of a stored spectrum, Hz."""
    named = [tone.frequency for tone in cut.verdict.foreign]
    if math.isfinite(cut.verdict.frequency):
        named.append(cut.verdict.frequency)
    passings = STEPS.passings_shown * teeth * cut.verdict.spindle_speed / (2 * math.pi)
    return max(passings, STEPS.margin_above_line * max(named, default=0.0))
