"""Tables and figures of a diagnosis."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from millfrf.core import InputError
from millfrf.figures import channel_map_figure, growth_figure, law_figure, spectra_figure, time_map_figure
from millfrf.mismatch import (
    Candidate,
    StructureDiagnosis,
    free_form_laws,
    held_out_spectra,
    joint_in_words,
    recording_errors,
    rig_of,
    significant_cells,
)

from ...tables import Table
from ..section import Picture, Section, picture_of
from .diagnosis_answers import number, place, words

MOST_CANDIDATES = 15

LEVELS_APART = 1.05
"""Strongest over weakest level from which growth is drawn: nearer ones lie on one spot."""


def location_section(diagnosis: StructureDiagnosis) -> Section:
    """Maps of the residual."""
    view = diagnosis.details.view
    assert view is not None
    located = diagnosis.located
    level = 100 * located["family_wise_level"]
    mask = significant_cells(located, view.before.ratio.shape)
    maps = _picture(
        channel_map_figure(view, mask),
        "Residual power over noise power by frequency and channel, a column a recording. Dots: more than noise "
        f"leaves, at {level:.0f} % for all {located['tests']} cells of all maps together (F tests, Holm).",
        "Residual by frequency and channel",
    )
    times = _picture(
        time_map_figure(view), "The same over time and frequency, all channels together.", "Residual by time"
    )
    return Section("Where the residual sits", (), (), (maps, times))


def growth_section(diagnosis: StructureDiagnosis) -> Section:
    """How the residual grows with the level."""
    growth = diagnosis.located["growth"]
    reason = _no_growth(growth, len(diagnosis.details.recordings))
    if reason:
        return Section("Growth with the level", (reason,))
    caption = (
        "Residual with the power of the noise taken off, relative to the response averaged over all recordings, "
        "against force; bars are two standard errors. Thin lines: slopes of typical omissions."
    )
    return Section(
        "Growth with the level", (), (), (_picture(growth_figure(growth), caption, "Growth of the residual"),)
    )


def _no_growth(growth: Mapping[str, Any], recordings: int) -> str:
    """Why there is no figure of the growth; empty where there is one."""
    if recordings < 2:
        return "Not drawn: there is a single recording, and how the residual grows needs two levels."
    if "residual" not in growth:
        return f"Not drawn: {growth.get('note', 'nothing was located')}."
    found = [growth[key] for key in ("residual", "effect") if key in growth]
    if not any((one or 0.0) > 0 for part in found for one in part["amplitude"]):
        return (
            "Not drawn: in the bands that stand out, the residual of whole recordings is no larger than their noise "
            "at any level."
        )
    levels, unit = found[0].get("drive_rms") or found[0]["force_rms_n"], found[0].get("drive_unit", "N")
    if max(levels) < LEVELS_APART * min(levels):
        return (
            f"Not drawn: all recordings have nearly one level, {min(levels):.3g} to {max(levels):.3g} {unit}; record "
            "at half and at twice of it to see how the residual grows."
        )
    return ""


def law_section(diagnosis: StructureDiagnosis) -> Section:
    """The measured force of the joint."""
    title = "The measured force of the joint"
    laws = free_form_laws(diagnosis)
    sentences = tuple(
        "The force that the linear model lacks along the found direction, from the recordings alone and with no law "
        f"assumed; {words(found.name)} gives {100 * found.explained:.1f} % of its power."
        for found in laws
    )
    caption = (
        "Force that the joint takes beyond the linear model, in bins over all recordings, with bands of two standard "
        "errors; (a) against deflection, rising and falling; (b) against velocity. Lines: the accepted law, driven by "
        "the same motion and averaged alike."
    )
    if diagnosis.details.textbook is not None:
        caption += (
            " Dotted: the library's law, with the linear spring and damper that bring it nearest, as they cannot be "
            "told from the structure's own."
        )
    pictures = tuple(_picture(law_figure(found), caption, f"Force of the joint: {words(found.name)}") for found in laws)
    return Section(title, sentences, (), pictures)


def held_out_section(diagnosis: StructureDiagnosis) -> Section:
    """Errors and spectra on the recording that was held out."""
    unit = rig_of(diagnosis.details.final.hypothesis.model).force_unit
    rows = tuple(
        (
            f"{one.recording}{' (held out)' if one.held_out else ''}",
            f"{one.force:.4g}",
            *(f"{100 * error:.3g}" for error in (one.nominal, one.refitted, one.final, one.noise)),
            f"{one.final / one.noise:.3g}",
        )
        for one in recording_errors(diagnosis)
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
        f"{spectra.recording}: measured and predicted response, and what each model leaves of it, fitted to the other "
        "recordings only. Grey: noise, with what the noise of the forces becomes in the structure."
    )
    picture = _picture(spectra_figure(spectra), caption, "Spectra of the held-out recording")
    return Section("On data that was not fitted", (), (table,), (picture,))


def number_section(diagnosis: StructureDiagnosis) -> Section:
    """Parameters of each accepted cause with standard errors."""
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
    """Make the section on all causes that were weighed."""
    accepted = {cause.name: cause.evidence for cause in diagnosis.physics}
    rows, seen = [], set()
    for one in sorted(diagnosis.candidates, key=lambda one: (one.stage != "fitted", -one.evidence)):
        key = (one.name, one.stage, str(one.location) if "channel" in one.location else "")
        if key in seen or not np.isfinite(one.evidence):
            continue
        seen.add(key)
        told = one.name in accepted and one.stage == "fitted"
        evidence = accepted[one.name] if told else one.evidence
        rows.append((words(one.name), one.stage, f"{evidence:.0f}", _short_place(one), "accepted" if told else ""))
    sentence = (
        "Screened: gain in misfit to first order, before a fit. Fitted: gain in evidence after all numbers were fitted "
        "anew and the joint simulated freely; the larger, the better. Of each cause the best round is shown; of an "
        "accepted one the evidence it was accepted with. Impossible: fitted, but with numbers that nothing real has."
    )
    table = Table(
        "Causes that were weighed", ("cause", "stage", "evidence", "place", ""), tuple(rows[:MOST_CANDIDATES])
    )
    spared = tuple(f"{one[:1].upper()}{one[1:]}." for one in diagnosis.content.get("not_asked_for", ()))
    return Section("What was weighed", (sentence, *spared), (table,) if rows else ())


def _short_place(one: Candidate) -> str:
    if "direction" in one.location:
        return "(" + ", ".join(f"{value:.2f}" for value in one.location["direction"]) + ")"
    if "participation" in one.location:
        return joint_in_words(one.location)
    return str(one.location.get("impossible", one.location.get("channel", "")))


def _picture(figure: Figure, caption: str, alternative: str) -> Picture:
    return picture_of(figure, caption, alternative)


def if_possible(make: Callable[[], Section], title: str) -> Section:
    """A section, or the reason why it is missing: one figure must not cost a report."""
    try:
        return make()
    except (InputError, np.linalg.LinAlgError) as error:
        return Section(title, (f"Not shown: {error}",))
