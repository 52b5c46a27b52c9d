"""Table of modes of a campaign (CSV and Parquet), and its report."""

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from millfrf.core import InputError, Real, optional_library, write_csv, writing_whole_file
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

# columns of whole numbers, empty if unknown
WHOLE_NUMBERS = ("mode_of_set", "mode")

# columns of text; a label is text if one of its values is; all other columns are numbers
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


def write_mode_tables(
    folder: Path, rows: Sequence[Mapping[str, Cell]], provenance: Mapping[str, Any], warnings: Sequence[str]
) -> None:
    """Write ``modes.csv`` and ``modes.parquet``."""
    pd = optional_library("pandas", PURPOSE, EXTRA)
    arrow = optional_library("pyarrow", PURPOSE, EXTRA)
    parquet = optional_library("pyarrow.parquet", PURPOSE, EXTRA)
    frame = _typed(pd.DataFrame(list(rows), columns=list(rows[0]) if rows else ["set"]))
    cells = csv.reader(frame.to_csv(index=False, header=False, float_format="%.10g").splitlines(keepends=True))
    write_csv(folder / "modes.csv", list(frame.columns), cells, warnings=warnings, provenance=provenance)
    table = arrow.Table.from_pandas(frame, preserve_index=False)
    metadata = {
        "millfrf.format": "millfrf.modes 1",
        "millfrf.provenance": json.dumps(dict(provenance)),
        "millfrf.warnings": json.dumps(list(warnings)),
    }
    table = table.replace_schema_metadata({**(table.schema.metadata or {}), **metadata})
    with writing_whole_file(folder / "modes.parquet") as temporary:
        parquet.write_table(table, temporary)


def _typed(frame: Any) -> Any:
    """Convert each column to whole numbers, numbers or text."""
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
    if isinstance(value, float):
        return "" if value != value else f"{value:.10g}"
    return str(value)


@dataclass(frozen=True)
class Findings:
    """Results of a campaign before they are written."""

    sets: tuple[SetResults, ...]  # by name
    modes: IdentifiedModes
    labels: Labels  # regressors
    series: tuple[Series, ...]
    drifts: Drifts
    outliers: Outliers


def findings_of(sets: Sequence[MeasuredSet]) -> Findings:
    """Read the sets, identify modes, find drifts and outliers."""
    results = tuple(read_set(measured) for measured in sorted(sets, key=lambda measured: measured.name))
    modes = identify_modes(results)
    labels = labels_of([measured.measured for measured in results])
    series = tuple(series_of(results, modes))
    return Findings(results, modes, labels, series, *drifts_and_outliers(series, labels))


def write_summary(
    folder: Path,
    title: str,
    sets: Sequence[MeasuredSet],
    *,
    robot: str | None,
    learned: Path | None,
    failures: Sequence[str],
) -> tuple[str, ...]:
    """Write ``modes.csv``, ``modes.parquet``, ``report.html`` and maps as PNG; equal input gives equal bytes."""
    findings = findings_of(sets)
    places, map_error = tip_positions(robot, findings.sets)
    coverage, coverage_error = _coverage(folder, robot, learned, findings.sets)
    failed = all_failures(findings.sets, [*failures, *(line for line in (map_error, coverage_error) if line)])
    inputs = [path for item in sets for path in (item.model, item.lobes, item.diagnosis) if path is not None]
    inputs += [] if learned is None else [learned]
    provenance = origin("campaign report", sorted(inputs), {"title": title, "robot": robot})
    doubts = _doubts(findings)
    write_mode_tables(folder, mode_rows(findings.sets, findings.modes.names, places), provenance, doubts)
    contradicted = [] if coverage is None else [contradiction_words(item) for item in coverage.contradictions]
    trends = drift_section(findings.drifts, findings.sets, trend_pictures(folder, findings.drifts))
    picture, trends = trends.without_first_picture()
    sections: list[Section] = [
        trends,
        outlier_section(findings.outliers, findings.sets, contradicted),
        _maps(folder, findings, places),
        *([] if coverage is None or robot is None else [posture_section(folder, coverage, Path(robot).name)]),
        failure_section(failed),
        set_section(findings.sets),
    ]
    verdict = verdict_sentences(findings.sets, findings.drifts, findings.outliers, contradicted, failed)
    page = ResultsPage("Report of a campaign", title, _size(findings), tuple(verdict), tuple(doubts), picture=picture)
    write_results_page(folder / "report.html", page, sections)
    return tuple(verdict)


def _coverage(
    folder: Path, robot: str | None, learned: Path | None, sets: Sequence[SetResults]
) -> tuple[PostureCoverage | None, str]:
    """Return the coverage of the posture model and copy its file; or return the reason why there is none."""
    if robot is None or learned is None:
        return None, ""
    try:
        coverage = coverage_of(robot, learned, {results.name: results.measured.pose for results in sets})
    except InputError as error:
        return None, f"posture model: {error}"
    with writing_whole_file(folder / FILE) as temporary:
        temporary.write_bytes(learned.read_bytes())
    return coverage, ""


def _maps(folder: Path, findings: Findings, places: dict[str, Real]) -> Section:
    poses = len({results.measured.pose for results in findings.sets if results.model is not None})
    return map_section(folder, findings.series, findings.modes, map_plane(findings.sets, places), poses)


def _doubts(findings: Findings) -> list[str]:
    """Return warnings about the table and the report."""
    sentences = [*error_bar_sentences(findings.outliers), *findings.labels.notes]
    n_uncertain = sum(1 for name in findings.modes.names.values() if name.doubt)
    if n_uncertain:
        sentences.append(
            f"The identity of {n_uncertain} of {len(findings.modes.names)} modes in other sets or poses is uncertain; "
            "modes.csv states why (mode_doubt)."
        )
    if any(results.measured.pose == NOT_STATED for results in findings.sets):
        sentences.append("Sets without pose and posture are assumed to share a pose.")
    return sentences


def _size(findings: Findings) -> str:
    recordings = sum(len(results.measured.recordings) for results in findings.sets)
    poses = len({results.measured.pose for results in findings.sets})
    modes = sum(0 if results.model is None else len(results.model.poles) for results in findings.sets)
    return f"{recordings} recordings, {len(findings.sets)} sets, {poses} poses, {modes} modes"
