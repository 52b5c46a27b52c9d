"""`write_summary`: the table of modes and the report of a campaign, from the results of its sets."""

from collections.abc import Sequence
from pathlib import Path

from ...provenance import origin
from ...report import ResultsPage, write_results_page
from .measured_set import MeasuredSet
from .page import failure_section, set_section
from .read_set import read_set
from .table import mode_rows, write_mode_tables


def write_summary(
    folder: Path,
    title: str,
    sets: Sequence[MeasuredSet],
    *,
    robot: str | None,
    learned: Path | None,
    failures: Sequence[str],
) -> None:
    """Write ``modes.csv``, ``modes.parquet`` and ``report.html`` into a folder; equal input gives equal bytes.

    Parameters
    ----------
    folder
        Folder of the files; it exists.
    title
        Title of the campaign.
    sets
        Sets with their results, in the order of the table.
    robot
        Name of a robot that ships, or its file; None: no robot, so no places of the tool.
    learned
        File of learned postures, or None.
    failures
        One line for each recording or step that failed, whichever set it belongs to.

    Raises
    ------
    InputError
        pandas or pyarrow are missing, or the folder cannot be written to.
    """
    found = [read_set(one) for one in sorted(sets, key=lambda one: one.name)]
    inputs = [path for one in sets for path in (one.model, one.lobes, one.diagnosis) if path is not None]
    made = origin("campaign summary", sorted(inputs), {"title": title, "robot": robot})
    write_mode_tables(folder, mode_rows(found, {}, {}), made, ())
    modes = sum(0 if one.model is None else len(one.model.poles) for one in found)
    without = sum(one.model is None for one in found)
    verdict = (f"{len(found)} sets, {modes} modes; {without} sets without a modal model.",)
    page = ResultsPage("Report of a campaign", title, "", verdict)
    write_results_page(folder / "report.html", page, [set_section(found), failure_section(found, failures)])
