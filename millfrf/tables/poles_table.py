"""Tables of a file of picked poles or of candidates."""

import os
from pathlib import Path

import numpy as np

from modal_fit import read_picked_poles, read_pole_groups

from .result_tables import Table


def poles_in_words(path: str | os.PathLike[str]) -> tuple[str, tuple[Table, ...]]:
    """A line and a table of the poles, and of the groups that are offered where the file holds some."""
    poles, groups = read_picked_poles(path), read_pole_groups(path)
    rows = tuple(
        (str(number), f"{abs(pole) / (2 * np.pi):.3f}", f"{-100 * pole.real / abs(pole):.3f}")
        for number, pole in enumerate(poles, start=1)
    )
    tables = [Table("picked", ("pole", "frequency (Hz)", "damping ratio (%)"), rows)]
    if groups:
        offered = tuple(
            (
                str(one.number),
                f"{one.frequency:.3f}",
                f"{100 * one.damping_ratio:.3f}",
                str(one.n_orders),
                "taken" if one.taken else one.reason,
            )
            for one in groups
        )
        tables.append(Table("offered", ("group", "frequency (Hz)", "damping ratio (%)", "orders", ""), offered))
    words = f", {len(groups)} groups to pick from" if groups else ""
    return f"{len(poles)} picked poles of {Path(path).name}{words}", tuple(tables)
