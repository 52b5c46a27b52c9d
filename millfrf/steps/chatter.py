"""Step ``chatter``: verdicts on recorded cuts."""

import math
import os
import tempfile
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from acquisition import (
    Channel,
    Recording,
    RecordingFile,
    Stream,
    StreamDescription,
    all_opened,
    convert,
    path_of,
    proposed_mapping,
    unit_free,
)
from estimation import require_room
from millfrf.core import DegreeOfFreedom, InputError, keeping_files, tables_of_setup
from millfrf.core.progress import progress
from millfrf.core.provenance import of_chatter
from millfrf.core.steps import File, Names, Reads, Typed, Writes, names_of, step
from millfrf.core.terminal import say, say_written, show, tell, warn
from millfrf.cutting import MillingProcess
from millfrf.gate import check_channels, check_one_speed, read_checked_cutting
from millfrf.reports.tables import tone_table, verdict_table
from millfrf.stability import (
    JudgedCut,
    KeptCut,
    ModelledCut,
    classify_cut,
    cut_spectrum,
    gather_evidence,
    strongest_lines,
    write_cuts,
)
from modal_fit import ModalModel

from .answers import cuts_answer
from .given import ModelGiven, Picture, RecordingGiven, files_among, model_of
from .proposed_speeds import proposal_in_words
from .settings import RPM, SPEED_EVENTS, STEPS

TIP_NODE = "TCP"
MOTION = ("displacement", "velocity", "acceleration")  # quantities whose amplitude shows the change of the chip
DERIVATIVES = {"velocity": 1, "acceleration": 2}


@step
def chatter(
    *recordings: RecordingGiven,
    cutting: Annotated[File | None, Reads("CUT.toml")] = None,
    teeth: Annotated[int | None, Typed("N"), Ge(1), Le(100)] = None,
    speed: Annotated[float, Typed("RPM")] | None = None,
    responses: Names = (),
    model: ModelGiven | None = None,
    stream: str | None = None,
    out: Annotated[File | None, Writes(suffixes=(".json",))] = None,
    picture: Picture = None,
) -> tuple[JudgedCut, ...]:
    """Classify cuts as stable, Hopf chatter, period doubling or inconclusive from any channel.

    Accelerometers, a dynamometer, a microphone (WAV) or any other signal of the cut will do. The part of each recording
    in which the tool cuts is judged. The spindle speed is estimated from the recording, within 1 % of --speed, of the
    events `spindle_speed_rpm`, of a channel of the spindle's speed or of the set-up. Orders of the spindle are removed;
    lines above the noise are classified as chatter or as foreign tones. With the feed in the cutting file, the motion
    of the tool tip is also compared with the chip thickness. Period doubling of an even number of teeth looks like
    unequal teeth (runout, a broken tooth); it is reported where the vibration grows, where the cutting file states a
    runout that does not explain it, or none (`runout_m = 0`).

    Parameters
    ----------
    recordings
        Recordings of cuts, each at one constant speed; also files of other programs, such as .wav or .csv.
    cutting
        Cutting file: teeth, feed and runout.
    teeth
        Number of cutting edges, instead of a cutting file.
    speed : rpm
        Spindle speed; without it the speed that each recording states.
    responses
        Channels to classify by; without it all that measure motion, or else force, or else anything.
    model
        Modal model of the structure: the line nearest to a mode is the chatter frequency.
    stream
        Sample clock; needed where a recording has several.
    out
        File of verdicts and spectra to write, for a report.
    picture
        File of a figure to write: the recording over time and frequency, and the spectrum of the cut.

    Returns
    -------
    tuple of JudgedCut
        Verdict on each recording.

    Raises
    ------
    InputError
        A file that cannot be used, no speed, too short a cut, or a sample rate too low for the tooth passing.

    Examples
    --------
    ::

        $ millfrf chatter rec1.h5 rec2.h5 --cutting cut.toml --model tip.json --out chatter.json
        $ millfrf chatter phone.wav --teeth 4 --speed 6900 --picture phone.png
    """
    options, warnings = cut_options(cutting, teeth, speed, names_of(responses), stream, model)
    with recordings_of(recordings) as cuts_recorded:
        warnings += check_cuts(cuts_recorded, options)
        cuts = judge_recordings(cuts_recorded, options)
        kept = keep_spectra(cuts_recorded, cuts, options) if out is not None or picture is not None else ()
        if picture is not None:
            _draw(cuts_recorded, kept, options, Path(picture))
    warn(warnings)
    tell(lambda: cuts_answer(cuts, options.teeth))
    show(verdict_table(cuts))
    if any(cut.verdict.foreign for cut in cuts):
        show(tone_table(cuts))
    for cut in cuts:
        say(f"{cut.name}: {cut.verdict.kind}: {cut.verdict.reason}")
        if proposal := proposal_in_words(cut, options.teeth, options.model, options.process):
            say(f"{cut.name}: {proposal}")
        warn(cut.doubts)
    if out is not None:
        stored = [*warnings, *(warning for cut in cuts for warning in cut.doubts)]
        inputs = files_among(*map(path_of, recordings), cutting, model)
        settings = {"teeth": teeth, "speed_rpm": speed, "responses": list(options.responses), "stream": stream}
        write_cuts(out, kept, of_chatter(inputs, settings, stored))
    written = [file for file in (out, picture) if file is not None]
    if written:
        say_written(written)
    return cuts


def cut_options(
    cutting: File | None,
    teeth: int | None,
    speed: float | None,
    responses: tuple[str, ...],
    stream: str | None,
    model: object,
) -> tuple["CutOptions", list[str]]:
    """Return the options of the classification, and the warnings on the cutting file."""
    structure = None if model is None else model_of(model)[0]
    if cutting is None:
        if teeth is None:
            raise InputError("the number of teeth is not known; give --cutting CUT.toml or --teeth N")
        return CutOptions(teeth, speed, responses=responses, stream=stream, model=structure), []
    process, warnings = read_checked_cutting(cutting)
    if teeth is not None and teeth != process.teeth:
        raise InputError(f"--teeth {teeth}, but the cutting file has teeth = {process.teeth}; give one of them")
    chip = process.thickest_chip or math.nan
    runout = stated_runout(cutting, process)
    return CutOptions(process.teeth, speed, runout, chip, responses, stream, structure, process), warnings


@contextmanager
def recordings_of(given: Sequence[RecordingFile]) -> Iterator[list[Recording]]:
    """Open recordings, and files of other programs, whose channels may have any quantity, for a ``with`` block."""
    with (
        tempfile.TemporaryDirectory() as folder,
        all_opened(
            [_as_recording(item, Path(folder) / str(number)) for number, item in enumerate(given)]
        ) as opened_recordings,
    ):
        yield opened_recordings


def _as_recording(item: RecordingFile, folder: Path) -> RecordingFile:
    own = ("", ".h5", ".hdf5", ".json", ".toml")  # recordings, and files whose kind their reader names
    if not isinstance(item, str | os.PathLike) or Path(item).suffix.lower() in own:
        return item
    if not Path(item).is_file():
        raise InputError(f"no file {item}; check the name")
    folder.mkdir()
    target = folder / Path(item).name
    with keeping_files(None):  # a file that only this command sees
        convert(item, target.with_suffix(".h5"), unit_free(proposed_mapping(Path(item))))
    return target.with_suffix(".h5").rename(target)  # messages name the file that was given


@dataclass(frozen=True)
class CutOptions:
    """Options of the classification."""

    teeth: int
    speed_rpm: float | None = None  # None: the speed that each recording states
    runout: float = math.inf  # radial offset of the spindle's axis, m; infinite: not stated
    chip: float = math.nan  # thickest chip of the cut, m; NaN: not known
    responses: tuple[str, ...] = ()  # empty: see :func:`cut_channels`
    stream: str | None = None
    # Modal model of the structure; with it the line nearest to a mode is the chatter frequency. Where it is of the
    # tip and the tip's motion was recorded, unequal teeth are judged with it too. None: not known
    model: ModalModel | None = None
    process: MillingProcess | None = None  # needed with the model


def cut_channels(stream: Stream | StreamDescription, names: Sequence[str]) -> tuple[Channel, ...]:
    """Return the channels that show a cut: those named, or else of motion, or else of force, or else of anything.

    Raises
    ------
    InputError
        No such channel.
    """
    known = {channel.name: channel for channel in stream.channels}
    missing = [name for name in names if name not in known]
    if missing:
        raise InputError(f"stream {stream.name}: no channel {', '.join(missing)}; it has {', '.join(known)}")
    if names:
        return tuple(known[name] for name in names)
    for quantities in (MOTION, ("force", "moment"), ("dimensionless", "voltage")):
        chosen = tuple(channel for channel in stream.channels if channel.quantity in quantities)
        if chosen:
            return chosen
    available = ", ".join(f"{channel.name} ({channel.quantity})" for channel in stream.channels)
    raise InputError(f"stream {stream.name}: no channel shows the cut; it has {available}. Name one with --response")


def judge_recordings(recordings: Sequence[Recording], options: CutOptions) -> tuple[JudgedCut, ...]:
    """Classify the cut of each recording."""
    cuts = []
    for recording in recordings:
        stream = recording.stream(options.stream)
        channels = cut_channels(stream, options.responses)
        (rpm, only_stated), tool = _speed(recording, stream, options), tool_channels(channels)
        require_rate(stream.path.name, stream.sample_rate, options.teeth, rpm)
        with progress(f"classifying {recording.path.name}"):
            samples = stream.read(channels=[channel.name for channel in channels])
            verdict = classify_cut(
                samples,
                stream.sample_rate,
                rpm * RPM,
                options.teeth,
                runout=options.runout,
                derivatives=[DERIVATIVES.get(channel.quantity, 0) for channel in channels],
                natural_frequencies=() if options.model is None else options.model.natural_frequencies.tolist(),
                chip=options.chip if tool else math.nan,
                tool=tool,
                modelled=modelled_cut(options, channels),
                quantities=[channel.quantity for channel in channels],
                constant_force=options.process is not None and options.process.has_constant_force,
                only_stated=only_stated,
            )
        cuts.append(JudgedCut(recording.path.name, rpm, verdict))
    return tuple(cuts)


def require_rate(where: str, sample_rate: float, teeth: int, rpm: float) -> None:
    """Refuse a sample rate at which the tooth passing is folded to another frequency."""
    passing = teeth * rpm / 60
    if passing >= sample_rate / 2:
        raise InputError(
            f"{where}: {teeth} teeth pass at {passing:.4g} Hz, above half the sample rate of "
            f"{sample_rate:g} Hz: record at {10 * passing:.0f} Hz, or correct the speed"
        )


def tool_channels(channels: Sequence[Channel]) -> tuple[int, ...]:
    """Columns of the channels that measure the motion of the tool tip across its axis; empty: there is none."""
    return tuple(
        number
        for number, channel in enumerate(channels)
        if channel.quantity in MOTION and channel.node == TIP_NODE and channel.direction[1:] in ("X", "Y")
    )


def modelled_cut(options: CutOptions, channels: Sequence[Channel]) -> ModelledCut | None:
    """Cutter and structure if the model and the recording hold the tip's motion in X and Y; else None."""
    model, process = options.model, options.process
    if model is None or process is None or math.isinf(options.runout) or model.quantity != "receptance":
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
    """Runout of a cutting file that was read into ``process``, m; infinite where the file states none."""
    table = tomllib.loads(Path(cutting).read_text(encoding="utf-8"))["cutting"]
    return process.runout if "runout_m" in table else math.inf


def check_cuts(recordings: Sequence[Recording], options: CutOptions) -> list[str]:
    """Check channels, memory, and stated speed and teeth before the classification; warnings."""

    def shown(stream: Stream) -> tuple[Sequence[str], Sequence[str]]:
        return (), [channel.name for channel in cut_channels(stream, options.responses)]

    warnings = []
    for recording in recordings:
        stream = recording.stream(options.stream)
        require_room(stream, len(cut_channels(stream, options.responses)), STEPS.bytes_per_sample)
        if options.process is not None:
            warnings += check_one_speed(recording.path.name, recording.setup, options.process, options.speed_rpm)
    remedy = "name the other channels with --response"
    return warnings + check_channels(recordings, shown, options.stream, remedy=remedy, hum=False)


def _speed(recording: Recording, stream: Stream, options: CutOptions) -> tuple[float, bool]:
    """Return the spindle speed (rpm), and whether it is only stated: by the option or the set-up.

    Events, and a channel of the speed, are measured.
    """
    rpm, only_stated = options.speed_rpm, False
    if rpm is None and SPEED_EVENTS in recording.events:
        rpm = float(np.median(recording.events[SPEED_EVENTS].read()[1]))
    turning = [channel.name for channel in stream.channels if channel.quantity == "angular_velocity"]
    if rpm is None and len(turning) == 1:
        rpm = abs(float(np.median(stream.read(channels=turning)))) / RPM
    if rpm is None:
        rpm, only_stated = _speed_in_setup(recording.setup), True
    if rpm is None:
        channels = [channel.name for channel in cut_channels(stream, options.responses)]
        lines = strongest_lines(stream.read(channels=channels), stream.sample_rate)
        likely = ", ".join(f"{60 * line / options.teeth:.0f}" for line in lines)
        hint = f"; if {options.teeth} teeth pass at one of its strongest lines, it is {likely} rpm" if likely else ""
        raise InputError(f"{recording.path.name} states no {SPEED_EVENTS}; give --speed RPM{hint}")
    if not (math.isfinite(rpm) and rpm > 0):
        raise InputError(f"spindle speed {rpm!r} rpm must be positive")
    return rpm, only_stated or options.speed_rpm is not None


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
        channels = cut_channels(stream, options.responses)
        samples = stream.read(channels=[channel.name for channel in channels])
        quantities = [channel.quantity for channel in channels]
        with progress(f"spectrum of {cut.name}"):
            evidence = gather_evidence(samples, stream.sample_rate, cut.stated_rpm * RPM, options.teeth, quantities)
            spectrum = cut_spectrum(evidence, _highest(cut, options.teeth))
        channel = channels[spectrum.channel]
        kept.append(KeptCut(cut, channel.name, channel.unit, spectrum))
    return tuple(kept)


def _draw(recordings: Sequence[Recording], kept: Sequence[KeptCut], options: CutOptions, path: Path) -> None:
    """Write the figure of the cuts."""
    from millfrf.figures import RecordedCut, ShownCut, cut_over_time_figure, save_figure  # matplotlib loads slowly

    drawn = []
    for recording, cut in zip(recordings, kept, strict=True):
        stream = recording.stream(options.stream)
        samples = stream.read(channels=[cut.channel])[:, 0]
        drawn.append(RecordedCut(ShownCut.of(cut), cut.cut.rpm, samples, stream.sample_rate))
    save_figure(cut_over_time_figure(drawn), path)


def _highest(cut: JudgedCut, teeth: int) -> float:
    """Return the upper end of a stored spectrum, Hz."""
    named = [tone.frequency for tone in cut.verdict.foreign]
    if math.isfinite(cut.verdict.frequency):
        named.append(cut.verdict.frequency)
    passings = STEPS.passings_shown * teeth * cut.rpm / 60
    return max(passings, STEPS.margin_above_line * max(named, default=0.0))
