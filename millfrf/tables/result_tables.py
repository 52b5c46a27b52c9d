"""Tables of results as plain data, for the terminal and for reports."""

from dataclasses import dataclass

import numpy as np

from modal_fit import ModalModel, frequency_and_damping_errors

from ..terminal import print_table


@dataclass(frozen=True)
class Table:
    """A title, column headings and rows of text.

    Parameters
    ----------
    title
        Title of the table, one line.
    columns
        Headings with units.
    rows
        Rows of text, with as many cells as there are columns.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def with_error(value: float, error: float, *, sign: bool = False) -> str:
    """A value and its error with as many decimals as two digits of the error need.

    Examples
    --------
    >>> with_error(16.98997, 0.000069)
    '16.989970 ± 0.000069'
    >>> with_error(638.374, 0.27), with_error(2.85, float("nan"))
    ('638.37 ± 0.27', '2.850')
    """
    plus = "+" if sign else ""
    if not np.isfinite(error):
        return f"{value:{plus}.3f}"
    decimals = int(np.clip(1 - np.floor(np.log10(error)), 0, 7)) if error > 0 else 3
    return f"{value:{plus}.{decimals}f} ± {error:.{decimals}f}"


def mode_table(model: ModalModel, title: str = "Modes", band: tuple[float, float] | None = None) -> Table:
    """Natural frequency and damping ratio of each mode with twice their standard errors, and the residue's size."""
    errors = frequency_and_damping_errors(model)
    rows = []
    for r, (frequency, zeta) in enumerate(zip(model.natural_frequencies, model.damping_ratios, strict=True)):
        if band is not None and not band[0] <= frequency <= band[1]:
            continue
        spread = (np.nan, np.nan) if errors is None else (2 * errors[0][r], 200 * errors[1][r])
        size = np.abs(model.right[r]).max() * np.abs(model.left[r]).max()
        peak = size / abs(model.poles[r].real) if model.poles[r].real else np.inf
        rows.append(
            (
                str(r + 1),
                with_error(float(frequency), spread[0]),
                with_error(float(100 * zeta), spread[1]),
                f"{peak:.3g} {model.unit}",
            )
        )
    columns = ("mode", "frequency (Hz)", "damping ratio (%)", "peak in largest entry")
    note = " (± 2 standard errors)" if errors is not None else ""
    return Table(title + note, columns, tuple(rows))


def error_table(model: ModalModel, title: str = "Standard errors by source") -> Table | None:
    """Standard errors of each mode by where they come from; None where the model does not say."""
    if model.errors is None:
        return None
    parts = (model.errors.noise, model.errors.points, model.errors.band, model.errors.terms, model.errors.total)
    rows = []
    for r, frequency in enumerate(model.natural_frequencies):
        cells = [f"{part[r, 0]:.2g} / {100 * part[r, 1]:.2g}" if np.isfinite(part[r, 0]) else "-" for part in parts]
        rows.append((str(r + 1), f"{frequency:.3f}", *cells))
    columns = ("mode", "frequency (Hz)", "noise", "a sensor left out", "band edges", "out-of-band terms", "total")
    return Table(f"{title} (Hz / % damping; -: cannot be told from this fit)", columns, tuple(rows))


def show(table: Table) -> None:
    """Print a table to the terminal."""
    print_table(table.title, table.columns, table.rows)
