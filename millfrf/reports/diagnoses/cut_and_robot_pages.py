"""Report pages of the diagnoses of cuts and robots."""

import os

import numpy as np

from millfrf.core import with_error
from millfrf.core.terminal import Table
from millfrf.figures import cut_orders_figure, cut_turn_figure, house_style, robot_evidence_figure, robot_spectra_figure
from millfrf.mismatch import (
    COEFFICIENT_NAMES,
    ROBOT,
    AcceptedCause,
    Candidate,
    CutDiagnosis,
    RobotDiagnosis,
    number_of,
    standard_error_of,
)

from ..results_page import FigureFiles, ResultsPage, write_results_page
from ..section import Section, picture_of
from .answers import made_when


def write_cut_report(
    path: str | os.PathLike[str],
    diagnosis: CutDiagnosis,
    cut_name: str,
    summary: list[str],
    figures: FigureFiles | None = None,
) -> None:
    """Write one self-contained HTML page that needs no other file and no network.

    Parameters
    ----------
    path
        File of the page.
    found
        Diagnosis of the cut.
    cut_name
        Name of the cut, for the title.
    summary
        Verdict, a sentence on it, and a line for each finding.
    figures
        Folder and format in which each figure is written as a file too; None: no files.
    """
    picture, turn = _around_the_turn(diagnosis).without_first_picture()
    names = ", ".join(spectra.recording.name for spectra in diagnosis.details.cut.spectra)
    page = ResultsPage(
        "Diagnosis of computed against measured cutting forces",
        f"{cut_name} against {names}",
        made_when(),
        (f"{summary[0].removeprefix('verdict: ').capitalize()}: {summary[1]}.",),
        tuple(_warnings_of_cut(diagnosis)),
        (("What was found", tuple(summary[2:])),),
        picture=picture,
    )
    sections = [
        turn,
        _by_order(diagnosis),
        _coefficients(diagnosis),
        _candidates_of_cut(diagnosis),
    ]
    write_results_page(path, page, sections, figures)


def _warnings_of_cut(diagnosis: CutDiagnosis) -> list[str]:
    cut, proof = diagnosis.details.cut, diagnosis.details.settings.proof
    warnings = [
        f"Coefficients are assumed to have errors of {100 * cut.belief.error:g} %, each spectral line of a "
        f"correct computed force of {100 * cut.force_error:g} %; smaller deviations are not reported.",
        f"A cause is reported if it lowers the error of the force on held-out blocks with p < {proof.significance:g}. "
        "Its ± is one standard error: the fit's own, the spread between halves of the blocks and between bands of "
        "frequency, and the largest shift if another cause is fitted as well.",
    ]
    warnings += diagnosis.doubts
    if any(candidate.stage.startswith("not weighed") for candidate in diagnosis.candidates):
        warnings.append("Not every cause could be compared; see the table of candidates.")
    return warnings


def _around_the_turn(diagnosis: CutDiagnosis) -> Section:
    with house_style():
        figure = cut_turn_figure(diagnosis)
    name = diagnosis.details.cut.spectra[0].recording.name
    caption = (
        f"Force on the tool around the turn of the spindle in {name}, mean of all turns, without its constant part, in "
        "the band that is compared (its upper end makes the ripple). Below: measured less computed."
    )
    return Section("Around the turn", (), (), (picture_of(figure, caption, "Measured and computed force"),))


def _by_order(diagnosis: CutDiagnosis) -> Section:
    with house_style():
        figure = cut_orders_figure(diagnosis)
    caption = "Amplitudes of the force and of its residual; equal teeth give multiples of their number."
    better = diagnosis.improvement
    columns: tuple[str, ...] = ("as computed", "coefficients refitted", "noise")
    numbers: tuple[float, ...] = (better.before, better.refitted, better.noise_floor)
    if diagnosis.details.final.freed:
        columns, numbers = (*columns[:2], "with causes", "noise"), (*numbers[:2], better.after, better.noise_floor)
    row = tuple(f"{100 * number:.3g}" for number in numbers)
    table = Table("Error on blocks of time that were not fitted (% of the force)", columns, (row,))
    return Section("By spindle order", (), (table,), (picture_of(figure, caption, "Error by spindle order"),))


def _coefficients(diagnosis: CutDiagnosis) -> Section:
    belief, fitted = diagnosis.details.cut.belief, diagnosis.details.final
    stated, _ = belief.named_numbers(np.zeros(6), np.zeros(6))
    values, errors = belief.named_numbers(fitted.hypothesis.deviations, np.sqrt(np.diag(fitted.covariance)[:6]))
    rows = tuple(
        (name, f"{stated[name]:.4g}", f"{values[name]:.4g} ± {errors[name]:.2g}", f"{deviation:+.2f}")
        for name, deviation in zip(COEFFICIENT_NAMES, fitted.hypothesis.deviations, strict=True)
    )
    columns = ("coefficient", "stated", "refitted", "deviation (laboratory uncertainties)")
    return Section("Coefficients", (), (Table("Force coefficients, refitted with the causes", columns, rows),))


def _candidates_of_cut(diagnosis: CutDiagnosis) -> Section:
    rows = tuple((entry.name, entry.stage, f"{entry.evidence:.1f}") for entry in diagnosis.candidates)
    table = Table(
        "Evidence of each cause, in addition to those accepted before it", ("cause", "stage", "evidence"), rows
    )
    return Section("Candidates", (), (table,))


def write_robot_report(
    path: str | os.PathLike[str],
    diagnosis: RobotDiagnosis,
    robot_name: str,
    summary: list[str],
    *,
    dated: bool = True,
    figures: FigureFiles | None = None,
) -> None:
    """Write one self-contained HTML page that needs no other file and no network.

    Parameters
    ----------
    path
        File of the page; an existing one is replaced.
    found
        Diagnosis of the robot.
    robot_name
        Name of the robot, for the title.
    summary
        Verdict, a sentence on it, and a line for each cause and held-out recording.
    dated
        Whether the page states its date; without a date, equal input gives equal bytes.
    figures
        Folder and format in which each figure is written as a file too; None: no files.
    """
    picture, spectra = _spectra(diagnosis).without_first_picture()
    names = ", ".join(entry.name for entry in diagnosis.details.robot.recordings)
    page = ResultsPage(
        "Diagnosis of a robot model against recordings",
        f"{robot_name} against {names}",
        made_when(dated=dated),
        (f"{summary[0].removeprefix('verdict: ').capitalize()}: {summary[1]}.",),
        (*diagnosis.doubts, *_warnings_of_robot(diagnosis)),
        (("What was found", tuple(summary[2:]) or ("Nothing to change.",)),),
        picture=picture,
    )
    write_results_page(path, page, [spectra, _candidates_of_robot(diagnosis), _postures(diagnosis)], figures)


def _warnings_of_robot(diagnosis: RobotDiagnosis) -> list[str]:
    error = diagnosis.details.robot.error
    warnings = [
        f"A correct model is assumed to have errors of {100 * error.frequency:g} % in frequency, "
        f"{100 * error.damping:g} % in damping and {100 * error.shape:g} % of a shape's size in each posture; "
        "smaller deviations are not reported."
    ]
    if len(diagnosis.details.robot.recordings) == 1:
        warnings.append("One posture loads the joints in one way: several postures distinguish causes better.")
    warnings.append(what_is_asked())
    if diagnosis.after.share > ROBOT.verdict.noise_like:
        warnings.append(
            f"The residual is {diagnosis.after.share:.2g} times the errors of a correct model's modes (accepted up to "
            f"{ROBOT.verdict.noise_like:g}): some of the physics is missing."
        )
    return warnings


def _spectra(diagnosis: RobotDiagnosis) -> Section:
    with house_style():
        figure = robot_spectra_figure(diagnosis)
    caption = (
        "Root of response power over force power, all channels of a recording together, as receptance. The modes of "
        "the robot are drawn without the small errors that are assumed for a correct model."
    )
    columns: tuple[str, ...] = ("recording", "as modelled", "modes fitted freely")
    rows: list[tuple[str, ...]] = [
        (entry.name, f"{100 * entry.before:.3g}", f"{100 * entry.floor:.3g}") for entry in diagnosis.held_out
    ]
    if diagnosis.physics:
        columns = (*columns[:2], "with the change", columns[2])
        pairs = zip(rows, diagnosis.held_out, strict=True)
        rows = [(*row[:2], f"{100 * entry.after:.3g}", row[2]) for row, entry in pairs]
    table = Table("Error on held-out recordings (% of the response)", columns, tuple(rows))
    return Section("On the recordings", (), (table,), (picture_of(figure, caption, "Spectra before and after"),))


def _candidates_of_robot(diagnosis: RobotDiagnosis) -> Section:
    with house_style():
        figure = robot_evidence_figure(diagnosis)
    rows = tuple(
        (entry.name, *_number(entry), f"{entry.evidence:.1f}", refusal(entry) or "-") for entry in diagnosis.candidates
    )
    columns = ("change", "number", "unit", "evidence", "recordings left out")
    table = Table("Every change alone with its number, error of the fit alone", columns, rows)
    caption = "Gain in score of each single change (twice a log Bayes factor); blue: accepted, or equivalent."
    tables = (_errors(diagnosis), table) if diagnosis.physics else (table,)
    return Section("Candidates", (), tables, (picture_of(figure, caption, "Evidence of the candidates"),))


def _errors(diagnosis: RobotDiagnosis) -> Table:
    """Make a table of the accepted changes, with the contributions to the standard error of each."""
    rows = []
    for entry in diagnosis.physics:
        number, unit = number_and_unit(entry)
        factor = UNITS.get(entry.location["unit"], ("", 1.0))[1]
        parts = (f"{factor * part:.2g}" for part in entry.error_parts[entry.name].values())
        rows.append((entry.name, number, unit or "times", *parts))
    columns = ("change", "number", "unit", "fit", "between recordings", "another change free")
    return Table("Accepted changes, and the parts of their errors", columns, tuple(rows))


def _number(cause: Candidate) -> tuple[str, str]:
    size = {"m/N": 0.0}.get(cause.location["unit"], 0.5)
    if not standard_error_of(cause) < 3 * abs(number_of(cause)) + size:
        return "not determined by the data", ""
    number, unit = number_and_unit(cause)
    return number, unit or "times"


def _postures(diagnosis: RobotDiagnosis) -> Section:
    rows = tuple(
        (
            entry.name,
            ", ".join(f"{angle:.1f}" for angle in np.degrees(entry.q)),
            f"{entry.spectrum.frequencies[0]:.3g} to {entry.spectrum.frequencies[-1]:.3g}",
            ", ".join(entry.responses),
        )
        for entry in diagnosis.details.robot.recordings
    )
    table = Table("Recordings and their postures", ("recording", "joints (deg)", "band (Hz)", "responses"), rows)
    return Section("Recordings", (), (table,))


UNITS = {"rad": ("deg", 180 / np.pi), "m/N": ("µm/N", 1e6), "m": ("m", 1.0)}  # printed unit, and factor from SI


def what_is_asked() -> str:
    """State the conditions under which a change is reported."""
    return (
        "A change is reported if it lowers the error on recordings left out of the fit with "
        f"p < {ROBOT.proof.significance:g}. Its ± is one standard error: root of the sum of squares of the fit's own, "
        "of the spread between fits that leave one recording out, and of the largest shift if another change is "
        "fitted as well."
    )


def refusal(candidate: Candidate) -> str:
    """Return the reason why a change was rejected in spite of its evidence; an empty text if it was not rejected."""
    return "" if candidate.stage == "fitted" else candidate.stage


def number_and_unit(cause: AcceptedCause | Candidate) -> tuple[str, str]:
    """Format the number of a change with its standard error in printed units; return the text and the unit."""
    unit, factor = UNITS.get(cause.location["unit"], (cause.location["unit"], 1.0))
    signed = cause.location["kind"] in ("posture", "payload")
    text = with_error(factor * number_of(cause), factor * standard_error_of(cause), sign=signed)
    return text, unit
