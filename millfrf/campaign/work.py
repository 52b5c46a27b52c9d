"""Inputs and outcomes of jobs; jobs on single recordings: checks and spectra."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acquisition import Channel, opened
from estimation import CrossSpectra, SpectralSettings, join_parts, spectra_of_test, sum_tests
from millfrf.core import InputError
from millfrf.gate import Gain, JudgedRecording, Segmentation, judge_recording
from millfrf.steps.estimate import EstimateOptions, gain_of_test


@dataclass(frozen=True)
class Outcome:
    """What became of a task.

    Parameters
    ----------
    identity
        Kind and name of the task.
    done
        Whether it was done; else it was refused.
    folder
        Folder of its result.
    reason
        Why it was refused, in one line; empty where it was done.
    warnings
        Doubts about its result.
    """

    identity: str
    done: bool
    folder: Path
    reason: str = ""
    warnings: tuple[str, ...] = ()

    @property
    def kind(self) -> str:
        """Kind of the task."""
        return self.identity.partition(":")[0]

    @property
    def name(self) -> str:
        """Name of what was done, without the kind."""
        return self.identity.partition(":")[2]


@dataclass(frozen=True)
class Work:
    """What a job works on.

    Parameters
    ----------
    files
        Paths of its files.
    digests
        SHA-256 of each.
    needs
        Outcomes of the tasks that it needs.
    settings
        Settings of the task.
    """

    files: tuple[Path, ...]
    digests: tuple[str, ...]
    needs: tuple[Outcome, ...]
    settings: Mapping[str, Any]

    def need(self, kind: str) -> Outcome:
        """The only outcome of that kind, which must have been done.

        Raises
        ------
        InputError
            It was refused; the line says why.
        """
        (found,) = (one for one in self.needs if one.kind == kind)
        if not found.done:
            raise InputError(f"no {kind}: {found.reason}")
        return found


def as_options(stored: Mapping[str, Any]) -> dict[str, Any]:
    """Options as a dataclass takes them: lists, which JSON makes of tuples, are tuples again."""
    return {name: tuple(value) if isinstance(value, list) else value for name, value in stored.items()}


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
    with opened(path) as recording:
        taken = options.settings(recording)
        segments = Segmentation(taken.segment, taken.overlap, taken.window) if work.settings["segments"] else None
        judged = judge_recording(
            recording,
            stream=taken.stream,
            excitations=taken.excitations,
            responses=taken.responses,
            excluding=taken.exclude,
            segments=segments,
        )
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


SPECTRA = "spectra.npz"
_ARRAYS = ("frequencies", "input_spectra", "cross_spectra", "output_spectra")
_NUMBERS = ("n_segments", "effective_averages", "sample_rate", "n_tests", "n_excluded")


def write_spectra(folder: Path, spectra: CrossSpectra, gains: Sequence[Gain]) -> None:
    """Write spectra, summed over one test or several, with the gain of each test, uncompressed."""
    beside: dict[str, Any] = {name: getattr(spectra, name) for name in _NUMBERS}
    beside["excitations"] = [channel.to_json() for channel in spectra.excitations]
    beside["responses"] = [channel.to_json() for channel in spectra.responses]
    beside["settings"] = asdict(spectra.settings)
    beside["gains"] = [{"name": one.name, "rate": one.rate, "first": one.first} for one in gains]
    arrays = {name: getattr(spectra, name) for name in _ARRAYS}
    for number, one in enumerate(gains):
        arrays[f"gain_{number}"], arrays[f"shares_{number}"] = one.values, one.shares
    np.savez(folder / SPECTRA, beside=np.array(json.dumps(beside)), **arrays)


def read_spectra(folder: Path) -> tuple[CrossSpectra, list[Gain]]:
    """Read what :func:`write_spectra` wrote."""
    with np.load(folder / SPECTRA, allow_pickle=False) as stored:
        beside = json.loads(str(stored["beside"]))
        gains = [
            Gain(one["name"], one["rate"], one["first"], stored[f"gain_{number}"], stored[f"shares_{number}"])
            for number, one in enumerate(beside["gains"])
        ]
        spectra = CrossSpectra(
            **{name: stored[name] for name in _ARRAYS},
            **{name: beside[name] for name in _NUMBERS},
            excitations=tuple(Channel.from_json(one) for one in beside["excitations"]),
            responses=tuple(Channel.from_json(one) for one in beside["responses"]),
            settings=SpectralSettings(**beside["settings"]),
        )
    return spectra, gains


NO_CHECK = "no check: "
"""How the reason begins where the recording itself was refused."""


def spectra(work: Work, folder: Path) -> list[str]:
    """Spectra of one recording, or of some of its segments.

    Raises
    ------
    InputError
        The recording cannot be used.
    """
    work.need("check")
    (path,) = work.files
    options = EstimateOptions(**as_options(work.settings["options"]))
    part = work.settings["segments"]
    with opened(path) as recording:
        found = spectra_of_test(recording, options.settings(recording), None if part is None else tuple(part))
    write_spectra(folder, found, [gain_of_test(found, path.name, options)] if part is None else [])
    return []


def join(work: Work, folder: Path) -> list[str]:
    """Spectra of the parts of one recording as those of the whole.

    Raises
    ------
    InputError
        A part was refused.
    """
    for one in work.needs:
        if not one.done:
            raise InputError(one.reason)
    found = join_parts([read_spectra(one.folder)[0] for one in work.needs])
    options = EstimateOptions(**as_options(work.settings["options"]))
    write_spectra(folder, found, [gain_of_test(found, work.files[0].name, options)])
    return []


def add(work: Work, folder: Path) -> list[str]:
    """Spectra of several tests, added up; tests that were refused are left out.

    Raises
    ------
    InputError
        None is left, or tests that cannot be stacked.
    """
    left = [read_spectra(one.folder) for one in work.needs if one.done]
    if not left:
        raise InputError("; ".join(dict.fromkeys(one.reason for one in work.needs)))
    write_spectra(folder, sum_tests([found for found, _ in left]), [gain for _, gains in left for gain in gains])
    return lines_on_refused(work.needs)


def lines_on_refused(tests: Sequence[Outcome]) -> list[str]:
    """A line for each test that is left out, other than those of which the check of the recording tells."""
    told = [line for one in tests if one.kind == "sum" for line in one.warnings]
    refused = [one for one in tests if not one.done and not one.reason.startswith(NO_CHECK)]
    return [*told, *(f"left out {one.name}: {one.reason}" for one in refused)]
