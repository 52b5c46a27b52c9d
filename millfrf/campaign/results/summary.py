"""The table of modes of a campaign as CSV and Parquet, and its report."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from millfrf.core import InputError, Real, optional_library, warning_lines, writing_whole_file
from millfrf.core.provenance import origin
from millfrf.reports.results_page import ResultsPage, write_results_page
from millfrf.reports.section import Section

from .drift import Drifts
from .identity import IdentifiedModes, identify_modes
from .outliers import Outliers, drifts_and_outliers
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
from .regression import Labels, labels_of
from .sets import NOT_STATED, Cell, MeasuredSet, SetResults, mode_rows, read_set
from .trends import Series, series_of

PURPOSE, EXTRA = "the table of a campaign", "cluster"

WHOLE_NUMBERS = ("mode_of_set", "mode")
"""Columns of whole numbers, empty where a set has no mode or a mode could not be told."""

WORDS = (
    "set",
    "pose",
    "recorded_at",
    "mode_doubt",
    "depth_limit_status",
    "verdict",
    "recordings",
    "doubts",
    "failures",
)
"""Columns of text; labels are text where one of their values is, and every other column holds numbers."""


def write_mode_tables(
    folder: Path, rows: Sequence[Mapping[str, Cell]], provenance: Mapping[str, Any], warnings: Sequence[str]
) -> None:
    """Write both files into a folder.

    Parameters
    ----------
    folder
        Folder of the files; older ones are replaced.
    rows
        Rows with equal columns, see :func:`mode_rows`.
    provenance
        Origin of the table; the line ``# provenance:`` of the CSV, and ``millfrf.provenance`` in the Parquet's schema.
    warnings
        Doubts about the whole table; lines ``# warning:`` and ``millfrf.warnings``.

    Raises
    ------
    InputError
        pandas or pyarrow are not installed, or the folder cannot be written to.
    """
    pd = optional_library("pandas", PURPOSE, EXTRA)
    arrow = optional_library("pyarrow", PURPOSE, EXTRA)
    parquet = optional_library("pyarrow.parquet", PURPOSE, EXTRA)
    frame = _typed(pd.DataFrame(list(rows), columns=list(rows[0]) if rows else ["set"]))
    with (
        writing_whole_file(folder / "modes.csv") as temporary,
        temporary.open("w", encoding="utf-8", newline="") as file,
    ):
        file.writelines(warning_lines(warnings))
        file.write(f"# provenance: {json.dumps(dict(provenance))}\n")
        frame.to_csv(file, index=False, float_format="%.10g", lineterminator="\n")
    table = arrow.Table.from_pandas(frame, preserve_index=False)
    stated = {
        "millfrf.format": "millfrf.modes 1",
        "millfrf.provenance": json.dumps(dict(provenance)),
        "millfrf.warnings": json.dumps(list(warnings)),
    }
    table = table.replace_schema_metadata({**(table.schema.metadata or {}), **stated})
    with writing_whole_file(folder / "modes.parquet") as temporary:
        parquet.write_table(table, temporary)


def _typed(frame: Any) -> Any:
    """Give each column one type: whole numbers, numbers, or text."""
    for name in frame.columns:
        values = [value for value in frame[name] if value is not None]
        if name in WHOLE_NUMBERS:
            frame[name] = frame[name].astype("Int64")
        elif name in WORDS or any(isinstance(value, str) for value in values):
            frame[name] = ["" if value is None else _as_text(value) for value in frame[name]]
        else:
            frame[name] = frame[name].astype("float64")
    return frame


def _as_text(value: Cell) -> str:
    """A label as text, where one value of its column is; a missing one is empty."""
    if isinstance(value, float):
        return "" if value != value else f"{value:.10g}"
    return str(value)


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
