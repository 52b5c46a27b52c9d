"""An FRF drawn into axes: one part of chosen entries over frequency."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from estimation import FRF_ORDERS, Frf, to_receptance
from foundation import InputError

from ..axes import given_or_new, legend_beside
from ..style import line_style

MOST_ENTRIES = 9
"""Entries that are drawn where none is named."""

PARTS: Mapping[str, tuple[Callable[[NDArray[np.complex128]], NDArray[np.float64]], str]] = {
    "magnitude": (np.abs, "Magnitude of {quantity} ({unit})"),
    "phase": (lambda values: np.angle(values, deg=True), "Phase of {quantity} (deg)"),
    "real": (np.real, "Real part of {quantity} ({unit})"),
    "imaginary": (np.imag, "Imaginary part of {quantity} ({unit})"),
}
"""What can be drawn of an FRF, and the label of its axis."""


def draw_frf(
    frf: Frf,
    axes: Axes | None = None,
    *,
    response: str | None = None,
    excitation: str | None = None,
    part: str = "magnitude",
    quantity: str | None = None,
    **line: Any,
) -> Axes:
    """Entries of an FRF over frequency; lines that are not valid are gaps.

    Parameters
    ----------
    frf
        FRF matrix of any quantity.
    axes
        To draw into; None: new ones.
    response, excitation
        Degrees of freedom to draw; None: all, of more than nine entries the first nine.
    part
        ``magnitude`` (logarithmic), ``phase``, ``real`` or ``imaginary``.
    quantity
        ``receptance``, ``mobility`` or ``accelerance`` to draw; None: what the given axes show, by their label, else
        the FRF's own.
    line
        Settings of matplotlib's lines, such as ``color`` or ``label``.

    Raises
    ------
    InputError
        A degree of freedom, a part or a quantity that is not there.
    """
    frf = in_quantity(frf, quantity or _shown_in(axes))
    if part not in PARTS:
        raise InputError(f"unknown part {part!r} of an FRF; use one of {', '.join(PARTS)}")
    entries = chosen_entries(frf, response, excitation)
    taken, name = PARTS[part]
    with given_or_new(axes) as shown:
        for number, (p, q) in enumerate(entries[:MOST_ENTRIES]):
            values = np.where(frf.valid, taken(frf.values[:, p, q]), np.nan)
            label = line.get("label", f"{frf.responses[p]} / {frf.excitations[q]}")
            if "label" in line and number:
                label = "_nolegend_"  # one name for all entries stands in the legend once
            shown.plot(frf.frequencies, values, **{**line_style(number), **line, "label": label})
        if part == "magnitude":
            shown.set_yscale("log")
        shown.set_xlabel("Frequency (Hz)")
        shown.set_ylabel(name.format(quantity=frf.quantity, unit=frf.unit.replace("^2", "²")))
        if axes is None:
            shown.set_xlim(*_band(frf))
        few = None if len(entries) <= MOST_ENTRIES else f"{MOST_ENTRIES} of {len(entries)} entries"
        legend_beside(shown, few)
    return shown


def _shown_in(axes: Axes | None) -> str | None:
    """The quantity that the label of axes with something in them names."""
    if axes is None or not axes.has_data():
        return None
    return next((name for name in FRF_ORDERS if re.search(rf"\b{name}\b", axes.get_ylabel())), None)


def in_quantity(frf: Frf, quantity: str | None) -> Frf:
    """An FRF of motion over force as receptance, mobility or accelerance: ``s^n`` times the receptance.

    None, and a ``transfer``, which has no other form, leave it as it is.

    Raises
    ------
    InputError
        No such quantity.
    """
    if quantity is None or quantity == frf.quantity or frf.quantity not in FRF_ORDERS:
        return frf
    if quantity not in FRF_ORDERS:
        raise InputError(f"unknown quantity {quantity!r} of an FRF; use one of {', '.join(FRF_ORDERS)}")
    receptance, order = to_receptance(frf), FRF_ORDERS[quantity]
    unit = receptance.unit.replace("m/", f"m/{('', 's/', 's^2/')[order]}", 1)
    factor = (receptance.laplace**order)[:, None, None]
    return replace(receptance, values=receptance.values * factor, quantity=quantity, unit=unit, covariance=None)


def chosen_entries(frf: Frf, response: str | None, excitation: str | None) -> list[tuple[int, int]]:
    """Row and column of each entry that is asked for.

    Raises
    ------
    InputError
        A degree of freedom that the FRF does not have.
    """
    rows = _places("response", frf.responses, response)
    columns = _places("excitation", frf.excitations, excitation)
    return [(p, q) for p in rows for q in columns]


def _places(kind: str, there: Sequence[str], asked: str | None) -> list[int]:
    if asked is None:
        return list(range(len(there)))
    if asked not in there:
        raise InputError(f"no {kind} {asked}; there are {', '.join(there)}")
    return [there.index(asked)]


def _band(frf: Frf) -> tuple[float, float]:
    """The band in which the FRF holds, or that of its valid lines, Hz."""
    if frf.band is not None:
        return frf.band
    lines = frf.frequencies[frf.valid] if frf.valid.any() else frf.frequencies
    return float(lines[0]), float(lines[-1])
