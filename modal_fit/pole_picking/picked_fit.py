"""`fit_picked_poles`: the modal model of poles that somebody picked."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from foundation import Band, InputError

from ..frf_fit import default_order
from ..frf_fit.picked import fit_picked
from ..polyreference import (
    ModalFit,
    fit_warnings,
    flat_lines,
    relative_error,
    status_warnings,
    usable_lines,
    without_delay,
)
from ..transfer_delay import transfer_delay

Complex = NDArray[np.complex128]
_LARGEST_DAMPING = 0.5
_SAME = 0.05  # distance over damping below which two picked poles are one
PICKED, PICKED_AND_REFINED = "picked poles, kept", "picked poles, refined"
_FAR = 2.0  # half-power bands


def fit_picked_poles(
    frf: Frf, band: Band, poles: Complex, *, refine: bool = False, max_order: int | None = None
) -> ModalFit:
    """Fit vectors and residuals of exactly these poles to the valid lines of an FRF matrix inside ``band`` (Hz).

    Parameters
    ----------
    frf
        FRF to fit: receptance, mobility, accelerance or a transfer.
    band : Hz
        Lowest and highest frequency of the fit.
    poles : (n_modes,), rad/s
        Poles to keep, with positive imaginary part.
    refine
        Whether poles and vectors are refined from there. The count of modes stays; kept poles have no error bars.
    max_order
        Highest order of the stabilisation chart; None: from the number of lines and references.

    Returns
    -------
    ModalFit
        Its status is ``picked poles, kept`` or ``picked poles, refined``.

    Raises
    ------
    InputError
        No pole, a pole outside the band, one that is no vibration, two that are the same, or more than the lines carry.
    """
    inside = usable_lines(frf, band, max_order)
    chosen = checked_poles(poles, band, int(inside.sum()))
    references = min(len(frf.responses), len(frf.excitations))
    order = default_order(int(inside.sum()), references) if max_order is None else max_order
    order = min(order, int(inside.sum()) // 2)
    delay = _delay(frf, band, chosen, inside) if frf.quantity == "transfer" else 0.0
    shown = without_delay(frf, delay) if delay else frf
    fit = fit_picked(shown, inside, band, order, chosen, refine=refine)
    model = replace(fit.model, delay=delay)
    error = relative_error(frf, model, inside)
    chi = fit.chi_square if frf.covariance is not None else float("nan")
    moved = (*status_warnings(fit), *_moved(chosen, model.poles)) if refine else ()
    warnings = (*moved, *fit_warnings(frf, inside, model, band, chi, error))
    status = PICKED_AND_REFINED if refine else PICKED
    return ModalFit(model, fit.chart, (), band, chi, error, warnings, status)


def checked_poles(poles: Complex, band: Band, n_lines: int) -> Complex:
    """The poles in order of frequency.

    Raises
    ------
    InputError
        As :func:`fit_picked_poles`; the message names the pole by its place in the list.
    """
    given = np.asarray(poles, dtype=complex)
    if not len(given):
        raise InputError("no pole was picked; name at least one")
    frequencies, damping = np.abs(given) / (2 * np.pi), -given.real / np.abs(given)
    for number, (f, zeta) in enumerate(zip(frequencies, damping, strict=True), start=1):
        if not band[0] <= f <= band[1]:
            raise InputError(
                f"pole {number} at {f:g} Hz lies outside the band {band[0]:g} to {band[1]:g} Hz; widen the band, or "
                "leave the pole out"
            )
        if not 0 < zeta < _LARGEST_DAMPING or given[number - 1].imag <= 0:
            raise InputError(
                f"pole {number} at {f:g} Hz has a damping ratio of {zeta:g}; a vibration has one above 0 and below "
                f"{_LARGEST_DAMPING:g}: give a ratio, not per cent"
            )
    order = np.argsort(frequencies, kind="stable")
    for first, second in pairwise(order):
        near = abs(np.log(given[first] / given[second]))
        if near < _SAME * max(damping[first], damping[second]):
            a, b = sorted((int(first) + 1, int(second) + 1))
            raise InputError(f"poles {a} and {b} are the same, {frequencies[first]:g} Hz; name each mode once")
    if 2 * len(given) > n_lines:
        raise InputError(f"{len(given)} poles are too many for {n_lines} lines; pick fewer, or widen the band")
    return given[order]


def _moved(picked: Complex, found: Complex) -> tuple[str, ...]:
    """Picked poles that no refined pole stands near any more."""
    distance = np.abs(np.log(picked)[:, None] - np.log(found)[None, :]).min(axis=1)
    far = distance > _FAR * 2 * (-picked.real / np.abs(picked))
    return tuple(
        f"the refinement drives the pole picked at {abs(pole) / (2 * np.pi):.4g} Hz away from there; is it a mode?"
        for pole in picked[far]
    )


def _delay(frf: Frf, band: Band, poles: Complex, inside: NDArray[np.bool_]) -> float:
    """Delay of a transfer beside given poles, s."""
    return transfer_delay(poles, flat_lines(frf, inside), band)
