"""Section on FRFs: every measured FRF, with its model."""

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, to_receptance
from millfrf.core import InputError
from millfrf.core.terminal import Table
from millfrf.figures import (
    ENTRIES_PER_PAGE,
    EntryCurves,
    FrfCurves,
    GalleryEntry,
    coherent_lines,
    frf_figures,
    gallery_page,
    synthesis_figure,
    zoomed_frfs,
    zoomed_matrix,
    zoomed_sums,
)
from modal_fit import ModalModel, Synthesis, synthesis

from ..collection import Collected, SourceFile
from ..section import Fold, Picture, Section, picture_of

Band = tuple[float, float]


def shown_frf(frf: Frf, model: ModalModel | None) -> Frf:
    """Convert an FRF to a receptance if a receptance model is drawn over it."""
    return to_receptance(frf) if model is not None and model.quantity == "receptance" else frf


def knows(model: ModalModel, frf: Frf) -> bool:
    """Return whether a model has the unit of an FRF and at least one of its responses."""
    return model.unit == frf.unit and bool(set(model.responses) & set(frf.responses))


def band_of(file: SourceFile) -> Band | None:
    """Return the band of the fit of a model, Hz; None if its file does not state it."""
    stored = file.provenance.get("band_hz")
    return None if not stored else (float(stored[0]), float(stored[1]))


def axis_of(frf: Frf, fit_band: Band | None) -> Band:
    """Return the frequency axis of the figures, Hz: the widened band of the fit, else the band of coherent lines.

    The band is widened by a fifth of its width on both sides, and not below half its lower end: far below the band a
    receptance from accelerations is only noise divided by the square of the angular frequency.
    """
    valid = frf.frequencies[coherent_lines(frf) & (frf.frequencies > 0)]
    first, last = (float(valid[0]), float(valid[-1])) if len(valid) else (0.0, float(frf.frequencies[-1]))
    if fit_band is None:
        return first, last
    room = 0.2 * (fit_band[1] - fit_band[0])
    return max(first, fit_band[0] - room, fit_band[0] / 2), min(last, fit_band[1] + room)


ZOOMED = 96  # most interactive entries (largest misfit first); all entries of a large matrix need tens of megabytes


def gallery_folds(
    frf: Frf, axis: Band, compared: Synthesis | None, reference: Synthesis | None = None
) -> tuple[Fold, ...]:
    """Draw the FRFs on folded pages of 24; the first page is open.

    Parameters
    ----------
    frf
        FRF, drawn in its own quantity.
    axis
        Frequency axis, Hz.
    compared
        Comparison with the fitted model; its entries come first, in falling order of misfit.
    reference
        Comparison with known dynamics.
    """
    shown = (frf.frequencies >= axis[0]) & (frf.frequencies <= axis[1]) & (frf.frequencies > 0)
    f = frf.frequencies[shown]
    measured = np.where(frf.valid[shown][:, None, None], frf.values[shown], np.nan)
    fitted, known = (_on_axis(model, f) for model in (compared, reference))
    order = _order(frf, compared)
    folds = []
    for first in range(0, len(order), ENTRIES_PER_PAGE):
        chosen = order[first : first + ENTRIES_PER_PAGE]
        entries = [
            GalleryEntry(
                f"{frf.responses[p]} / {frf.excitations[q]}",
                _misfit(compared, p, q),
                measured[:, p, q],
                None if fitted is None else fitted[:, p, q],
                None if known is None else known[:, p, q],
            )
            for p, q in chosen
        ]
        title = f"FRFs {first + 1} to {first + len(chosen)} of {len(order)}" + _span(compared, chosen)
        zoomed = None
        if first < ZOOMED:
            zoomed = zoomed_frfs([_curves(entry) for entry in entries], f, f, f"|H| ({frf.unit})")
        picture = picture_of(gallery_page(entries, f), _caption(frf, compared, reference), title, zoomed=zoomed)
        folds.append(Fold(title, pictures=(picture,), opened=first == 0))
    return tuple(folds)


def _curves(entry: GalleryEntry) -> EntryCurves:
    """Convert a panel to interactive curves."""
    label = f"{entry.title}, misfit {entry.misfit}" if entry.misfit else entry.title
    return EntryCurves(label, entry.measured, entry.fitted)


def _order(frf: Frf, compared: Synthesis | None) -> list[tuple[int, int]]:
    every = [(p, q) for q in range(len(frf.excitations)) for p in range(len(frf.responses))]
    ranked = [] if compared is None else list(compared.ranked())
    first = set(ranked)
    return ranked + [entry for entry in every if entry not in first]


def _on_axis(compared: Synthesis | None, f: NDArray[np.float64]) -> NDArray[np.complex128] | None:
    """Return the synthesised values at the frequencies ``f``; NaN at lines that were not compared."""
    if compared is None:
        return None
    values = np.full((len(f), *compared.synthesised.shape[1:]), np.nan + 0j)
    common = np.isin(f, compared.frequencies)
    values[common] = compared.synthesised[np.isin(compared.frequencies, f)]
    return values


def _misfit(compared: Synthesis | None, p: int, q: int) -> str:
    if compared is None or not np.isfinite(compared.misfit[p, q]):
        return ""
    return f"{100 * compared.misfit[p, q]:.2g} %"


def _span(compared: Synthesis | None, chosen: list[tuple[int, int]]) -> str:
    if compared is None:
        return ""
    known = [100 * compared.misfit[p, q] for p, q in chosen if np.isfinite(compared.misfit[p, q])]
    return f", misfit {max(known):.2g} to {min(known):.2g} %" if known else ""


def _caption(frf: Frf, compared: Synthesis | None, reference: Synthesis | None) -> str:
    text = f"Magnitude ({frf.unit}, each on its own scale) and phase (-180° to 180°): measured"
    text += (
        "" if compared is None else ", dashed: synthesised from the model, with the misfit in % of the root mean square"
    )
    return text + ("." if reference is None else "; dotted: reference.")


SHOWN = 12  # rows of the table that is not folded
POOR = 0.3  # misfit above which an FRF is poorly fitted


def misfit_sentence(name: str, model: str, compared: Synthesis) -> str:
    """Describe the smallest, median and largest misfit, and the number of poorly fitted FRFs."""
    known = 100 * compared.misfit[np.isfinite(compared.misfit)]
    poor = int((known > 100 * POOR).sum())
    text = (
        f"{name} against {model}, {compared.frequencies[0]:.4g} to {compared.frequencies[-1]:.4g} Hz: misfit of "
        f"{known.size} FRFs between {known.min():.2g} and {known.max():.2g} % of their root mean square, median "
        f"{np.median(known):.2g} %"
    )
    return text + (f"; {poor} above {100 * POOR:.0f} %." if poor else ".")


def misfit_table(title: str, frf: Frf, compared: Synthesis, most: int | None = SHOWN) -> Table:
    """List FRFs by falling misfit, with correlation and, if known, median coherence."""
    ranked = compared.ranked()
    coherence = _median_coherence(frf, compared)
    rows = []
    for place, (p, q) in enumerate(ranked[:most], start=1):
        row = (
            str(place),
            f"{frf.responses[p]} / {frf.excitations[q]}",
            f"{100 * compared.misfit[p, q]:.3g}",
            f"{compared.correlation[p, q]:.3f}",
        )
        known = coherence is not None and np.isfinite(coherence[p, q])
        rows.append(row if coherence is None else (*row, f"{coherence[p, q]:.3f}" if known else "-"))
    note = f", the worst {most} of {len(ranked)}" if most is not None and len(ranked) > most else ""
    columns = ("", "response / excitation", "misfit (%)", "correlation (FRAC)")
    return Table(f"{title}{note}", columns if coherence is None else (*columns, "median coherence"), tuple(rows))


def _median_coherence(frf: Frf, compared: Synthesis) -> NDArray[np.float64] | None:
    """Return the median coherence of each FRF entry in the compared band; None if it is not known."""
    if frf.coherence is None:
        return None
    in_band = np.isin(frf.frequencies, compared.frequencies)
    return np.asarray(np.median(frf.coherence[in_band], axis=0))


FEW = 9  # number of FRFs up to which each is drawn large, with its coherence


def frf_section(collected: Collected, band: Band | None, reference: ModalModel | None) -> Section:
    """Show each FRF with its model, ranked by misfit."""
    section = Section("Frequency response functions")
    for file, frf in collected.frfs:
        pair = collected.model_of(file, frf)
        fit_band = None if pair is None else band_of(pair[0])
        compared = None if pair is None else _compared(frf, pair[1], fit_band)
        if compared is not None and pair is not None:
            sentence = misfit_sentence(file.path.name, pair[0].path.name, compared)
            table = misfit_table(f"{file.path.name} against {pair[0].path.name}", frf, compared)
            section = section.with_more(sentences=(sentence,), tables=(table,))
        if len(frf.responses) * len(frf.excitations) <= FEW:
            section = section.with_more(pictures=_large(file, frf, pair, (band, fit_band), reference))
            continue
        axis = band or axis_of(frf, fit_band)
        if compared is not None:
            section = section.with_more(pictures=(_sum(file, frf, compared),))
        known = None if reference is None else _compared(frf, reference, axis)
        section = section.with_more(folds=_folds(file, frf, axis, compared, known))
    return section


def _compared(frf: Frf, model: ModalModel, band: Band | None) -> Synthesis | None:
    """Compare synthesised with measured FRFs; None if the model and the FRF have no unit, point or line in common."""
    try:
        compared = synthesis(frf, model, band)
    except InputError:
        return None
    return compared if np.isfinite(compared.misfit).any() else None


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
        f"{file.path.name}: sum of the magnitudes of all FRFs, measured and synthesised from the model, and of their "
        "difference. Its peaks are missing modes, or modes whose frequency differs from point to point."
    )
    words = f"Sum of measured and synthesised FRFs of {file.path.name}, and their difference"
    zoomed = zoomed_sums(compared, frf.unit)
    return picture_of(synthesis_figure(compared, frf.unit), caption, words, zoomed=zoomed)


def _large(
    file: SourceFile,
    frf: Frf,
    pair: tuple[SourceFile, ModalModel] | None,
    bands: tuple[Band | None, Band | None],
    reference: ModalModel | None,
) -> tuple[Picture, ...]:
    """Draw all entries in one figure."""
    model, (band, fit_band) = None if pair is None else pair[1], bands
    shown = shown_frf(frf, model)
    known = reference if reference is not None and knows(reference, shown) else None
    curves = FrfCurves(shown, band or axis_of(shown, fit_band), model, known, fit_band)
    coherence = "coherence" if frf.multiple_coherence is None else "multiple coherence"
    caption = _frf_caption(file, pair, known, coherence, spread=shown.entry_variance() is not None)
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
