"""The section with the table of sets."""

from collections.abc import Sequence

import numpy as np

from ....report import Fold, Section
from ....tables import Table
from ..read_set import LowestLimit, SetResults

MOST_OPEN = 30
"""Sets up to which their table is open from the start."""


def set_section(sets: Sequence[SetResults]) -> Section:
    """Each set with its labels, frequencies, lowest limit and verdict.

    Parameters
    ----------
    sets
        Sets of the campaign, as read.
    """
    columns = ("set", "natural frequencies (Hz)", "recordings", "lowest depth limit (mm)", "verdict", "doubts")
    rows = tuple(
        (
            one.name,
            "none" if one.model is None else ", ".join(f"{f:.2f}" for f in one.model.natural_frequencies),
            str(len(one.measured.recordings)),
            _limit(one.limit),
            one.verdict or "-",
            str(len(one.doubts)),
        )
        for one in sets
    )
    table = Table("Sets and their results; modes.csv has all numbers and doubts", columns, rows)
    return Section("Sets", folds=(Fold(f"All {len(sets)} sets", (table,), opened=len(sets) <= MOST_OPEN),))


def _limit(limit: LowestLimit | None) -> str:
    if limit is None:
        return "-"
    if not np.isfinite(limit.depth):
        return "no limit"
    return f"{1e3 * limit.depth:.3g} at {limit.speed_rpm:.0f} rpm"
