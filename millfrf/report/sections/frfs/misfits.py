"""How far a model's FRFs are off, in words and as a ranked table."""

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from modal_fit import Synthesis

from ....tables import Table

SHOWN = 12
"""Rows of the table that is not folded."""

POOR = 0.3
"""Misfit from which an FRF counts as hardly fitted."""


def misfit_sentence(name: str, model: str, compared: Synthesis) -> str:
    """Best, middle and worst misfit, and how many are poor."""
    known = 100 * compared.misfit[np.isfinite(compared.misfit)]
    poor = int((known > 100 * POOR).sum())
    text = (
        f"{name} against {model}, {compared.frequencies[0]:.4g} to {compared.frequencies[-1]:.4g} Hz: misfit of "
        f"{known.size} FRFs between {known.min():.2g} and {known.max():.2g} % of their root mean square, in the middle "
        f"{np.median(known):.2g} %"
    )
    return text + (f"; {poor} above {100 * POOR:.0f} %." if poor else ".")


def misfit_table(title: str, frf: Frf, compared: Synthesis, most: int | None = SHOWN) -> Table:
    """FRFs by falling misfit, with correlation and, where it is known, median coherence."""
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
        rows.append(row if coherence is None else (*row, f"{coherence[p, q]:.3f}"))
    note = f", the worst {most} of {len(ranked)}" if most is not None and len(ranked) > most else ""
    columns = ("", "response / excitation", "misfit (%)", "correlation (FRAC)")
    return Table(f"{title}{note}", columns if coherence is None else (*columns, "median coherence"), tuple(rows))


def _median_coherence(frf: Frf, compared: Synthesis) -> NDArray[np.float64] | None:
    """Give the median coherence in the compared band, (n_responses, n_excitations); None where it is not known."""
    if frf.coherence is None:
        return None
    inside = np.isin(frf.frequencies, compared.frequencies)
    return np.asarray(np.median(frf.coherence[inside], axis=0))
