"""Checks of recordings: signals that are alive, complete, plausible and distinct."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from acquisition import RecordingFile, Stream, opened, path_of
from estimation import choose_channels, find_taps
from millfrf.core import InputError
from millfrf.core.provenance import sha256

from .clocks import check_clock_of, clock_concerns
from .signals import ChannelLevel, Look, look, rate_concerns


def check_several(paths: Sequence[RecordingFile]) -> None:
    """Refuse a recording that is given twice, under one name or as a copy: it would count as two tests.

    Raises
    ------
    InputError
        With both names.
    """
    by_size: dict[int, list[Path]] = {}
    for path in (path_of(path) for path in paths):
        if path.is_file():
            by_size.setdefault(path.stat().st_size, []).append(path)
    for alike in (group for group in by_size.values() if len(group) > 1):
        seen: dict[str, Path] = {}
        for path in alike:
            first = seen.setdefault(sha256(path), path)
            if first is not path:
                raise InputError(f"{path.name} is the same recording as {first.name}; give each test once")


T = TypeVar("T")


def doubts_of(check: Callable[[T, str], list[str]], given: T, name: str) -> list[str]:
    """Collect the doubts of a check; a refusal counts as one more doubt.

    Parameters
    ----------
    check
        Check of the gate, a function of what is given and of the name of its file.
    given, name
        Object that is checked, and the name of its file.
    """
    try:
        return check(given, name)
    except InputError as error:
        return [str(error)]


IMPULSIVE = 12.0
"""Peak over standard deviation above which a force is taken for taps of a hammer; a cut has less than 6."""

LONGEST = 900.0
"""Seconds beyond which a recording is no hammer test."""

SUSPECT = 5.0
"""Peak over standard deviation from which a force is looked at: one tap in a short record has little more."""

STANDS_OUT = 12.0
"""Peak over the force's middle magnitude from which pulses stand in quiet: a cut has below 5."""

DUTY = 0.1
"""Share of the time in contact, at most; teeth of a light cut have about as much."""

MANY = 10.0
"""Taps a segment from which they are a random force, as segments and windows are made for."""

EARLY = 0.25
"""Share of a segment within which a tap must lie if the segment is to hold its answer."""


@dataclass(frozen=True)
class Segmentation:
    """Segments into which a job cuts a recording.

    Parameters
    ----------
    seconds : s
        Duration of a segment.
    overlap
        Share that a segment has in common with the next.
    window
        Name of the window.
    """

    seconds: float
    overlap: float
    window: str


def refuse_taps(stream: Stream, levels: Sequence[ChannelLevel], cut: Segmentation) -> None:
    """Refuse a recording of hammer taps whose force and answer the segments would weigh differently.

    A window is large in its middle, wherever the tap is: it can make the answer many times larger than the force, with
    a coherence of one. Segments without window and overlap hold where each begins just before a tap.

    Raises
    ------
    InputError
        With the number of taps and the command that is made for them.
    """
    if stream.duration > LONGEST:
        return
    for level in levels:
        if level.channel.quantity != "force" or level.n_missing or level.peak < SUSPECT * level.deviation:
            continue
        force = np.concatenate([block[:, 0] for block in stream.blocks(channels=[level.channel.name])])
        if not _tapped(force, stream.sample_rate, cut.seconds):
            continue
        times = np.array([tap.time for tap in find_taps(force, stream.sample_rate)])
        if cut.window == "boxcar" and cut.overlap == 0 and _early(times, stream.duration, cut.seconds):
            continue
        raise InputError(
            f"{stream.path.name}: the force on {level.channel.name} comes in {len(times)} "
            f"tap{'s' if len(times) != 1 else ''} of a hammer; segments of {cut.seconds:g} s {_harm(cut)}: use "
            "'millfrf tap', which cuts at the taps"
        )


def _harm(cut: Segmentation) -> str:
    if cut.window == "boxcar":
        return "begin anywhere between them, so that answers are cut off and counted without their tap"
    return f"under a {cut.window} window weigh a tap and its answer differently: the FRF would be wrong many times over"


def _tapped(force: NDArray[np.float64], sample_rate: float, seconds: float) -> bool:
    """Say whether a force is a few pulses in quiet."""
    size = np.abs(force - np.median(force))
    if size.max() <= STANDS_OUT * 1.4826 * np.median(size):
        return False
    pushed = size > 0.2 * size.max()
    pulses = int(np.sum(np.diff(pushed.astype(np.int8)) > 0)) + int(pushed[0])
    a_segment = pulses * min(1.0, seconds * sample_rate / len(force))
    return bool(pushed.mean() < DUTY and a_segment < MANY)


def _early(times: NDArray[np.float64], duration: float, seconds: float) -> bool:
    """Say whether each tap that lies in a whole segment lies at its beginning."""
    whole = times[times < np.floor(duration / seconds) * seconds]
    return bool(((whole % seconds) < EARLY * seconds).all())


BELIEVED = {
    "force": 1e7,
    "moment": 1e7,
    "acceleration": 1e7,
    "velocity": 1e5,
    "displacement": 1e3,
    "voltage": 1e6,
    "angular_velocity": 1e6,
}
"""Largest magnitude that a channel of each quantity may hold, SI: beyond what any sensor on a machine gives (shock
accelerometers end at 1e6 m/s^2, dynamometers at 1e6 N)."""


NAME_OTHERS = "name the other channels with --excitation and --response"
"""What a job offers whose channels can be chosen."""

RECORD_AGAIN = "record again, without the channel if that axis is not measured"
"""Where they cannot."""


@dataclass(frozen=True)
class JudgedRecording:
    """What the gate saw in one recording of a job; :func:`join_judged` weighs all of them together.

    Parameters
    ----------
    file
        Name of the file.
    doubts
        Doubts about it.
    idle, alive
        Names of excitations that are zero throughout, and of those that are not.
    """

    file: str
    doubts: tuple[str, ...]
    idle: tuple[str, ...]
    alive: tuple[str, ...]


def check_recordings(
    paths: Sequence[RecordingFile],
    *,
    stream: str | None = None,
    excitations: Sequence[str] = (),
    responses: Sequence[str] = (),
    excluding: bool = False,
    segments: Segmentation | None = None,
    remedy: str = NAME_OTHERS,
) -> list[str]:
    """Judge the channels that a job takes from its recordings, file by file.

    Parameters
    ----------
    paths
        Recording files, in any order.
    stream
        Sample clock; None: the only one.
    excitations, responses
        Channel names; empty: chosen by quantity as :func:`estimation.choose_channels` does.
    excluding
        The job leaves out segments with missing, clipped or repeated samples: they are neither refused nor doubted.
    segments
        Segments over which the job averages; None: it does not.
    remedy
        What to do about a channel that is dead or copies another, besides checking its cable.

    Returns
    -------
    list of str
        Doubts, each with the name of its file: clipped, held or repeated samples, proportional channels, a recording
        that was not closed in order.

    Raises
    ------
    InputError
        A dead channel (an excitation: dead in every file), samples that are not finite or beyond what a sensor gives,
        a channel that copies another, or a sample rate that the host's clock contradicts; taps of a hammer where
        segments would spoil them.
    """

    check_several(paths)
    judged = [
        judge_recording(
            path,
            stream=stream,
            excitations=excitations,
            responses=responses,
            excluding=excluding,
            segments=segments,
            remedy=remedy,
        )
        for path in paths
    ]
    return join_judged(judged, remedy)


def judge_recording(
    path: RecordingFile,
    *,
    stream: str | None = None,
    excitations: Sequence[str] = (),
    responses: Sequence[str] = (),
    excluding: bool = False,
    segments: Segmentation | None = None,
    remedy: str = NAME_OTHERS,
) -> JudgedRecording:
    """Judge one recording of a job by itself, as :func:`check_recordings` does.

    Raises
    ------
    InputError
        As :func:`check_recordings`; excitations that rest in this file are not refused, another file may drive them.
    """

    def chosen(source: Stream) -> tuple[Sequence[str], Sequence[str]]:
        exciting, responding = choose_channels(source, excitations or None, responses or None)
        return [channel.name for channel in exciting], [channel.name for channel in responding]

    return _judged(path, chosen, stream, excluding, segments, remedy)


def join_judged(judged: Sequence[JudgedRecording], remedy: str = NAME_OTHERS) -> list[str]:
    """Doubts about recordings of one job that were judged one by one.

    Raises
    ------
    InputError
        An excitation that is dead in every file.
    """
    alive = {name for one in judged for name in one.alive}
    silent_in = {name: one.file for one in judged for name in one.idle}
    for name, file in silent_in.items():
        if name not in alive:
            raise InputError(_dead(file, name, "every sample is 0", remedy))
    return [f"{one.file}: {doubt}" for one in judged for doubt in one.doubts]


def check_channels(
    paths: Sequence[RecordingFile],
    chosen: Callable[[Stream], tuple[Sequence[str], Sequence[str]]],
    stream: str | None = None,
    excluding: bool = False,
    segments: Segmentation | None = None,
    remedy: str = NAME_OTHERS,
) -> list[str]:
    """Judge recordings as :func:`check_recordings` does; ``chosen`` names exciting and responding channels.

    Raises
    ------
    InputError
        As :func:`check_recordings`.
    """
    check_several(paths)
    judged = [_judged(path, chosen, stream, excluding, segments, remedy) for path in paths]
    return join_judged(judged, remedy)


def _judged(
    path: RecordingFile,
    chosen: Callable[[Stream], tuple[Sequence[str], Sequence[str]]],
    stream: str | None,
    excluding: bool,
    segments: Segmentation | None,
    remedy: str,
) -> JudgedRecording:
    with opened(path) as recording:
        source = recording.stream(stream)
        exciting, responding = chosen(source)
        gaps = check_clock_of(recording, source.name)
        seen = _look(source, [*exciting, *responding])
        idle = [level.channel.name for level in seen.levels[: len(exciting)] if level.n_samples and not level.peak]
        found = _check_stream(source, seen, set(idle), excluding, remedy)
        found += gaps
        if segments is not None:
            refuse_taps(source, seen.levels[: len(exciting)], segments)
        if recording.complete is False:
            how = f" ({recording.ending})" if recording.ending else ""
            found.append(f"the recording was not closed in order{how}: its end may be missing")
    alive = tuple(name for name in exciting if name not in idle)
    return JudgedRecording(path_of(path).name, tuple(found), tuple(idle), alive)


def doubts_of_rate(path: RecordingFile) -> list[str]:
    """Judge the sample rates of a recording that was just made; a file of another kind is not judged."""
    if path_of(path).suffix.lower() not in (".h5", ".hdf5"):
        return []
    with opened(path) as recording:
        return [
            f"{path_of(path).name}: {text}"
            for name, one in recording.streams.items()
            for text in (*rate_concerns(one.sample_rate), *clock_concerns(recording, name))
        ]


def _look(stream: Stream, names: Sequence[str]) -> Look:
    if stream.n_samples == 0:
        raise InputError(f"{stream.path.name}: stream {stream.name} holds no sample; record again")
    return look(stream, names)


def _check_stream(stream: Stream, seen: Look, idle: set[str], excluding: bool, remedy: str) -> list[str]:
    """One stream; ``idle`` excitations are zero throughout, which another test of the job may make good."""
    for level in [level for level in seen.levels if level.channel.name not in idle]:
        _refuse(level, stream.path.name, excluding, remedy)
    for one, other in seen.copies.equal_pairs():
        raise InputError(
            f"{stream.path.name}: channel {other} holds the same samples as {one}; check the cables and the mapping, "
            f"or {remedy}"
        )
    if excluding:
        return []
    return [text for text in seen.concerns(stream.sample_rate) if "(dead channel)" not in text]


def _refuse(level: ChannelLevel, file: str, excluding: bool, remedy: str) -> None:
    """Refuse a channel that gives nothing or nothing that can be."""
    name, unit = level.channel.name, level.channel.unit
    if level.n_missing and not excluding:
        raise InputError(
            f"{file}: channel {name} holds {level.n_missing} samples that are NaN or infinite; cut them out, or "
            "estimate with --exclude"
        )
    most = BELIEVED.get(level.channel.quantity)
    if most is not None and level.peak > most:
        raise InputError(
            f"{file}: channel {name} reaches {level.peak:.3g} {unit}, more than {most:g} {unit}: no sensor gives that; "
            "check its unit and sensitivity"
        )
    if level.n_samples == 0 or level.deviation <= 1e-12 * level.peak:
        value = f"every sample is {level.mean:g}" if level.n_samples else "no sample is finite"
        raise InputError(_dead(file, name, value, remedy))


def _dead(file: str, name: str, value: str, remedy: str) -> str:
    return f"{file}: channel {name} is dead ({value}); check cable and supply, or {remedy}"
