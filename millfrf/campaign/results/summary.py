"""`write_summary`: the table of modes and the report of a campaign, from the results of its sets."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError, writing_whole_file

from ...provenance import origin
from ...report import ResultsPage, Section, write_results_page
from .drift import Drifts, Labels, Outliers, Series, drifts_and_outliers, labels_of, series_of
from .identity import IdentifiedModes, identify_modes
from .measured_set import NOT_STATED, MeasuredSet
from .page import (
    all_failures,
    drift_section,
    error_bar_sentences,
    failure_section,
    map_section,
    outlier_section,
    set_section,
    trend_pictures,
    verdict_sentences,
)
from .pictures import map_plane, tip_positions
from .postures import FILE, PostureCoverage, contradiction_words, coverage_of, posture_section
from .read_set import SetResults, read_set
from .table import mode_rows, write_mode_tables

Real = NDArray[np.float64]


@dataclass(frozen=True)
class Findings:
    """What a campaign found, before it is written.

    Parameters
    ----------
    sets
        Sets as read, by name.
    modes
        Which modes are the same.
    labels, series
        Labels as regressors, and each quantity through the sets of each pose.
    drifts, outliers
        What drifts, and what stands off.
    """

    sets: tuple[SetResults, ...]
    modes: IdentifiedModes
    labels: Labels
    series: tuple[Series, ...]
    drifts: Drifts
    outliers: Outliers


def findings_of(sets: Sequence[MeasuredSet]) -> Findings:
    """Read the sets, find which modes are the same, what drifts and what stands off.

    Parameters
    ----------
    sets
        Sets with their results, in any order.
    """
    found = tuple(read_set(one) for one in sorted(sets, key=lambda one: one.name))
    modes = identify_modes(found)
    labels = labels_of([one.measured for one in found])
    series = tuple(series_of(found, modes))
    return Findings(found, modes, labels, series, *drifts_and_outliers(series, labels))


def write_summary(
    folder: Path,
    title: str,
    sets: Sequence[MeasuredSet],
    *,
    robot: str | None,
    learned: Path | None,
    failures: Sequence[str],
) -> tuple[str, ...]:
    """Write ``modes.csv``, ``modes.parquet``, ``report.html`` and its maps as PNG; equal input gives equal bytes.

    Parameters
    ----------
    folder
        Folder of the files; it exists.
    title
        Title of the campaign.
    sets
        Sets with their results, in any order.
    robot
        Name of a robot that ships, or its file; None: no robot, so no places of the tool.
    learned
        File of learned postures, or None.
    failures
        One line for each recording or step that failed, whichever set it belongs to.

    Returns
    -------
    tuple of str
        Sentences of the verdict, as they stand at the top of the report.

    Raises
    ------
    InputError
        pandas or pyarrow are missing, or the folder cannot be written to.
    """
    found = findings_of(sets)
    places, lost = tip_positions(robot, found.sets)
    coverage, refused = _coverage(folder, robot, learned, found.sets)
    failed = all_failures(found.sets, [*failures, *(line for line in (lost, refused) if line)])
    inputs = [path for one in sets for path in (one.model, one.lobes, one.diagnosis) if path is not None]
    inputs += [] if learned is None else [learned]
    made = origin("campaign report", sorted(inputs), {"title": title, "robot": robot})
    doubts = _doubts(found)
    write_mode_tables(folder, mode_rows(found.sets, found.modes.names, places), made, doubts)
    contradicted = [] if coverage is None else [contradiction_words(one) for one in coverage.contradictions]
    sections: list[Section] = [
        drift_section(found.drifts, found.sets, trend_pictures(folder, found.drifts)),
        outlier_section(found.outliers, found.sets, contradicted),
        _maps(folder, found, places),
        *([] if coverage is None or robot is None else [posture_section(folder, coverage, Path(robot).name)]),
        failure_section(failed),
        set_section(found.sets),
    ]
    verdict = verdict_sentences(found.sets, found.drifts, found.outliers, contradicted, failed)
    page = ResultsPage("Report of a campaign", title, _size(found), tuple(verdict), tuple(doubts))
    write_results_page(folder / "report.html", page, sections)
    return tuple(verdict)


def _coverage(
    folder: Path, robot: str | None, learned: Path | None, sets: Sequence[SetResults]
) -> tuple[PostureCoverage | None, str]:
    """The posture model at left-out poses, its file beside the report; or one line that says why there is none."""
    if robot is None or learned is None:
        return None, ""
    try:
        coverage = coverage_of(robot, learned, {one.name: one.measured.pose for one in sets})
    except InputError as error:
        return None, f"posture model: {error}"
    with writing_whole_file(folder / FILE) as temporary:
        temporary.write_bytes(learned.read_bytes())
    return coverage, ""


def _maps(folder: Path, found: Findings, places: dict[str, Real]) -> Section:
    poses = len({one.measured.pose for one in found.sets if one.model is not None})
    return map_section(folder, found.series, found.modes, map_plane(found.sets, places), poses)


def _doubts(found: Findings) -> list[str]:
    """What to know before trusting the table and the report."""
    told = [*error_bar_sentences(found.outliers), *found.labels.notes]
    unsure = sum(1 for name in found.modes.names.values() if name.doubt)
    if unsure:
        told.append(
            f"Of {unsure} of {len(found.modes.names)} modes it cannot be told for certain which mode of another set or "
            "pose they are; modes.csv says why (mode_doubt)."
        )
    if any(one.measured.pose == NOT_STATED for one in found.sets):
        told.append("Sets that state neither pose nor posture are taken to be in one pose.")
    return told


def _size(found: Findings) -> str:
    recordings = sum(len(one.measured.recordings) for one in found.sets)
    poses = len({one.measured.pose for one in found.sets})
    modes = sum(0 if one.model is None else len(one.model.poles) for one in found.sets)
    return f"{recordings} recordings, {len(found.sets)} sets, {poses} poses, {modes} modes"
