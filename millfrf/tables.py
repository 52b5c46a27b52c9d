"""Tables of results as plain data, for the terminal and for reports."""

import sys
from dataclasses import dataclass

import numpy as np

from modal_fit import ModalModel, frequency_and_damping_errors


@dataclass(frozen=True)
class Table:
    """A title, column headings and rows of text.

    Parameters
    ----------
    title
        One line.
    columns
        Headings with units.
    rows
        As many cells as columns.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def mode_table(model: ModalModel, title: str = "Modes", band: tuple[float, float] | None = None) -> Table:
    """Natural frequency and damping ratio of each mode with twice their standard errors, and the residue's size."""
    errors = frequency_and_damping_errors(model)
    rows = []
    for r, (frequency, zeta) in enumerate(zip(model.natural_frequencies, model.damping_ratios, strict=True)):
        if band is not None and not band[0] <= frequency <= band[1]:
            continue
        spread = ("", "") if errors is None else (f" ± {2 * errors[0][r]:.2g}", f" ± {200 * errors[1][r]:.2g}")
        size = np.abs(model.right[r]).max() * np.abs(model.left[r]).max()
        peak = size / abs(model.poles[r].real)
        rows.append(
            (str(r + 1), f"{frequency:.3f}{spread[0]}", f"{100 * zeta:.3f}{spread[1]}", f"{peak:.3g} {model.unit}")
        )
    columns = ("mode", "frequency (Hz)", "damping ratio (%)", "largest resonant term")
    note = " (± 2 standard errors)" if errors is not None else ""
    return Table(title + note, columns, tuple(rows))


def show(table: Table) -> None:
    """Print a table to the terminal."""
    from rich import box
    from rich.console import Console
    from rich.table import Table as RichTable

    drawn = RichTable(title=table.title, box=box.SIMPLE_HEAD, title_justify="left")
    for number, heading in enumerate(table.columns):
        drawn.add_column(heading, justify="left" if number == 0 else "right")
    for row in table.rows:
        drawn.add_row(*row)
    console = Console(width=None if sys.stdout.isatty() else 120)
    console.print(drawn)
