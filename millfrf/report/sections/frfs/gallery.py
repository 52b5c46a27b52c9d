"""Every FRF of a large matrix as a small panel, page by page, the worst fitted first."""

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from millfrf.figures import ENTRIES_PER_PAGE, EntryCurves, GalleryEntry, gallery_page, zoomed_frfs
from modal_fit import Synthesis

from ...section import Fold, picture_of
from .choice import Band

ZOOMED = 96
"""Entries that zoom, the worst fitted ones; all of a large matrix would make a page of tens of megabytes."""


def gallery_folds(
    frf: Frf, axis: Band, compared: Synthesis | None, reference: Synthesis | None = None
) -> tuple[Fold, ...]:
    """Pages of 24 FRFs; the first one is open.

    Parameters
    ----------
    frf
        Drawn in the quantity that was measured.
    axis
        Frequency axis, Hz.
    compared
        The fitted model beside it; its entries come in falling order of misfit, others after them.
    reference
        Known dynamics beside it.
    """
    shown = (frf.frequencies >= axis[0]) & (frf.frequencies <= axis[1]) & (frf.frequencies > 0)
    f = frf.frequencies[shown]
    measured = np.where(frf.valid[shown][:, None, None], frf.values[shown], np.nan)
    fitted, known = (_on_axis(one, f) for one in (compared, reference))
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
            zoomed = zoomed_frfs([_curves(one) for one in entries], f, f, f"|H| ({frf.unit})")
        picture = picture_of(gallery_page(entries, f), _caption(frf, compared, reference), title, zoomed=zoomed)
        folds.append(Fold(title, pictures=(picture,), opened=first == 0))
    return tuple(folds)


def _curves(entry: GalleryEntry) -> EntryCurves:
    """A panel as curves to zoom into."""
    label = f"{entry.title}, misfit {entry.misfit}" if entry.misfit else entry.title
    return EntryCurves(label, entry.measured, entry.fitted)


def _order(frf: Frf, compared: Synthesis | None) -> list[tuple[int, int]]:
    every = [(p, q) for q in range(len(frf.excitations)) for p in range(len(frf.responses))]
    ranked = [] if compared is None else list(compared.ranked())
    first = set(ranked)
    return ranked + [entry for entry in every if entry not in first]


def _on_axis(compared: Synthesis | None, f: NDArray[np.float64]) -> NDArray[np.complex128] | None:
    """Synthesised values on the axis, NaN where the comparison has no line."""
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
