"""The page that a robot's diagnosis leaves behind."""

import os

import numpy as np

from millfrf.figures import house_style, robot_evidence_figure, robot_spectra_figure
from millfrf.mismatch import ROBOT, Candidate, RobotDiagnosis, number_of, standard_error_of

from ...robot import UNITS, refusal, told_number, what_is_asked
from ...tables import Table
from ..pages import FigureFiles, ResultsPage, write_results_page
from ..section import Section, picture_of
from .made_when import made_when


def write_robot_report(
    path: str | os.PathLike[str],
    found: RobotDiagnosis,
    robot_name: str,
    summary: list[str],
    *,
    dated: bool = True,
    figures: FigureFiles | None = None,
) -> None:
    """Write one HTML page, figures inside, that needs no other file and no network.

    Parameters
    ----------
    path
        The page; an older one is replaced.
    found
        Diagnosis of the robot.
    robot_name
        Name of the robot, for the title.
    summary
        Verdict, a sentence on it, and a line for each cause and held-out recording.
    dated
        Whether the page tells when it was written; without, equal input gives equal bytes.
    figures
        Folder and format in which each figure is written as a file too; None: no files.
    """
    names = ", ".join(one.name for one in found.details.robot.recordings)
    page = ResultsPage(
        "Diagnosis of a robot model against recordings",
        f"{robot_name} against {names}",
        made_when(dated=dated),
        (f"{summary[0].removeprefix('verdict: ').capitalize()}: {summary[1]}.",),
        (*found.doubts, *_warnings(found)),
        (("What was found", tuple(summary[2:]) or ("Nothing to change.",)),),
    )
    write_results_page(path, page, [_spectra(found), _candidates(found), _postures(found)], figures)


def _warnings(found: RobotDiagnosis) -> list[str]:
    error = found.details.robot.error
    warnings = [
        f"A right model is taken to be off by {100 * error.frequency:g} % in frequency, {100 * error.damping:g} % in "
        f"damping and {100 * error.shape:g} % of a shape's size in each posture; what is smaller is not named."
    ]
    if len(found.details.robot.recordings) == 1:
        warnings.append("One posture loads the joints in one way: causes are told apart better from several.")
    warnings.append(what_is_asked())
    if found.after.share > ROBOT.verdict.noise_like:
        warnings.append(
            f"What is left is {found.after.share:.2g} times what a right model's modes are off (passes up to "
            f"{ROBOT.verdict.noise_like:g}): some of the physics is missing."
        )
    return warnings


def _spectra(found: RobotDiagnosis) -> Section:
    with house_style():
        figure = robot_spectra_figure(found)
    caption = (
        "Root of response power over force power, all channels of a recording together, as receptance. The modes of "
        "the robot are drawn without the small deviations that a right model is allowed."
    )
    columns: tuple[str, ...] = ("recording", "as modelled", "modes fitted freely")
    rows: list[tuple[str, ...]] = [
        (one.name, f"{100 * one.before:.3g}", f"{100 * one.floor:.3g}") for one in found.held_out
    ]
    if found.physics:
        columns = (*columns[:2], "with the change", columns[2])
        pairs = zip(rows, found.held_out, strict=True)
        rows = [(*row[:2], f"{100 * one.after:.3g}", row[2]) for row, one in pairs]
    table = Table("Error of recordings that were left out of the fit (% of the response)", columns, tuple(rows))
    return Section("On the recordings", (), (table,), (picture_of(figure, caption, "Spectra before and after"),))


def _candidates(found: RobotDiagnosis) -> Section:
    with house_style():
        figure = robot_evidence_figure(found)
    rows = tuple((one.name, *_number(one), f"{one.evidence:.1f}", refusal(one) or "-") for one in found.candidates)
    columns = ("change", "number", "unit", "evidence", "recordings left out")
    table = Table("Every change alone with its number, error of the fit alone", columns, rows)
    caption = "Gain in score of each single change (twice a log Bayes factor); blue: accepted, or as good."
    tables = (_errors(found), table) if found.physics else (table,)
    return Section("What was weighed", (), tables, (picture_of(figure, caption, "Evidence of the candidates"),))


def _errors(found: RobotDiagnosis) -> Table:
    """Explain the sources of the errors of the numbers told."""
    rows = []
    for one in found.physics:
        number, unit = told_number(one)
        factor = UNITS.get(one.location["unit"], ("", 1.0))[1]
        parts = (f"{factor * part:.2g}" for part in one.error_parts[one.name].values())
        rows.append((one.name, number, unit or "times", *parts))
    columns = ("change", "number", "unit", "fit", "between recordings", "another change free")
    return Table("What was found, and the parts of its error", columns, tuple(rows))


def _number(cause: Candidate) -> tuple[str, str]:
    size = {"m/N": 0.0}.get(cause.location["unit"], 0.5)
    if not standard_error_of(cause) < 3 * abs(number_of(cause)) + size:
        return "not told by the data", ""
    number, unit = told_number(cause)
    return number, unit or "times"


def _postures(found: RobotDiagnosis) -> Section:
    rows = tuple(
        (
            one.name,
            ", ".join(f"{angle:.1f}" for angle in np.degrees(one.q)),
            f"{one.spectrum.frequencies[0]:.3g} to {one.spectrum.frequencies[-1]:.3g}",
            ", ".join(one.responses),
        )
        for one in found.details.robot.recordings
    )
    table = Table("Recordings and their postures", ("recording", "joints (deg)", "band (Hz)", "responses"), rows)
    return Section("What was compared", (), (table,))
