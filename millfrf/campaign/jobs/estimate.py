"""The job `estimate`: the FRF of a set, from spectra that other tasks made, as `millfrf estimate` would give it."""

from pathlib import Path

from millfrf.core import InputError

from ...chain import (
    LOCAL,
    EstimateOptions,
    check_equal_rates,
    estimate_of_spectra,
    estimate_recordings,
    write_estimate,
)
from ...gate import join_judged
from .sound_recordings import read_judged, sound_checks, sound_files
from .spectra import lines_on_refused
from .spectra_files import read_spectra
from .work import Work, as_options

FRF = "frf.h5"


def estimate(work: Work, folder: Path) -> list[str]:
    """FRF over the recordings of a set that are left.

    Raises
    ------
    InputError
        None is left, or the gate refuses them together.
    """
    options = EstimateOptions(**as_options(work.settings["options"]))
    if options.estimator == LOCAL:
        paths, lines = sound_files(work)
        found = estimate_recordings(paths, options)
        write_estimate(folder / FRF, found, paths)
        return [*lines, *found.warnings]
    checks, lines = sound_checks(work)
    tests = [one for one in work.needs if one.kind != "check"]
    left = [read_spectra(one.folder) for one in tests if one.done]
    if not left:
        raise InputError("; ".join(dict.fromkeys(one.reason for one in tests)))
    gains = [gain for _, gains in left for gain in gains]
    summed = {gain.name for gain in gains}
    judged = [found for found in map(read_judged, checks) if found[0].file in summed]
    _refuse_copies([(one.file, beside["sha256"]) for one, beside in judged])
    check_equal_rates([one.file for one, _ in judged], [beside["sample_rate"] for _, beside in judged])
    doubts = join_judged([one for one, _ in judged])
    doubts = [*lines, *lines_on_refused(tests), *doubts]
    made = estimate_of_spectra([found for found, _ in left], gains, doubts, options)
    stated = [{"file": one.file, "sha256": beside["sha256"]} for one, beside in judged]
    write_estimate(folder / FRF, made, [one.file for one, _ in judged], stated)
    return list(made.warnings)


def _refuse_copies(files: list[tuple[str, str]]) -> None:
    seen: dict[str, str] = {}
    for name, digest in files:
        if seen.setdefault(digest, name) != name:
            raise InputError(f"{name} is the same recording as {seen[digest]}; give each test once")
