"""The section on FRFs: every one that was measured, with the model that belongs to it."""

import numpy as np

from estimation import Frf
from millfrf.core import InputError
from millfrf.figures import FrfCurves, frf_figures, synthesis_figure, zoomed_matrix, zoomed_sums
from modal_fit import ModalModel, Synthesis, synthesis

from ...collection import Collected, SourceFile
from ...section import Fold, Picture, Section, picture_of
from .choice import Band, axis_of, band_of, knows, shown_frf
from .gallery import gallery_folds
from .misfits import misfit_sentence, misfit_table

FEW = 9
"""FRFs up to which each is drawn large, with its coherence."""


def frf_section(collected: Collected, band: Band | None, reference: ModalModel | None) -> Section:
    """Each FRF with the model that belongs to it, ranked by misfit."""
    whole = Section("Frequency response functions")
    for file, frf in collected.frfs:
        found = collected.model_of(file, frf)
        fit_band = None if found is None else band_of(found[0])
        compared = None if found is None else _compared(frf, found[1], fit_band)
        if compared is not None and found is not None:
            sentence = misfit_sentence(file.path.name, found[0].path.name, compared)
            table = misfit_table(f"{file.path.name} against {found[0].path.name}", frf, compared)
            whole = whole.with_more(sentences=(sentence,), tables=(table,))
        if len(frf.responses) * len(frf.excitations) <= FEW:
            whole = whole.with_more(pictures=_large(file, frf, found, (band, fit_band), reference))
            continue
        axis = band or axis_of(frf, fit_band)
        if compared is not None:
            whole = whole.with_more(pictures=(_sum(file, frf, compared),))
        known = None if reference is None else _compared(frf, reference, axis)
        whole = whole.with_more(folds=_folds(file, frf, axis, compared, known))
    return whole


def _compared(frf: Frf, model: ModalModel, band: Band | None) -> Synthesis | None:
    """Synthesis beside measurement; None where the model is of another kind, has none of the points or no line."""
    try:
        made = synthesis(frf, model, band)
    except InputError:
        return None
    return made if np.isfinite(made.misfit).any() else None


def _folds(
    file: SourceFile, frf: Frf, axis: Band, compared: Synthesis | None, known: Synthesis | None
) -> tuple[Fold, ...]:
    pages = gallery_folds(frf, axis, compared, known)
    if compared is None:
        return pages
    table = misfit_table(f"{file.path.name}: every FRF", frf, compared, most=None)
    return (*pages, Fold(f"Table of all {len(compared.ranked())} FRFs, the worst first", tables=(table,)))


def _sum(file: SourceFile, frf: Frf, compared: Synthesis) -> Picture:
    caption = (
        f"{file.path.name}: sum of the magnitudes of all FRFs, measured and synthesised from the model, and of what "
        "the model leaves. Peaks of the last one are modes that are missing, or that move from point to point."
    )
    words = f"Sum of measured and synthesised FRFs of {file.path.name}, and their difference"
    zoomed = zoomed_sums(compared, frf.unit)
    return picture_of(synthesis_figure(compared, frf.unit), caption, words, zoomed=zoomed)


def _large(
    file: SourceFile,
    frf: Frf,
    found: tuple[SourceFile, ModalModel] | None,
    bands: tuple[Band | None, Band | None],
    reference: ModalModel | None,
) -> tuple[Picture, ...]:
    """One figure for all entries."""
    model, (band, fit_band) = None if found is None else found[1], bands
    shown = shown_frf(frf, model)
    known = reference if reference is not None and knows(reference, shown) else None
    curves = FrfCurves(shown, band or axis_of(shown, fit_band), model, known, fit_band)
    coherence = "coherence" if frf.multiple_coherence is None else "multiple coherence"
    caption = _frf_caption(file, found, known, coherence, spread=shown.entry_variance() is not None)
    words = f"FRF magnitude, phase and {coherence} of {file.path.name}"
    first, *others = frf_figures(curves)
    zoomed = picture_of(first, caption, words, zoomed=zoomed_matrix(curves))  # every entry, whatever the page
    return (zoomed, *(picture_of(figure, caption, words) for figure in others))


def _frf_caption(
    file: SourceFile,
    model: tuple[SourceFile, ModalModel] | None,
    reference: ModalModel | None,
    coherence: str,
    *,
    spread: bool,
) -> str:
    text = f"{file.path.name}: magnitude and phase, and {coherence} of each response with the excitations."
    if model is not None:
        fitted = model[0].made_from(file) and model[0].provenance.get("step") == "fit"
        text += f" Dashed: model {model[0].path.name}" + (", fitted to these lines." if fitted else ".")
    if reference is not None:
        text += " Dotted: reference."
    return text + (" Grey: twice the standard deviation of H1." if spread else "")
