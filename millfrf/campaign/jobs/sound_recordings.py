"""The job `check`: a recording judged by itself; and which recordings of a set are left after it."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from acquisition import Recording
from millfrf.core import InputError

from ...chain import EstimateOptions, with_instruments
from ...gate import JudgedRecording, Segmentation, judge_recording
from .work import Outcome, Work, as_options

JUDGED = "judged.json"


def check(work: Work, folder: Path) -> list[str]:
    """Judge one recording as the commands do that read it; what was seen is kept for the set.

    Raises
    ------
    InputError
        The recording cannot be used.
    """
    if work.settings["fault"]:
        raise InputError(work.settings["fault"])
    (path,) = work.files
    options = EstimateOptions(**as_options(work.settings["options"]))
    taken = with_instruments(path, options)
    segments = Segmentation(taken.segment, taken.overlap, taken.window) if work.settings["segments"] else None
    judged = judge_recording(
        path,
        stream=taken.stream,
        excitations=taken.excitations,
        responses=taken.responses,
        excluding=taken.exclude,
        segments=segments,
    )
    with Recording(path) as recording:
        rate = recording.stream(taken.stream).sample_rate
    content = {**asdict(judged), "sample_rate": rate, "sha256": work.digests[0]}
    (folder / JUDGED).write_text(json.dumps(content, indent=1), encoding="utf-8")
    return list(judged.doubts)


def read_judged(check: Outcome) -> tuple[JudgedRecording, dict[str, Any]]:
    """What a check saw, and the recording's sample rate (Hz) and hash."""
    stored = json.loads((check.folder / JUDGED).read_text(encoding="utf-8"))
    beside = {name: stored.pop(name) for name in ("sample_rate", "sha256")}
    return JudgedRecording(**as_options(stored)), beside


def sound_checks(work: Work) -> tuple[list[Outcome], list[str]]:
    """Checks of the recordings that are left, and a line for each that is not.

    Raises
    ------
    InputError
        None is left.
    """
    checks = [one for one in work.needs if one.kind == "check"]
    left = [one for one in checks if one.done]
    lines = [f"left out {one.name}: {one.reason}" for one in checks if not one.done]
    if not left:
        raise InputError(f"no recording is left: {'; '.join(one.reason for one in checks)}")
    return left, lines


def sound_files(work: Work, after: int = 0) -> tuple[list[Path], list[str]]:
    """Recordings that are left among the files from number ``after`` on, and a line for each that is not.

    Raises
    ------
    InputError
        None is left.
    """
    left, lines = sound_checks(work)
    names = {one.name for one in left}
    return [path for path in work.files[after:] if path.stem in names], lines
