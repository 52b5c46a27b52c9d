"""The step from errors of a measurement to a standard error of each stability limit, and to a probability."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from cutting import MillingProcess
from estimation import Frf, to_receptance
from foundation import InputError
from modal_fit import ModalModel

from ..lobes import StabilityLobes
from ..milling_loop import tool_directions
from .limit_sensitivity import LimitSensitivity, limit_sensitivities

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

AVERAGED = ("zero-order", "nyquist")
"""Methods with coefficients averaged over the tooth, whose limits are not those of the cut."""


def depth_errors(structure: Frf | ModalModel, process: MillingProcess, lobes: StabilityLobes) -> Real:
    """Estimate each certified limit's standard error from those of structure and cutting coefficients, to first order.

    ``var(a) = g^T C g + sum_k (da/dk)^2 std_k^2`` with g the limit's derivatives by the modal parameters (or by the
    FRF's lines) and k the coefficients K_tc, k_rc, k_ac; see :func:`limit_sensitivities`. Hopf, period doubling and
    fold alike. Where two lobes meet the true spread is not symmetric: :func:`limit_band` notices and takes samples.

    Parameters
    ----------
    structure
        FRF or modal model that the lobes were computed from.
    process
        Cutter and engagement, with the coefficients' standard errors where they are known.
    lobes
        Certified limits, from :func:`certified_lobes`.

    Returns
    -------
    (n_speeds,), m; NaN where there is no limit, or no first order of it

    Raises
    ------
    InputError
        Neither a covariance nor errors of the coefficients, lobes with averaged coefficients, or a cut with a helix,
        unequal pitch or process damping.
    """
    if structure.covariance is None and not any(process.coefficient_errors):
        raise InputError("the structure has no covariance; fit or estimate it from more averages")
    if lobes.method in AVERAGED:
        raise InputError(
            f"the limits of {lobes.method} are those of averaged coefficients, not of the cut; "
            "give those of certified_lobes (the default of millfrf lobes)"
        )
    if isinstance(structure, Frf):
        structure = to_receptance(structure)
    errors = np.full(len(lobes.depth_limits), np.nan)
    stated = np.array(process.coefficient_errors)
    for k, found in enumerate(limit_sensitivities(structure, process, lobes)):
        if found is not None:
            variance = float(np.sum((found.coefficients * stated) ** 2)) + _structure_variance(structure, found)
            errors[k] = math.sqrt(max(variance, 0.0))
    return errors


def probability_of_stability(
    lobes: StabilityLobes, errors: Real, spindle_speed: float, depth: float, drift: float = 0.0
) -> float:
    """Probability that a cut is stable at every speed within ``drift`` (share) of the chosen one.

    ``P = min Phi((limit - depth) / error)`` over the lobes' speeds in that range; the limits' errors come from one
    measurement and move together, so that the worst speed decides. A speed without a limit counts with the largest
    limit there is and with the largest relative error.

    Raises
    ------
    InputError
        A depth that is not positive, a speed outside the lobes, or a limit or an error in the range that is not known.
    """
    if not depth > 0:
        raise InputError(f"depth {depth:g} m must be positive")
    near = speeds_within(lobes.spindle_speeds, spindle_speed, drift)
    known, spread = usable_limits(lobes, errors, math.inf)
    limits, errors_near = (np.interp(near, lobes.spindle_speeds, column) for column in (known, spread))
    if not (np.isfinite(limits).all() and np.isfinite(errors_near).all()):
        worst = near[~(np.isfinite(limits) & np.isfinite(errors_near))][0] * 30 / math.pi
        raise InputError(f"the limit near {worst:.0f} rpm is not resolved, or its error is not; no probability there")
    return float(np.min(ndtr((limits - depth) / np.maximum(errors_near, 1e-12))))


def usable_limits(lobes: StabilityLobes, errors: Real, max_depth: float) -> tuple[Real, Real]:
    """Limits and standard errors that can be computed with, each (n_speeds,), m; NaN where nothing is known.

    A speed without a limit has ``max_depth``, or where that is infinite the largest limit there is, with the largest
    relative error of the other speeds.
    """
    finite = np.isfinite(lobes.depth_limits)
    relative = errors[finite] / lobes.depth_limits[finite]
    relative = relative[np.isfinite(relative)]
    free = np.isposinf(lobes.depth_limits)
    top = max_depth if math.isfinite(max_depth) else float(lobes.depth_limits[finite].max()) if finite.any() else 0.0
    limits = np.where(free, top, lobes.depth_limits)
    largest = float(relative.max()) if len(relative) else 0.0
    spread = np.where(free, largest * top, errors)
    unknown = np.array([status == "unresolved" for status in lobes.status], dtype=bool) | ~np.isfinite(spread)
    return np.where(unknown, np.nan, np.minimum(limits, max_depth)), np.where(unknown, np.nan, spread)


def speeds_within(speeds: Real, speed: float, drift: float) -> Real:
    """Give the ``speeds`` within a relative ``drift`` of one, with the ends of that range.

    Raises
    ------
    InputError
        A speed outside them.
    """
    low, high = speed * (1 - drift), speed * (1 + drift)
    if not speeds.min() <= speed <= speeds.max():
        raise InputError(
            f"{speed * 30 / math.pi:.0f} rpm is outside the lobes, {speeds.min() * 30 / math.pi:.0f} to "
            f"{speeds.max() * 30 / math.pi:.0f} rpm; choose a speed inside"
        )
    inside = speeds[(speeds >= low) & (speeds <= high)]
    return np.unique(np.concatenate([inside, np.clip([low, speed, high], speeds.min(), speeds.max())]))


def _structure_variance(structure: Frf | ModalModel, found: LimitSensitivity) -> float:
    if structure.covariance is None:
        return 0.0
    if isinstance(structure, ModalModel):
        gradient = _by_parameters(structure, found)
        return float(gradient @ structure.covariance @ gradient)
    return _frf_variance(structure, found)


def _by_parameters(model: ModalModel, found: LimitSensitivity) -> Real:
    """da by each real parameter of the model, in the order of ``ModalModel.covariance``."""
    place = tool_directions(model)
    right, left = place.place_rows(model.right), place.place_columns(model.left)
    s = 2j * np.pi * found.lines[:, None]
    poles, ends = np.empty((2, len(right)), complex), np.empty((2, 2, *right.shape), complex)
    halves = ((model.poles, right, left), (model.poles.conj(), right.conj(), left.conj()))
    for turn, (pole, out, into) in enumerate(halves):
        pull = 1 / (s - pole)
        ends[0, turn] = np.einsum("qr,qij,rj->ri", pull, found.weights, into, optimize=True)
        ends[1, turn] = np.einsum("qr,qij,ri->rj", pull, found.weights, out, optimize=True)
        poles[turn] = np.einsum("qr,qij,ri,rj->r", pull**2, found.weights, out, into, optimize=True)
    by_right, by_left = np.zeros((2, *model.right.shape), complex), np.zeros((2, *model.left.shape), complex)
    by_right[:, :, place.rows] = ends[0][:, :, place.row_axes] * place.row_signs
    by_left[:, :, place.columns] = ends[1][:, :, place.column_axes] * place.column_signs
    pieces = []
    for direct, conjugate in (poles, by_right, by_left):
        pieces += [np.real(direct + conjugate).ravel(), np.real(1j * (direct - conjugate)).ravel()]
    return np.concatenate(pieces)


def _frf_variance(frf: Frf, found: LimitSensitivity) -> float:
    """``E (Re sum w dH)^2``, dH circular and independent from line to line, taken at the measured lines nearest."""
    assert frf.covariance is not None
    place = tool_directions(frf)
    valid = np.flatnonzero(frf.valid & (frf.frequencies > 0))
    size = np.abs(found.lines)
    inside = size <= frf.frequencies[valid[-1]]
    nearest = valid[np.argmin(np.abs(frf.frequencies[valid][None, :] - size[inside][:, None]), axis=1)]
    folded = np.where((found.lines < 0)[:, None, None], found.weights.conj(), found.weights)
    below = size < frf.frequencies[valid[0]]  # there the first line's real part stands in
    folded = np.where(below[:, None, None], folded.real, folded)[inside]
    total = 0.0
    for line in np.unique(nearest):
        tool = folded[nearest == line].sum(axis=0)
        weights = np.zeros((len(frf.responses), len(frf.excitations)), dtype=complex)
        chosen = tool[place.row_axes][:, place.column_axes] * np.outer(place.row_signs, place.column_signs)
        weights[np.ix_(place.rows, place.columns)] = chosen
        response, excitation = frf.covariance.response[line], frf.covariance.excitation[line]
        total += 0.5 * float(np.real(np.sum((weights.T @ response @ weights.conj()) * excitation)))
    return total
