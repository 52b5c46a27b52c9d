"""The jobs `spectra`, `join` and `sum`: spectra of a recording or a part of it, parts joined, tests added up."""

from collections.abc import Sequence
from pathlib import Path

from estimation import join_parts, sum_tests
from millfrf.core import InputError

from ...chain import EstimateOptions, gain_of_test, spectra_of_test, with_instruments
from .spectra_files import read_spectra, write_spectra
from .work import Outcome, Work, as_options

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
    found = spectra_of_test(path, with_instruments(path, options), segments=None if part is None else tuple(part))
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
