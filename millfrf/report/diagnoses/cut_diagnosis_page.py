"""The page that a cutting diagnosis leaves behind."""

import os

import numpy as np

from millfrf.figures import cut_orders_figure, cut_turn_figure, house_style
from millfrf.mismatch import COEFFICIENT_NAMES, CutDiagnosis

from ...tables import Table
from ..pages import FigureFiles, ResultsPage, write_results_page
from ..section import Section, picture_of
from .made_when import made_when


def write_cut_report(
    path: str | os.PathLike[str],
    found: CutDiagnosis,
    cut_name: str,
    summary: list[str],
    figures: FigureFiles | None = None,
) -> None:
    """Write one HTML page, figures inside, that needs no other file and no network.

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
    names = ", ".join(spectra.recording.name for spectra in found.details.cut.spectra)
    page = ResultsPage(
        "Diagnosis of computed against measured cutting forces",
        f"{cut_name} against {names}",
        made_when(),
        (f"{summary[0].removeprefix('verdict: ').capitalize()}: {summary[1]}.",),
        tuple(_warnings(found)),
        (("What was found", tuple(summary[2:])),),
    )
    sections = [_around_the_turn(found), _by_order(found), _coefficients(found), _candidates(found)]
    write_results_page(path, page, sections, figures)


def _warnings(found: CutDiagnosis) -> list[str]:
    cut, proof = found.details.cut, found.details.settings.proof
    warnings = [
        f"Coefficients are taken to be off by {100 * cut.belief.error:g} %, each spectral line of a right computed "
        f"force by {100 * cut.force_error:g} %; what is smaller is not named.",
        f"A cause is told if it lowers the error of the force on blocks held out with p < {proof.significance:g}. Its "
        "± is one standard error: the fit's own, the spread between halves of the blocks and between bands of "
        "frequency, and the largest shift with another cause free.",
    ]
    warnings += found.doubts
    if any(one.stage.startswith("not weighed") for one in found.candidates):
        warnings.append("Not every cause could be weighed; see the table of candidates.")
    return warnings


def _around_the_turn(found: CutDiagnosis) -> Section:
    with house_style():
        figure = cut_turn_figure(found)
    name = found.details.cut.spectra[0].recording.name
    caption = (
        f"Force on the tool around the turn of the spindle in {name}, mean of all turns, without its constant part, in "
        "the band that is compared (its upper end makes the ripple). Below: measured less computed."
    )
    return Section("Around the turn", (), (), (picture_of(figure, caption, "Measured and computed force"),))


def _by_order(found: CutDiagnosis) -> Section:
    with house_style():
        figure = cut_orders_figure(found)
    caption = "Amplitude of the force and of what is left of it; teeth of equal chips give multiples of their number."
    better = found.improvement
    columns: tuple[str, ...] = ("as computed", "coefficients refitted", "noise")
    numbers: tuple[float, ...] = (better.before, better.refitted, better.noise_floor)
    if found.details.final.freed:
        columns, numbers = (*columns[:2], "with causes", "noise"), (*numbers[:2], better.after, better.noise_floor)
    row = tuple(f"{100 * number:.3g}" for number in numbers)
    table = Table("Error on blocks of time that were not fitted (% of the force)", columns, (row,))
    return Section("By spindle order", (), (table,), (picture_of(figure, caption, "Error by spindle order"),))


def _coefficients(found: CutDiagnosis) -> Section:
    belief, fitted = found.details.cut.belief, found.details.final
    stated, _ = belief.told(np.zeros(6), np.zeros(6))
    values, errors = belief.told(fitted.hypothesis.deviations, np.sqrt(np.diag(fitted.covariance)[:6]))
    rows = tuple(
        (name, f"{stated[name]:.4g}", f"{values[name]:.4g} ± {errors[name]:.2g}", f"{deviation:+.2f}")
        for name, deviation in zip(COEFFICIENT_NAMES, fitted.hypothesis.deviations, strict=True)
    )
    columns = ("coefficient", "stated", "refitted", "off by (lab's errors)")
    return Section("Coefficients", (), (Table("Force coefficients, refitted with the causes", columns, rows),))


def _candidates(found: CutDiagnosis) -> Section:
    rows = tuple((one.name, one.stage, f"{one.evidence:.1f}") for one in found.candidates)
    table = Table(
        "Evidence of each cause, beside those accepted before it", ("cause", "how far it was taken", "evidence"), rows
    )
    return Section("What was weighed", (), (table,))
