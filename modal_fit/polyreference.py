"""Modal model of an FRF matrix: `fit_polyreference` finds the poles, `fit_picked_poles` takes given ones."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from estimation import FRF_ORDERS, Frf
from millfrf.core import Band, Complex, InputError, MillfrfError, Real

from .frf_fit.candidates import default_order
from .frf_fit.delay import alternating_delay, transfer_delay, without_delay
from .frf_fit.fit import NOT_REFINED, REFINED, MatrixFit, fit_matrix, fit_picked
from .models.joined_blocks import joined_model, placed
from .models.modal_model import ModalModel
from .models.synthesis import NOT_CONVERGED, FittedModel, fit_note
from .settings import SETTINGS
from .stabilisation import (
    PoleGroup,
    StabilisationChart,
    choose_poles,
    joined_chart,
    matrix_fraction_poles,
    stabilisation_chart,
)


@dataclass(frozen=True, eq=False, repr=False)
class ModalFit(FittedModel):
    """A modal model fitted to an FRF matrix, with its stabilisation chart and misfit.

    Parameters
    ----------
    model
        Modal model: modes, residuals and covariance.
    chart
        Stabilisation chart: poles over order.
    dropped
        Groups of poles that are no modes, each with its reason.
    band : Hz
        Lowest and highest frequency of the fit.
    reduced_chi_square
        Misfit over the expected noise: 1 is perfect, much above 1 means that more than noise remains. NaN
        where the FRF has no covariance.
    relative_error : (n_responses, n_excitations)
        Root mean square misfit over root mean square FRF in the band.
    explained : (n_responses,), (n_excitations,)
        Share of the power of each channel's FRFs in the band that the model explains; 1 is perfect.
    warnings
        Warnings about the fit, one sentence each.
    status
        ``refined``; ``poly-reference poles`` where the refinement did not hold on held-out lines; ``picked poles,
        kept`` or ``picked poles, refined``.
    """

    model: ModalModel
    chart: StabilisationChart
    dropped: tuple[PoleGroup, ...]
    band: Band
    reduced_chi_square: float
    relative_error: Real
    explained: tuple[Real, Real]
    warnings: tuple[str, ...]
    status: str = REFINED

    def _note(self) -> str:
        return fit_note(self.band, self.reduced_chi_square)


def fit_polyreference(frf: Frf, band: Band, *, max_order: int | None = None, n_modes: int | None = None) -> ModalFit:
    """Fit a modal model to the valid lines of an FRF matrix inside ``band`` (Hz).

    Poles come from the poly-reference least-squares complex frequency method over all orders. Each pole is tried on the
    lines around it and stays where the data need it. Poles and the vectors of the references are then refined together;
    everything that belongs to one response is eliminated (variable projection), in the measured quantity and weighted
    by its noise. Where the FRF has a covariance, it gives the noise, and as few out-of-band terms are used as it
    allows. Blocks that were measured apart (:meth:`estimation.Frf.blocks`) are fitted on their own and joined to one
    block-diagonal model.

    Parameters
    ----------
    frf
        Receptance, mobility, accelerance or a transfer; the first three give a receptance model.
    band
        Lowest and highest frequency, Hz, 0 < low < high.
    max_order
        Highest order of the denominator; None: from the number of lines and references.
    n_modes
        Keep the first ``n_modes`` that are found, in each measured block; None: as many as there are.

    Raises
    ------
    InputError
        A band without enough valid lines, or an order below 2.
    MillfrfError
        No pole is stable over the orders.
    """
    return _each_block(frf, lambda block: _fit_whole(block, band, max_order, n_modes))


def _fit_whole(frf: Frf, band: Band, max_order: int | None, n_modes: int | None) -> ModalFit:
    chosen = _usable_lines(frf, band, max_order)
    order = _order(frf, chosen, max_order)
    delay = 0.0
    if frf.quantity == "transfer":
        delay = alternating_delay(frf, chosen, band, lambda advanced: _stable_poles(advanced, band, order, n_modes))
    advanced = without_delay(frf, delay) if frf.quantity == "transfer" else frf
    fit = fit_matrix(advanced, chosen, band, order, n_modes)
    return _modal_fit(frf, chosen, band, fit, delay, _refinement_warnings(fit))


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
        Whether poles and vectors are refined from there. The number of modes stays; kept poles have no error bars. An
        FRF whose blocks were measured apart has kept poles only, all of them in each block.
    max_order
        Highest order of the stabilisation chart; None: from the number of lines and references.

    Returns
    -------
    ModalFit
        Its status is ``picked poles, kept`` or ``picked poles, refined``.

    Raises
    ------
    InputError
        No pole, a pole outside the band, an unstable or overdamped pole, two equal poles, or too many for the lines.
    """
    if refine and frf.measured is not None:
        raise InputError(
            f"picked poles cannot be refined without {frf.unmeasured}: which direction each is of is not known; leave "
            "--refine out, or fit the FRF of each direction on its own"
        )
    return _each_block(frf, lambda block: _fit_picked_whole(block, band, poles, refine, max_order))


def _fit_picked_whole(frf: Frf, band: Band, poles: Complex, refine: bool, max_order: int | None) -> ModalFit:
    chosen = _usable_lines(frf, band, max_order)
    picked = _checked_poles(poles, band, int(chosen.sum()))
    delay = transfer_delay(picked, frf, chosen, band) if frf.quantity == "transfer" else 0.0
    advanced = without_delay(frf, delay) if delay else frf
    fit = fit_picked(advanced, chosen, band, _order(frf, chosen, max_order), picked, refine_poles=refine)
    moved = (*_refinement_warnings(fit), *_moved_poles(picked, fit.model.poles)) if refine else ()
    return _modal_fit(frf, chosen, band, fit, delay, moved)


def _each_block(frf: Frf, fit: Callable[[Frf], ModalFit]) -> ModalFit:
    """Fit each measured block of an FRF, as each direction of a tap test, and join the fits; else fit the whole FRF.

    The cross terms between blocks were not measured, so that no shape can join a mode in X and a mode in Y: a fit of
    the whole matrix with zeros in their place takes two modes close together for one.
    """
    blocks = frf.blocks()
    if len(blocks) == 1:
        return fit(frf)
    if frf.quantity == "transfer":
        raise InputError(f"a transfer cannot be fitted without {frf.unmeasured}; fit each block as a file of its own")
    names, fits = [", ".join(block.excitations) for block in blocks], []
    for name, block in zip(names, blocks, strict=True):
        try:
            fits.append(fit(block))
        except MillfrfError as error:
            raise type(error)(f"{name}: {error}") from error
    models = [each.model for each in fits]
    warnings = [f"{name}: {text}" for name, each in zip(names, fits, strict=True) for text in each.warnings]
    sizes = [each.relative_error.size for each in fits]
    return ModalFit(
        joined_model(models, frf),
        joined_chart([each.chart for each in fits]),
        tuple(group for each in fits for group in each.dropped),
        fits[0].band,
        float(np.average([each.reduced_chi_square for each in fits], weights=sizes)),
        placed([each.relative_error for each in fits], models, frf),
        _explained(fits, frf),
        tuple(warnings),
        next((each.status for each in fits if each.status == NOT_REFINED), fits[0].status),
    )


def _explained(fits: Sequence[ModalFit], frf: Frf) -> tuple[Real, Real]:
    """Return the share of each channel's power that the models of the blocks explain, in the order of the FRF."""
    responses = {
        name: share for each in fits for name, share in zip(each.model.responses, each.explained[0], strict=True)
    }
    excitations = {
        name: share for each in fits for name, share in zip(each.model.excitations, each.explained[1], strict=True)
    }
    return np.array([responses[name] for name in frf.responses]), np.array(
        [excitations[name] for name in frf.excitations]
    )


def _order(frf: Frf, chosen: NDArray[np.bool_], max_order: int | None) -> int:
    """Return the highest order of the denominator: ``max_order`` or, where it is None, one that suits the matrix."""
    n_lines, references = int(chosen.sum()), min(len(frf.responses), len(frf.excitations))
    order = default_order(n_lines, references) if max_order is None else max_order
    return min(order, n_lines // 2)


def _stable_poles(frf: Frf, band: Band, order: int, n_modes: int | None) -> Complex:
    """Return the unrefined poles that many orders have, at most ``n_modes``."""
    chart = stabilisation_chart(list(matrix_fraction_poles(frf, band, order)), band)
    groups, _ = choose_poles(chart)
    if not groups:
        raise MillfrfError(
            f"no pole is stable over orders 1 to {order} between {band[0]:g} and {band[1]:g} Hz; "
            "widen the band, raise max_order (--max-order) or average more"
        )
    return np.array([group.pole for group in sorted(groups, key=lambda group: -group.n_orders)[:n_modes]])


def _modal_fit(
    frf: Frf, chosen: NDArray[np.bool_], band: Band, fit: MatrixFit, delay: float, warnings: tuple[str, ...]
) -> ModalFit:
    model = replace(fit.model, delay=delay)
    misfit, power = _misfit_and_power(frf, model, chosen)
    error = np.asarray(np.sqrt(misfit / np.where(power > 0, power, 1.0)))
    by_channel = tuple(1 - misfit.sum(axis) / np.maximum(power.sum(axis), 1e-300) for axis in (1, 0))
    chi_square = fit.chi_square if frf.covariance is not None else float("nan")
    warnings = (*fit.doubts, *warnings, *_fit_warnings(frf, chosen, model, band, chi_square, error))
    return ModalFit(model, fit.chart, fit.dropped, band, chi_square, error, by_channel, warnings, fit.status)


def _usable_lines(frf: Frf, band: Band, max_order: int | None) -> NDArray[np.bool_]:
    """Return which lines are valid and in the band; raise an error for too few lines or an impossible band or order."""
    low, high = band
    if not 0 < low < high:
        raise InputError(f"band {low:g} to {high:g} Hz is empty or starts at 0; give 0 < low < high")
    if max_order is not None and max_order < 2:
        raise InputError(f"highest order {max_order} leaves no room for a mode; give 2 or more")
    chosen = frf.valid & (frf.frequencies >= low) & (frf.frequencies <= high)
    if chosen.sum() < SETTINGS.fewest_lines:
        raise InputError(
            f"{chosen.sum()} valid lines between {low:g} and {high:g} Hz (file: {frf.frequencies[0]:g} to "
            f"{frf.frequencies[-1]:g} Hz) are too few to fit; widen the band or use longer segments"
        )
    return np.asarray(chosen)


def _checked_poles(poles: Complex, band: Band, n_lines: int) -> Complex:
    """Check the picked poles and return them in order of frequency.

    Error messages name a pole by its place in the list.
    """
    picked = np.asarray(poles, dtype=complex)
    if not len(picked):
        raise InputError("no pole was picked; name at least one")
    frequencies, damping = np.abs(picked) / (2 * np.pi), -picked.real / np.abs(picked)
    for number, (f, zeta) in enumerate(zip(frequencies, damping, strict=True), start=1):
        if not band[0] <= f <= band[1]:
            raise InputError(
                f"pole {number} at {f:g} Hz lies outside the band {band[0]:g} to {band[1]:g} Hz; widen the band, or "
                "leave the pole out"
            )
        if not 0 < zeta < SETTINGS.largest_damping or picked[number - 1].imag <= 0:
            raise InputError(
                f"pole {number} at {f:g} Hz has a damping ratio of {zeta:g}; a vibration has one above 0 and below "
                f"{SETTINGS.largest_damping:g}: give a ratio, not per cent"
            )
    order = np.argsort(frequencies, kind="stable")
    for first, second in pairwise(order):
        distance = abs(np.log(picked[first] / picked[second]))
        if distance < SETTINGS.same_picked_pole * max(damping[first], damping[second]):
            a, b = sorted((int(first) + 1, int(second) + 1))
            raise InputError(f"poles {a} and {b} are the same, {frequencies[first]:g} Hz; name each mode once")
    if 2 * len(picked) > n_lines:
        raise InputError(f"{len(picked)} poles are too many for {n_lines} lines; pick fewer, or widen the band")
    return picked[order]


def _misfit_and_power(frf: Frf, model: ModalModel, chosen: NDArray[np.bool_]) -> tuple[Real, Real]:
    """Return mean squared misfit and mean squared FRF of each entry, as measured (n_responses, n_excitations)."""
    s = frf.laplace[chosen]
    factor = s ** FRF_ORDERS.get(frf.quantity, 0)
    misfit = frf.values[chosen] - factor[:, None, None] * model.at(s)
    return np.mean(np.abs(misfit) ** 2, axis=0), np.mean(np.abs(frf.values[chosen]) ** 2, axis=0)


def _refinement_warnings(fit: MatrixFit) -> tuple[str, ...]:
    if fit.status == NOT_REFINED:
        return ("the refined poles predict held-out lines worse: the poles are those of the poly-reference method",)
    return () if fit.converged else (NOT_CONVERGED,)


def _moved_poles(picked: Complex, refined: Complex) -> tuple[str, ...]:
    """Return a warning for each picked pole that has no refined pole near it."""
    distance = np.abs(np.log(picked)[:, None] - np.log(refined)[None, :]).min(axis=1)
    far = distance > SETTINGS.moved_pole * 2 * (-picked.real / np.abs(picked))
    return tuple(
        f"the refinement moves the pole picked at {abs(pole) / (2 * np.pi):.4g} Hz away from there; check that it is "
        "a mode"
        for pole in picked[far]
    )


def _fit_warnings(
    frf: Frf, chosen: NDArray[np.bool_], model: ModalModel, band: Band, chi_square: float, error: Real
) -> tuple[str, ...]:
    """Return warnings about lines, misfit and poles of a fit, one sentence each."""
    warnings = []
    in_band = (frf.frequencies >= band[0]) & (frf.frequencies <= band[1])
    if chosen.sum() < in_band.sum():
        warnings.append(
            f"{in_band.sum() - chosen.sum()} of {in_band.sum()} lines in the band have no FRF (dependent inputs) "
            "and were left out"
        )
    if chi_square > SETTINGS.poor_chi_square:
        warnings.append(
            f"the misfit is {chi_square:.1f} times what the noise explains: a mode, leakage or a nonlinearity is left"
        )
    if error.max() > SETTINGS.poor_entry:
        p, q = np.unravel_index(int(error.argmax()), error.shape)
        warnings.append(
            f"{frf.responses[p]} / {frf.excitations[q]} is fitted to {100 * error.max():.0f} % only: "
            "the entry is weak or noisy"
        )
    outside = (model.natural_frequencies < band[0]) | (model.natural_frequencies > band[1])
    if outside.any():
        warnings.append(f"{outside.sum()} mode(s) moved out of the band during refinement; widen the band")
    return tuple(warnings)
