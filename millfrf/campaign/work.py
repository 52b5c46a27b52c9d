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
from millfrf.gate import CheckedRecording, Gain, Segmentation, check_recording
from millfrf.steps.estimate import EstimateOptions, gain_of_test


@dataclass(frozen=True)
class Outcome:
    """Outcome of a task."""

    identity: str  # kind:name
    done: bool  # False: refused
    folder: Path
    reason: str = ""  # of the refusal, one line; empty: done
    warnings: tuple[str, ...] = ()

    @property
    def kind(self) -> str:
        return self.identity.partition(":")[0]

    @property
    def name(self) -> str:
        return self.identity.partition(":")[2]


@dataclass(frozen=True)
class Work:
    """Inputs of a job."""

    files: tuple[Path, ...]
    digests: tuple[str, ...]  # SHA-256 of each file
    needs: tuple[Outcome, ...]  # outcomes of the tasks that were needed
    settings: Mapping[str, Any]

    def need(self, kind: str) -> Outcome:
        """Return the only input outcome of a kind; raise an error if its task was refused."""
        (outcome,) = (need for need in self.needs if need.kind == kind)
        if not outcome.done:
            raise InputError(f"no {kind}: {outcome.reason}")
        return outcome


def as_options(stored: Mapping[str, Any]) -> dict[str, Any]:
    """Convert lists in options to tuples, because JSON stores tuples as lists."""
    return {name: tuple(value) if isinstance(value, list) else value for name, value in stored.items()}


JUDGED = "judged.json"


def check(work: Work, folder: Path) -> list[str]:
    """Check one recording with the same tests as the commands, and store the result for the later tasks of the set."""
    if work.settings["fault"]:
        raise InputError(work.settings["fault"])
    (path,) = work.files
    options = EstimateOptions(**as_options(work.settings["options"]))
    with opened(path) as recording:
        settings = options.settings(recording)
        segments = (
            Segmentation(settings.segment, settings.overlap, settings.window) if work.settings["segments"] else None
        )
        judged = check_recording(
            recording,
            stream=settings.stream,
            excitations=settings.excitations,
            responses=settings.responses,
            excluding=settings.exclude,
            segments=segments,
        )
        rate = recording.stream(settings.stream).sample_rate
    content = {**asdict(judged), "sample_rate": rate, "sha256": work.digests[0]}
    (folder / JUDGED).write_text(json.dumps(content, indent=1), encoding="utf-8")
    return list(judged.doubts)


def read_judged(check: Outcome) -> tuple[CheckedRecording, dict[str, Any]]:
    """Read the stored check of a recording; also return the sample rate (Hz) and the hash of the recording."""
    stored = json.loads((check.folder / JUDGED).read_text(encoding="utf-8"))
    extra = {name: stored.pop(name) for name in ("sample_rate", "sha256")}
    return CheckedRecording(**as_options(stored)), extra


def sound_checks(work: Work) -> tuple[list[Outcome], list[str]]:
    """Return the checks of usable recordings, and one line for each recording that is not usable."""
    checks = [check for check in work.needs if check.kind == "check"]
    usable = [check for check in checks if check.done]
    lines = [f"left out {check.name}: {check.reason}" for check in checks if not check.done]
    if not usable:
        raise InputError(f"no recording can be used: {'; '.join(check.reason for check in checks)}")
    return usable, lines


def sound_files(work: Work, after: int = 0) -> tuple[list[Path], list[str]]:
    """Return the usable recordings among the files from number ``after`` on.

    Also return one line for each recording of the set that is not usable.
    """
    usable, lines = sound_checks(work)
    names = {check.name for check in usable}
    return [path for path in work.files[after:] if path.stem in names], lines


SPECTRA = "spectra.npz"
_ARRAYS = ("frequencies", "input_spectra", "cross_spectra", "output_spectra")
_NUMBERS = ("n_segments", "effective_averages", "sample_rate", "n_tests", "n_excluded")


def write_spectra(folder: Path, spectra: CrossSpectra, gains: Sequence[Gain]) -> None:
    """Write spectra with the gain of each test, uncompressed: noise does not compress."""
    header: dict[str, Any] = {name: getattr(spectra, name) for name in _NUMBERS}
    header["excitations"] = [channel.to_json() for channel in spectra.excitations]
    header["responses"] = [channel.to_json() for channel in spectra.responses]
    header["settings"] = asdict(spectra.settings)
    header["gains"] = [{"name": gain.name, "rate": gain.rate, "first": gain.first} for gain in gains]
    arrays = {name: getattr(spectra, name) for name in _ARRAYS}
    for number, gain in enumerate(gains):
        arrays[f"gain_{number}"], arrays[f"shares_{number}"] = gain.values, gain.shares
    np.savez(folder / SPECTRA, beside=np.array(json.dumps(header)), **arrays)


def read_spectra(folder: Path) -> tuple[CrossSpectra, list[Gain]]:
    """Read what :func:`write_spectra` wrote."""
    with np.load(folder / SPECTRA, allow_pickle=False) as stored:
        header = json.loads(str(stored["beside"]))
        gains = [
            Gain(gain["name"], gain["rate"], gain["first"], stored[f"gain_{number}"], stored[f"shares_{number}"])
            for number, gain in enumerate(header["gains"])
        ]
        spectra = CrossSpectra(
            **{name: stored[name] for name in _ARRAYS},
            **{name: header[name] for name in _NUMBERS},
            excitations=tuple(Channel.from_json(gain) for gain in header["excitations"]),
            responses=tuple(Channel.from_json(gain) for gain in header["responses"]),
            settings=SpectralSettings(**header["settings"]),
        )
    return spectra, gains


NO_CHECK = "no check: "  # start of the reason if the check has refused the recording


def spectra(work: Work, folder: Path) -> list[str]:
    """Estimate the spectra of one recording, or of a range of its segments."""
    work.need("check")
    (path,) = work.files
    options = EstimateOptions(**as_options(work.settings["options"]))
    segments = work.settings["segments"]
    with opened(path) as recording:
        estimated = spectra_of_test(
            recording, options.settings(recording), None if segments is None else tuple(segments)
        )
    write_spectra(folder, estimated, [gain_of_test(estimated, path.name, options)] if segments is None else [])
    return []


def join(work: Work, folder: Path) -> list[str]:
    """Add up the spectra of the parts of one recording."""
    for need in work.needs:
        if not need.done:
            raise InputError(need.reason)
    joined = join_parts([read_spectra(need.folder)[0] for need in work.needs])
    options = EstimateOptions(**as_options(work.settings["options"]))
    write_spectra(folder, joined, [gain_of_test(joined, work.files[0].name, options)])
    return []


def add(work: Work, folder: Path) -> list[str]:
    """Add up the spectra of several tests; leave out refused tests."""
    usable = [read_spectra(need.folder) for need in work.needs if need.done]
    if not usable:
        raise InputError("; ".join(dict.fromkeys(need.reason for need in work.needs)))
    write_spectra(folder, sum_tests([result for result, _ in usable]), [gain for _, gains in usable for gain in gains])
    return lines_on_refused(work.needs)


def lines_on_refused(tests: Sequence[Outcome]) -> list[str]:
    """Return one line for each refused test, except those that the check of the recording reports."""
    reported = [line for test in tests if test.kind == "sum" for line in test.warnings]
    refused = [test for test in tests if not test.done and not test.reason.startswith(NO_CHECK)]
    return [*reported, *(f"left out {test.name}: {test.reason}" for test in refused)]
