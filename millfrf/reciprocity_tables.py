"""Tables of reciprocity: pairs of an FRF matrix, and left against right vectors of a model."""

import numpy as np

from estimation import Frf, reciprocity_pairs
from millfrf.core import Band
from modal_fit import ModalModel, mode_reciprocity

from .gate import plainly_different, shown_pairs
from .tables import Table

MOST = 12
"""Pairs that are listed."""


def pair_table(frf: Frf, title: str = "Reciprocity", band: Band | None = None) -> Table | None:
    """Each pair ``H_pq``, ``H_qp`` with its disagreement; None where the FRF holds no such pair."""
    pairs = reciprocity_pairs(frf, band)
    if not pairs:
        return None
    rows = []
    for pair in shown_pairs(pairs, MOST):
        angle = np.degrees(np.angle(pair.factor))
        rows.append(
            (
                f"{pair.first} / {pair.second}",
                f"{100 * pair.difference:.3g}",
                f"{100 * pair.noise:.2g}" if np.isfinite(pair.noise) else "",
                f"{pair.correlation:.3f}",
                f"{abs(pair.factor):.3g} at {angle:.0f}°",
                "disagree" if plainly_different(pair) else "",
            )
        )
    low, high = pairs[0].frequencies[0], pairs[0].frequencies[-1]
    note = f", the worst {MOST} of {len(pairs)} pairs" if len(pairs) > MOST else ""
    columns = ("p / q", "difference (% rms)", "of it noise (%)", "correlation", "ratio", "")
    return Table(f"{title}: H_pq against H_qp, {low:.4g} to {high:.4g} Hz{note}", columns, tuple(rows))


def vector_table(model: ModalModel, title: str = "Reciprocity") -> Table | None:
    """Left against right vectors, mode by mode; None where they share fewer than two points."""
    found = mode_reciprocity(model)
    if found is None:
        return None
    rows = tuple(
        (str(mode + 1), f"{frequency:.2f}", f"{found.assurance[mode]:.3f}", f"{100 * found.residual[mode]:.2g}")
        for mode, frequency in enumerate(model.natural_frequencies)
    )
    columns = ("mode", "frequency (Hz)", "MAC left / right", "residues not symmetric (%)")
    return Table(f"{title}: left against right vectors on {len(found.points)} shared points", columns, rows)
