"""Report page of a structural diagnosis: tables, figures, effect on the lobes."""

import os
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from millfrf.core import InputError
from millfrf.core.terminal import Table
from millfrf.cutting import MillingProcess
from millfrf.figures import (
    behaviour_figure,
    channel_map_figure,
    growth_figure,
    law_figure,
    lobes_figure,
    spectra_figure,
    time_map_figure,
)
from millfrf.mismatch import (
    Candidate,
    Hypothesis,
    StructureDiagnosis,
    equivalent_receptance,
    free_form_laws,
    held_out_spectra,
    in_processes,
    joint_in_words,
    missing_force_law,
    recording_errors,
    rig_of,
    significant_cells,
)
from millfrf.stability import StabilityLobes, zero_order
from modal_fit import ModalModel

from ..collection import collection_paused
from ..results_page import FigureFiles, ResultsPage, write_results_page
from ..section import Picture, Section, picture_of
from .answers import answers, capitalised, made_when, number, offered_in_words, place, verdict_sentence, warnings, words

MOST_CANDIDATES = 15

LEVELS_APART = 1.05  # strongest over weakest level from which growth is drawn


def location_section(diagnosis: StructureDiagnosis) -> Section:
    """Draw maps of the residual."""
    view = diagnosis.details.view
    assert view is not None
    located = diagnosis.located
    level = 100 * located["family_wise_level"]
    mask = significant_cells(located, view.before.ratio.shape)
    maps = _picture(
        channel_map_figure(view, mask),
        "Residual power over noise power by frequency and channel, one column per recording. Dots: "
        f"significantly above noise, at {level:.0f} % for all {located['tests']} cells of all maps together "
        "(F tests, Holm).",
        "Residual by frequency and channel",
    )
    times = _picture(
        time_map_figure(view), "The same over time and frequency, all channels together.", "Residual by time"
    )
    return Section("Location of the residual", (), (), (maps, times))


def growth_section(diagnosis: StructureDiagnosis) -> Section:
    """Draw the growth of the residual with the level."""
    growth = diagnosis.located["growth"]
    reason = _no_growth(growth, len(diagnosis.details.recordings))
    if reason:
        return Section("Growth with the level", (reason,))
    caption = (
        "Residual with the power of the noise taken off, relative to the response averaged over all recordings, "
        "against force; bars are two standard errors. Thin lines: slopes of typical missing effects."
    )
    return Section(
        "Growth with the level", (), (), (_picture(growth_figure(growth), caption, "Growth of the residual"),)
    )


def _no_growth(growth: Mapping[str, Any], recordings: int) -> str:
    """Return the reason why the growth of the residual cannot be drawn; an empty text if it can be drawn."""
    if recordings < 2:
        return "Not drawn: there is a single recording, and how the residual grows needs two levels."
    if "residual" not in growth:
        return f"Not drawn: {growth.get('note', 'nothing was located')}."
    result = [growth[key] for key in ("residual", "effect") if key in growth]
    if not any((entry or 0.0) > 0 for part in result for entry in part["amplitude"]):
        return (
            "Not drawn: in the bands that stand out, the residual of whole recordings is no larger than their noise "
            "at any level."
        )
    levels, unit = result[0].get("drive_rms") or result[0]["force_rms_n"], result[0].get("drive_unit", "N")
    if max(levels) < LEVELS_APART * min(levels):
        return (
            f"Not drawn: all recordings have nearly one level, {min(levels):.3g} to {max(levels):.3g} {unit}; record "
            "at half and at twice of it to see how the residual grows."
        )
    return ""


def missing_force_section(diagnosis: StructureDiagnosis) -> Section:
    """Draw the force that the model lacks, estimated before any law was fitted, with the accepted law."""
    law = missing_force_law(diagnosis)
    if law is None:
        return Section("The missing force", ())
    caption = (
        "Force of one joint that the model lacks, estimated with a free spectrum, in bins over all recordings; bands "
        "are two standard errors. (a) Against deflection, rising and falling; (b) against velocity, less its mean at "
        "that deflection. A spring and a damper are taken off, as errors of the modes have the same effect."
    )
    if law.name:
        caption += f" Lines: {words(law.name)} for the same motion, with the spring and damper that fit best."
        caption += f" It explains {100 * law.explained:.0f} % of the force's power."
    return Section("The missing force", (), (), (_picture(law_figure(law), caption, "The missing force"),))


def law_section(diagnosis: StructureDiagnosis) -> Section:
    """Draw the measured force of the joint."""
    title = "The measured force of the joint"
    laws = free_form_laws(diagnosis)
    sentences = tuple(
        "The force that the linear model lacks along the found direction, from the recordings alone, without an "
        f"assumed law; {words(law.name)} gives {100 * law.explained:.1f} % of its power."
        for law in laws
    )
    caption = (
        "Force that the joint takes beyond the linear model, in bins over all recordings, with bands of two standard "
        "errors; (a) against deflection, rising and falling; (b) against velocity. Lines: the accepted law, computed "
        "for the same motion and averaged in the same way."
    )
    if diagnosis.details.textbook is not None:
        caption += (
            " Dotted: the library's law, with the linear spring and damper that fit best, as they cannot be "
            "distinguished from the structure's own."
        )
    pictures = tuple(_picture(law_figure(law), caption, f"Force of the joint: {words(law.name)}") for law in laws)
    return Section(title, sentences, (), pictures)


def held_out_section(diagnosis: StructureDiagnosis) -> Section:
    """List the errors and draw the spectra on the held-out recording."""
    unit = rig_of(diagnosis.details.final.hypothesis.model).force_unit
    rows = tuple(
        (
            f"{entry.recording}{' (held out)' if entry.held_out else ''}",
            f"{entry.force:.4g}",
            *(f"{100 * error:.3g}" for error in (entry.nominal, entry.refitted, entry.final, entry.noise)),
            f"{entry.final / entry.noise:.3g}",
        )
        for entry in recording_errors(diagnosis)
    )
    columns = (
        "recording",
        f"{'force' if unit == 'N' else 'drive'}, rms ({unit})",
        "nominal (%)",
        "refitted (%)",
        "final (%)",
        "noise (%)",
        "final over noise",
    )
    without = "Error as a share of the response, all channels together"
    if diagnosis.details.tested:
        without += f"; fitted without {diagnosis.improvement.where}"
    table = Table(without, columns, rows)
    spectra = held_out_spectra(diagnosis)
    caption = (
        f"{spectra.recording}: measured and predicted response, and the residual of each model, fitted to the other "
        "recordings only. Grey: noise, including that of the forces after passing the structure."
    )
    picture = _picture(spectra_figure(spectra), caption, "Spectra of the held-out recording")
    return Section("Held-out data", (), (table,), (picture,))


def number_section(diagnosis: StructureDiagnosis) -> Section:
    """List the parameters of each accepted cause with standard errors."""
    rows = []
    for cause in diagnosis.physics:
        for name, value in cause.parameters.items():
            shown = number(value, cause.standard_errors.get(name))
            rows.append((words(cause.name), name, shown, place(diagnosis, cause)))
    columns = ("cause", "parameter", "value ± standard error", "place")
    return Section(
        "Numbers", (), (Table("Parameters of the accepted causes (SI units)", columns, tuple(rows)),) if rows else ()
    )


def candidate_section(diagnosis: StructureDiagnosis) -> Section:
    """List all causes that were compared."""
    accepted = {cause.name: cause.evidence for cause in diagnosis.physics}
    rows, seen = [], set()
    for cause in sorted(diagnosis.candidates, key=lambda cause: (cause.stage != "fitted", -cause.evidence)):
        key = (cause.name, cause.stage, str(cause.location) if "channel" in cause.location else "")
        if key in seen or not np.isfinite(cause.evidence):
            continue
        seen.add(key)
        fitted = cause.name in accepted and cause.stage == "fitted"
        evidence = accepted[cause.name] if fitted else cause.evidence
        mark = "accepted" if fitted else ""
        rows.append((words(cause.name), cause.stage, f"{evidence:.0f}", _short_place(cause), mark))
    sentence = (
        "Screened: gain in misfit to first order, before a fit. Fitted: gain in evidence after all numbers were fitted "
        "again and the joint simulated; the larger, the better. Each cause is shown with its best evidence, an "
        "accepted one with that of its acceptance. Impossible: fitted, but with physically impossible numbers."
    )
    table = Table(
        "Causes that were compared", ("cause", "stage", "evidence", "place", ""), tuple(rows[:MOST_CANDIDATES])
    )
    spared = tuple(f"{capitalised(reason)}." for reason in diagnosis.content.get("not_asked_for", ()))
    return Section("Candidates", (sentence, *spared), (table,) if rows else ())


def _short_place(candidate: Candidate) -> str:
    if "direction" in candidate.location:
        return "(" + ", ".join(f"{value:.2f}" for value in candidate.location["direction"]) + ")"
    if "participation" in candidate.location:
        return joint_in_words(candidate.location)
    return str(candidate.location.get("impossible", candidate.location.get("channel", "")))


def _picture(figure: Figure, caption: str, alternative: str) -> Picture:
    return picture_of(figure, caption, alternative)


def if_possible(make: Callable[[], Section], title: str) -> Section:
    """Make a section; if its figure fails, make a section that states the reason, so that the report is written."""
    try:
        return make()
    except (InputError, np.linalg.LinAlgError) as error:
        return Section(title, (f"Not shown: {error}",))


TITLE = "Modes and level"


def behaviour_section(diagnosis: StructureDiagnosis) -> Section:
    """Describe each mode over the level, and draw frequencies and damping ratios."""
    behaviour = diagnosis.details.behaviour
    if behaviour is None:
        return Section(TITLE, ())
    sentences = [behaviour.sentence]
    sentences += [f"{capitalised(mode.sentence)}." for mode in behaviour.modes]
    sentences += [f"{capitalised(text)}." for text in behaviour.distortion]
    texts = tuple(dict.fromkeys(sentences))
    if not behaviour.modes or len(behaviour.modes[0].levels) < 2:
        return Section(TITLE, texts)
    caption = (
        "Each recording refitted separately by a linear model, without an assumed law. Bars are two standard errors "
        "and include the misfit of the linear model. (a) Natural frequency relative to that at the lowest level; "
        "(b) damping ratio."
    )
    picture = picture_of(behaviour_figure(behaviour), caption, "Natural frequency and damping by level")
    return Section(TITLE, texts, (), (picture,))


# a slot in aluminium, where no cut is given
ASSUMED = MillingProcess(
    teeth=2,
    diameter=0.010,
    edge_angle=np.pi / 2,
    ktc=800e6,
    krc=0.3,
    kac=0.2,
    start_angle=0.0,
    exit_angle=np.pi,
    feed_per_tooth=1e-4,
)

SPEEDS, DEEPEST = 240, 0.2

LINES_PER_WIDTH = 24  # frequencies in a half-power width; a finer grid changes depth limits by less than 0.2 %

FEWEST_LINES, MOST_LINES = 600, 4000


def diagnosis_lobes_section(diagnosis: StructureDiagnosis, process: MillingProcess | None) -> Section:
    """Compare depth limits of the nominal structure with those of the improved structure.

    The improved structure is computed at the weakest and at the strongest level.

    Parameters
    ----------
    diagnosis
        Diagnosis in which something was found.
    process
        Milling process of the cut; None: a slot that is assumed.

    Raises
    ------
    InputError
        A model without the axes that a cut needs.
    """
    title = "Effect on the lobes"
    if diagnosis.verdict != "explained":
        return Section(title)
    unit = diagnosis.details.final.hypothesis.model.unit
    if unit != "m/N":
        said = f"Lobes need a model in m/N; this one is in {unit}."
        return Section(title, (said,) if process is not None else ())
    cut = process or ASSUMED
    curves = _curves(diagnosis, cut)
    names = list(curves)
    lowest = {name: float(np.nanmin(lobes.depth_limits)) for name, lobes in curves.items()}
    rows = tuple((name, f"{1e3 * depth:.3g}", f"{depth / lowest[names[0]]:.2f}") for name, depth in lowest.items())
    shown = "the cut given" if process else "a slot, 2 teeth, K_tc 800 MPa, as no cut was given (--cutting CUT.toml)"
    sentence = (
        f"For {shown}: zero-order limits, which compare structures and do not include period doubling: for a cut use "
        "`millfrf lobes` with the improved model. Joints are replaced by the spring and damper that are closest to "
        "their law at the motion of the recording; faults of the measuring chain are no part of the structure."
    )
    columns = ("structure", "depth stable at every speed (mm)", "over nominal")
    table = Table("Depth that is stable at every speed drawn", columns, rows)
    caption = "(a) Largest stable axial depth over spindle speed; (b) chatter frequency at the limit."
    picture = picture_of(lobes_figure(curves), caption, "Stability lobes before and after")
    return Section(title, (sentence, *offered_in_words(diagnosis)), (table,), (picture,))


def _frequencies(model: ModalModel) -> NDArray[np.float64]:
    """Return frequencies from a third of the lowest natural frequency to three times the highest.

    Their spacing resolves the peak of the mode with the least damping.
    """
    natural, sharpest = model.natural_frequencies, max(float(model.damping_ratios.min()), 1e-6)
    span = np.log(9 * natural.max() / natural.min())
    lines = int(np.clip(LINES_PER_WIDTH * span / (2 * sharpest), FEWEST_LINES, MOST_LINES))
    return np.geomspace(natural.min() / 3, 3 * natural.max(), lines)


def _curves(diagnosis: StructureDiagnosis, cut: MillingProcess) -> dict[str, StabilityLobes]:
    final, lines = diagnosis.details.final.hypothesis, diagnosis.details.recordings
    nominal = final.nominal
    natural = nominal.model.natural_frequencies
    frequencies = _frequencies(nominal.model)
    tooth = 2 * np.pi / cut.teeth
    speeds = np.geomspace(natural.min() * tooth / 2, 3 * natural.max() * tooth, SPEEDS)

    def limits(hypothesis: Hypothesis, place: int) -> StabilityLobes:
        return zero_order(equivalent_receptance(hypothesis, lines[place], frequencies), cut, speeds, DEEPEST)

    curves = {"nominal": limits(nominal, 0)}
    if any(cause.axis is not None for cause in final.causes) and len(lines) > 1:
        for place in (0, len(lines) - 1):
            curves[f"improved, as in {lines[place].recording.name}"] = limits(final, place)
    else:
        curves["improved"] = limits(final, 0)
    if any(not np.isfinite(lobes.depth_limits).any() for lobes in curves.values()):
        raise InputError(f"no limit below {1e3 * DEEPEST:g} mm; the structure is too stiff for the cut")
    return curves


def write_diagnosis_report(
    path: str | os.PathLike[str],
    diagnosis: StructureDiagnosis,
    model_name: str = "",
    process: MillingProcess | None = None,
    *,
    dated: bool = True,
    figures: FigureFiles | None = None,
) -> None:
    """Write one self-contained HTML page that needs no other file and no network.

    Parameters
    ----------
    path
        File of the page.
    diagnosis
        Diagnosis of a structure, with its fits and maps.
    model_name
        Name of the nominal model, for the title.
    process
        Milling process for the lobes; None: one that is assumed.
    dated
        Whether the page states its date; without a date, equal input gives equal bytes.
    figures
        Folder and format in which each figure is written as a file too; None: no files.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    with collection_paused():
        picture, force = if_possible(
            lambda: missing_force_section(diagnosis), "The missing force"
        ).without_first_picture()
        sections = (
            force,
            number_section(diagnosis),
            *_drawn_sections(diagnosis, process),
            candidate_section(diagnosis),
        )
        names = ", ".join(entry.recording.name for entry in diagnosis.details.recordings)
        page = ResultsPage(
            "Diagnosis of a model against recordings",
            f"{model_name or 'Nominal model'} against {names}",
            made_when(dated=dated),
            (verdict_sentence(diagnosis),),
            tuple(warnings(diagnosis)),
            answers(diagnosis),
            picture=picture,
        )
        write_results_page(path, page, sections, figures)


def _drawn_sections(diagnosis: StructureDiagnosis, process: MillingProcess | None) -> list[Section]:
    """Make the sections with figures in parallel processes, the slowest first."""
    makers: list[Callable[[], Section]] = [
        lambda: if_possible(lambda: held_out_section(diagnosis), "Held-out data"),
        partial(location_section, diagnosis),
        lambda: if_possible(lambda: diagnosis_lobes_section(diagnosis, process), "Effect on the lobes"),
        lambda: if_possible(lambda: law_section(diagnosis), "The measured force of the joint"),
        partial(growth_section, diagnosis),
        partial(behaviour_section, diagnosis),
    ]
    held_out, location, lobes, law, growth, behaviour = in_processes(makers)
    return [behaviour, law, held_out, lobes, location, growth]
