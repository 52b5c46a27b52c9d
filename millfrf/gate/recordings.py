"""Checks of recordings: no channel is dead, incomplete, implausible or a copy of another."""

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
from millfrf.core.terminal import grouped

from .clocks import check_clock_of, clock_warnings, missing_sample_warnings
from .settings import GATE
from .signal_faults import hum_warnings
from .signals import ChannelLevel, SignalCheck, check_signals, sample_rate_warnings


def check_several(paths: Sequence[RecordingFile]) -> None:
    """Refuse a recording that is given twice (under one name or as a copy), because it would count as two tests."""
    # files of different sizes differ, so only files of equal size are hashed, because recordings are large
    by_size: dict[int, list[Path]] = {}
    for path in (path_of(path) for path in paths):
        if path.is_file():
            by_size.setdefault(path.stat().st_size, []).append(path)
    for group in by_size.values():
        if len(group) == 1:
            continue
        seen: dict[str, Path] = {}
        for path in group:
            first = seen.setdefault(sha256(path), path)
            if first is not path:
                raise InputError(f"{path.name} is the same recording as {first.name}; give each test once")


T = TypeVar("T")

ChannelChoice = Callable[[Stream], tuple[Sequence[str], Sequence[str]]]  # names of exciting and responding channels


def warnings_of(check: Callable[[T, str], list[str]], checked: T, name: str) -> list[str]:
    """Return the warnings of a check; convert an error of the check to a warning.

    Parameters
    ----------
    check
        Function of this package that takes an object and the name of its file.
    checked, name
        Object that is checked, and the name of its file.
    """
    try:
        return check(checked, name)
    except InputError as error:
        return [str(error)]


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


def refuse_taps(stream: Stream, levels: Sequence[ChannelLevel], segments: Segmentation) -> None:
    """Refuse a recording of hammer taps if the segments would weight force and response differently.

    A window is large in the middle of a segment, wherever the tap is. It can therefore enlarge the response many times
    relative to the force, with a coherence of 1. Segments without window and overlap are correct if each segment begins
    just before a tap.
    """
    if stream.duration > GATE.tap_record_max:
        return
    for level in levels:
        if level.channel.quantity != "force" or level.n_missing:
            continue
        if level.peak < GATE.tap_peak_possible * level.deviation:
            continue
        force = np.concatenate([block[:, 0] for block in stream.blocks(channels=[level.channel.name])])
        if not _has_taps(force, stream.sample_rate, segments.seconds):
            continue
        times = np.array([tap.time for tap in find_taps(force, stream.sample_rate)])
        unweighted = segments.window == "boxcar" and segments.overlap == 0
        if unweighted and _taps_at_start(times, stream.duration, segments.seconds):
            continue
        raise InputError(
            f"{stream.path.name}: the force on {level.channel.name} comes in {len(times)} "
            f"tap{'s' if len(times) != 1 else ''} of a hammer; segments of {segments.seconds:g} s {_harm(segments)}: "
            "use 'millfrf tap', which cuts at the taps"
        )


def _harm(segments: Segmentation) -> str:
    if segments.window == "boxcar":
        return "begin anywhere between them, so that responses are cut off and counted without their tap"
    return f"under a {segments.window} window weight a tap and its response differently: the FRF would be wrong"


def _has_taps(force: NDArray[np.float64], sample_rate: float, seconds: float) -> bool:
    """Return whether a force consists of a few pulses between quiet intervals."""
    size = np.abs(force - np.median(force))
    # 1.4826 times the median magnitude is the standard deviation of Gaussian noise, and taps do not affect it
    if size.max() <= GATE.tap_over_median * 1.4826 * np.median(size):
        return False
    contact = size > 0.2 * size.max()
    pulses = int(np.sum(np.diff(contact.astype(np.int8)) > 0)) + int(contact[0])
    per_segment = pulses * min(1.0, seconds * sample_rate / len(force))
    return bool(contact.mean() < GATE.tap_contact_max and per_segment < GATE.taps_per_segment)


def _taps_at_start(times: NDArray[np.float64], duration: float, seconds: float) -> bool:
    """Return whether each tap in a complete segment lies at the beginning of its segment."""
    complete = times[times < np.floor(duration / seconds) * seconds]
    return bool(((complete % seconds) < GATE.tap_early * seconds).all())


# Largest magnitude of each quantity, SI: beyond what any sensor on a machine gives (shock accelerometers end at
# 1e6 m/s^2, dynamometers at 1e6 N).
LARGEST = {
    "force": 1e7,
    "moment": 1e7,
    "acceleration": 1e7,
    "velocity": 1e5,
    "displacement": 1e3,
    "voltage": 1e6,
    "angular_velocity": 1e6,
}

# remedies for a dead channel, where the channels of a job can be chosen and where they cannot
NAME_OTHERS = "name the other channels with --excitation and --response"
RECORD_AGAIN = "record again, without the channel if that axis is not measured"


@dataclass(frozen=True)
class CheckedRecording:
    """Result of the check of one recording of a job; :func:`join_checks` combines the results of all recordings.

    Parameters
    ----------
    file
        Name of the file.
    doubts
        Warnings about the recording.
    idle, alive
        Names of excitations that are zero throughout, and of those that are not.
    """

    file: str
    doubts: tuple[str, ...]  # the fields are keys of a campaign's stored results: they keep their names
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
    """Check the channels that a job takes from its recordings, file by file.

    Parameters
    ----------
    paths
        Recording files, in any order.
    stream
        Sample clock; None: the only one.
    excitations, responses
        Channel names; empty: chosen by quantity as :func:`estimation.choose_channels` does.
    excluding
        The job leaves out segments with missing, clipped or repeated samples: these cause no error and no warning.
    segments
        Segments over which the job averages; None: it does not average.
    remedy
        Remedy for a channel that is dead or copies another, besides checking its cable.

    Returns
    -------
    list of str
        Warnings, each with the name of its file: clipped, constant or repeated samples, proportional channels, a
        recording that was not closed in order.

    Raises
    ------
    InputError
        A dead channel (an excitation: dead in every file), samples that are not finite or beyond what a sensor gives,
        a channel that copies another, or a sample rate that the host's clock contradicts; taps of a hammer that the
        segments would distort.
    """
    check_several(paths)
    checked = [
        check_recording(
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
    return join_checks(checked, remedy)


def check_recording(
    path: RecordingFile,
    *,
    stream: str | None = None,
    excitations: Sequence[str] = (),
    responses: Sequence[str] = (),
    excluding: bool = False,
    segments: Segmentation | None = None,
    remedy: str = NAME_OTHERS,
) -> CheckedRecording:
    """Check one recording of a job, as :func:`check_recordings` does.

    Raises
    ------
    InputError
        As :func:`check_recordings`, except for excitations that are zero in this file: another file may drive them.
    """

    def chosen(source: Stream) -> tuple[Sequence[str], Sequence[str]]:
        exciting, responding = choose_channels(source, excitations or None, responses or None)
        return [channel.name for channel in exciting], [channel.name for channel in responding]

    return _check_one(path, chosen, stream, excluding, segments, remedy)


def join_checks(recordings: Sequence[CheckedRecording], remedy: str = NAME_OTHERS) -> list[str]:
    """Combine the checks of all recordings of a job, and return their warnings.

    Raises
    ------
    InputError
        An excitation that is dead in every file.
    """
    alive = {name for recording in recordings for name in recording.alive}
    silent_in = {name: recording.file for recording in recordings for name in recording.idle}
    for name, file in silent_in.items():
        if name not in alive:
            raise InputError(_dead(file, name, "every sample is 0", remedy))
    return grouped(f"{recording.file}: {warning}" for recording in recordings for warning in recording.doubts)


def check_channels(
    paths: Sequence[RecordingFile],
    chosen: ChannelChoice,
    stream: str | None = None,
    excluding: bool = False,
    segments: Segmentation | None = None,
    remedy: str = NAME_OTHERS,
    hum: bool = True,
) -> list[str]:
    """Check recordings as :func:`check_recordings` does; ``chosen`` names exciting and responding channels.

    ``hum``: whether mains hum gives a warning.

    Raises
    ------
    InputError
        As :func:`check_recordings`.
    """
    check_several(paths)
    return join_checks([_check_one(path, chosen, stream, excluding, segments, remedy, hum) for path in paths], remedy)


def _check_one(
    path: RecordingFile,
    chosen: ChannelChoice,
    stream: str | None,
    excluding: bool,
    segments: Segmentation | None,
    remedy: str,
    hum: bool = True,
) -> CheckedRecording:
    with opened(path) as recording:
        source = recording.stream(stream)
        exciting, responding = chosen(source)
        gaps = check_clock_of(recording, source.name)
        if source.n_samples == 0:
            raise InputError(f"{source.path.name}: stream {source.name} holds no sample; record again")
        signals = check_signals(source, [*exciting, *responding])
        driving = signals.levels[: len(exciting)]
        idle = [level.channel.name for level in driving if level.n_samples and not level.peak]
        warnings = _check_stream(source, signals, set(idle), excluding, remedy)
        warnings += gaps
        if hum:
            warnings += hum_warnings(source, [*(n for n in exciting if n not in idle), *responding])
        if segments is not None:
            refuse_taps(source, driving, segments)
        if recording.complete is False:
            how = f" ({recording.ending})" if recording.ending else ""
            warnings.append(f"the recording was not closed in order{how}: its end may be missing")
    alive = tuple(name for name in exciting if name not in idle)
    return CheckedRecording(path_of(path).name, tuple(warnings), tuple(idle), alive)


def rate_warnings(path: RecordingFile) -> list[str]:
    """Check the sample rates of a new recording and return warnings; do not check a file of another kind."""
    if path_of(path).suffix.lower() not in (".h5", ".hdf5"):
        return []
    with opened(path) as recording:
        return [
            f"{path_of(path).name}: {text}"
            for name, stream in recording.streams.items()
            for text in (
                *sample_rate_warnings(stream.sample_rate),
                *clock_warnings(recording, name),
                *missing_sample_warnings(recording, name),
            )
        ]


def _check_stream(stream: Stream, signals: SignalCheck, idle: set[str], excluding: bool, remedy: str) -> list[str]:
    """Check one stream of a recording.

    Excitations in ``idle`` are zero in this recording, but another test of the job may drive them.
    """
    for level in signals.levels:
        if level.channel.name not in idle:
            _refuse(level, stream.path.name, excluding, remedy)
    for first, copy in signals.copies.equal_pairs():
        raise InputError(
            f"{stream.path.name}: channel {copy} holds the same samples as {first}; check the cables and the mapping, "
            f"or {remedy}"
        )
    if excluding:
        return []
    return [text for text in signals.warnings(stream.sample_rate) if "(dead channel)" not in text]


def _refuse(level: ChannelLevel, file: str, excluding: bool, remedy: str) -> None:
    """Refuse a channel that is dead, not finite, or larger than any sensor signal."""
    name, unit = level.channel.name, level.channel.unit
    if level.n_missing and not excluding:
        raise InputError(
            f"{file}: channel {name} holds {level.n_missing} samples that are NaN or infinite; cut them out, or "
            "estimate with --exclude"
        )
    largest = LARGEST.get(level.channel.quantity)
    if largest is not None and level.peak > largest:
        raise InputError(
            f"{file}: channel {name} reaches {level.peak:.3g} {unit}, more than {largest:g} {unit}: no sensor gives "
            "that; check its unit and sensitivity"
        )
    if level.n_samples == 0 or level.deviation <= 1e-12 * level.peak:
        value = f"every sample is {level.mean:g}" if level.n_samples else "no sample is finite"
        raise InputError(_dead(file, name, value, remedy))


def _dead(file: str, name: str, value: str, remedy: str) -> str:
    return f"{file}: channel {name} is dead ({value}); check cable and supply, or {remedy}"
