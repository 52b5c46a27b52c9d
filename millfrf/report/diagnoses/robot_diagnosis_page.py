"""The page that a robot's diagnosis leaves behind."""

import os
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from figures import as_data_uri, house_style, robot_evidence_figure, robot_spectra_figure
from foundation import writing_whole_file
from mismatch import ROBOT, Candidate, RobotDiagnosis, number_of, standard_error_of

from ...provenance import versions
from ...robot import UNITS, refusal, told_number, what_is_asked
from ...tables import Table
from ..section import Picture, Section


def write_robot_report(
    path: str | os.PathLike[str],
    found: RobotDiagnosis,
    robot_name: str,
    summary: list[str],
    *,
    dated: bool = True,
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
    """
    environment = Environment(loader=PackageLoader("millfrf", "report"), autoescape=True, undefined=StrictUndefined)
    names = ", ".join(one.name for one in found.details.robot.recordings)
    text = environment.get_template("diagnosis.html.j2").render(
        title=f"{robot_name} against {names}",
        written_at=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC") if dated else "",
        style=files("millfrf.report").joinpath("report.css").read_text(encoding="utf-8"),
        verdict=f"{summary[0].removeprefix('verdict: ').capitalize()}: {summary[1]}.",
        answers=[("What was found", summary[2:] or ["Nothing to change."])],
        warnings=[*found.doubts, *_warnings(found)],
        sections=[_spectra(found), _candidates(found), _postures(found)],
        versions=versions(),
    )
    with writing_whole_file(path) as temporary:
        Path(temporary).write_text(text, encoding="utf-8")


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
        picture = as_data_uri(robot_spectra_figure(found))
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
    return Section("On the recordings", (), (table,), (Picture(picture, caption, "Spectra before and after"),))


def _candidates(found: RobotDiagnosis) -> Section:
    with house_style():
        picture = as_data_uri(robot_evidence_figure(found))
    rows = tuple((one.name, *_number(one), f"{one.evidence:.1f}", refusal(one) or "-") for one in found.candidates)
    columns = ("change", "number", "unit", "evidence", "recordings left out")
    table = Table("Every change alone with its number, error of the fit alone", columns, rows)
    caption = "Gain in score of each single change (twice a log Bayes factor); blue: accepted, or as good."
    tables = (_errors(found), table) if found.physics else (table,)
    return Section("What was weighed", (), tables, (Picture(picture, caption, "Evidence of the candidates"),))


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
