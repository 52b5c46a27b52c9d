"""Parts of an FRF matrix: entries by their names, lines by a band."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from millfrf.core import Band, Index, InputError, checked_band
from millfrf.core.argument_types import checked_type

from .measured_blocks import entries_in_words, missing_entries

if TYPE_CHECKING:
    from .frf_matrix import Frf


def chosen_indices(kind: str, labels: Sequence[str], chosen: str | Sequence[str] | None) -> list[int]:
    """Return the places of chosen labels along an axis, in the order in which they are given; None: of all.

    Parameters
    ----------
    kind
        Name of the axis, for messages: ``response`` or ``excitation``.
    labels
        Degrees of freedom along the axis.
    chosen
        One or several of them.

    Raises
    ------
    InputError
        A label that the axis has not.
    """
    chosen = checked_type(kind, chosen, str | Sequence[str] | None)
    if chosen is None:
        return list(range(len(labels)))
    names = [chosen] if isinstance(chosen, str) else list(dict.fromkeys(chosen))
    for name in names:
        if name not in labels:
            raise InputError(f"no {kind} {name}; there are {', '.join(labels)}")
    if not names:
        raise InputError(f"{kind} []: name at least one of {', '.join(labels)}")
    return [labels.index(name) for name in names]


def select(
    frf: "Frf", response: str | Sequence[str] | None, excitation: str | Sequence[str] | None, band: Band | None
) -> "Frf":
    """Return the entries and the lines of an FRF that were chosen; see `Frf.sel`."""
    rows = np.array(chosen_indices("response", frf.responses, response))
    columns = np.array(chosen_indices("excitation", frf.excitations, excitation))
    if frf.measured is not None:
        measured = frf.measured[np.ix_(rows, columns)]
        names = [frf.responses[row] for row in rows], [frf.excitations[column] for column in columns]
        if missing_entries(measured, *names):
            raise InputError(f"{entries_in_words(measured, *names)} was not measured; select entries that were")
    part = entries_of(frf, rows, columns)
    return part if band is None else _lines_of(part, band)


def entries_of(frf: "Frf", rows: Index, columns: Index) -> "Frf":
    """Return the FRF of some rows and columns of a matrix."""
    p, q, covariance = rows[:, None], columns[None, :], frf.covariance
    if covariance is not None:
        response, excitation = covariance.response[:, p, rows], covariance.excitation[:, columns[:, None], q]
        covariance = replace(covariance, response=response, excitation=excitation)
    return replace(
        frf,
        values=frf.values[:, p, q],
        responses=tuple(frf.responses[row] for row in rows),
        excitations=tuple(frf.excitations[column] for column in columns),
        multiple_coherence=None if frf.multiple_coherence is None else frf.multiple_coherence[:, rows],
        covariance=covariance,
        coherence=None if frf.coherence is None else frf.coherence[:, p, q],
        averages=None if frf.averages is None else frf.averages[p, q],
        measured=None if frf.measured is None else frf.measured[p, q],
        common_errors=None if frf.common_errors is None else frf.common_errors[:, :, p, q],
    )


def _lines_of(frf: "Frf", band: Band) -> "Frf":
    """Return the lines of an FRF in a band."""
    chosen = checked_band(checked_type("band", band, tuple[float, float], "Hz", metavar="LO HI"), "sel")
    assert chosen is not None
    low, high = chosen
    lines = (frf.frequencies >= low) & (frf.frequencies <= high)
    if not lines.any():
        have = f"{frf.frequencies[0]:g} to {frf.frequencies[-1]:g} Hz" if len(frf.frequencies) else "no line"
        raise InputError(f"no line lies in {low:g} to {high:g} Hz; the FRF has {have}")
    holds = None if frf.band is None else (max(low, frf.band[0]), min(high, frf.band[1]))
    if holds is not None and frf.band is not None and holds[0] >= holds[1]:
        whole = f"{frf.band[0]:g} to {frf.band[1]:g} Hz"
        raise InputError(f"the FRF does not hold in {low:g} to {high:g} Hz; choose a band in {whole}, where it does")
    covariance, coherence, multiple = frf.covariance, frf.coherence, frf.multiple_coherence
    if covariance is not None:
        covariance = replace(covariance, response=covariance.response[lines], excitation=covariance.excitation[lines])
    return replace(
        frf,
        frequencies=frf.frequencies[lines],
        values=frf.values[lines],
        valid=frf.valid[lines],
        multiple_coherence=None if multiple is None else multiple[lines],
        covariance=covariance,
        band=holds,
        coherence=None if coherence is None else coherence[lines],
        common_errors=None if frf.common_errors is None else frf.common_errors[:, lines],
    )
