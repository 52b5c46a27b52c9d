"""From the covariance of a measurement to a band around the stability limit, a probability and a recommended cut."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from cutting import MillingProcess, average_directional_matrix, refuse_varied
from estimation import Frf
from foundation import InputError
from modal_fit import ModalModel
from modal_fit.uncertainty import pack_parameters, unpack_parameters

from .stability_lobes import StabilityLobes
from .tool_receptance import tool_receptance

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@dataclass(frozen=True)
class RecommendedCut:
    """The cut that removes most at a stated confidence.

    Parameters
    ----------
    spindle_speed
        rad/s.
    depth
        Axial, m.
    confidence
        Probability that it is stable wherever the speed drifts.
    removal
        Depth times speed, the part of the removal rate that was chosen, m rad/s.
    """

    spindle_speed: float
    depth: float
    confidence: float
    removal: float


def depth_errors(structure: Frf | ModalModel, process: MillingProcess, lobes: StabilityLobes) -> Real:
    """Standard error of each zero-order depth limit, from the covariance of the FRF or of the modal model.

    At the limit ``g(w, a) = a K_tc (1 - exp(-i w tau)) lambda(w) - 1 = 0``; a change dH of the receptance changes the
    eigenvalue by ``dlambda = y^H alpha dH x / y^H x`` (x, y its right and left vectors), and with it depth and chatter
    frequency, which both follow from the two real equations g = 0. To first order; where two lobes meet the true
    spread is not symmetric.

    Parameters
    ----------
    structure
        What the lobes were computed from, with its covariance.
    process
        Cutter and engagement.
    lobes
        Hopf limits of :func:`zero_order`.

    Returns
    -------
    (n_speeds,), m; NaN where there is no limit

    Raises
    ------
    InputError
        No covariance, or lobes of another solver.
    """
    if structure.covariance is None:
        raise InputError("the structure has no covariance; fit or estimate it from more averages")
    if lobes.method != "zero-order":
        raise InputError(f"lobes of {lobes.method} have no first-order error; compute zero-order ones")
    errors = np.full(len(lobes.depth_limits), np.nan)
    found = np.flatnonzero(np.isfinite(lobes.depth_limits))
    if not len(found):
        return errors
    frequencies, depths = lobes.chatter_frequencies[found], lobes.depth_limits[found]
    refuse_varied(process, "the band of a limit", "draw it for equal pitch without process damping", takes=("helix",))
    delays = 2 * math.pi / (process.teeth * lobes.spindle_speeds[found])
    weights, slope, level = _sensitivity(structure, process, frequencies, depths, delays)
    # d a / d Re g and d a / d Im g, with the frequency free to follow
    jacobian = np.stack([np.stack([level.real, slope.real], -1), np.stack([level.imag, slope.imag], -1)], -2)
    row = np.linalg.inv(jacobian)[:, 0]
    if isinstance(structure, ModalModel):
        change = _model_changes(structure, frequencies, weights)
        moved = row[:, :1] * change.real + row[:, 1:] * change.imag
        variance = np.einsum("ki,ij,kj->k", moved, structure.covariance, moved, optimize=True)
    else:
        variance = _frf_variance(structure, frequencies, weights) * 0.5 * np.sum(row**2, axis=1)
    errors[found] = np.sqrt(np.maximum(variance, 0.0))
    return errors


def probability_of_stability(
    lobes: StabilityLobes, errors: Real, spindle_speed: float, depth: float, drift: float = 0.0
) -> float:
    """Probability that a cut is stable at every speed within ``drift`` (share) of the chosen one.

    ``P = min Phi((limit - depth) / error)`` over the lobes' speeds in that range; the limits' errors come from one
    measurement and move together, so that the worst speed decides.

    Raises
    ------
    InputError
        A depth that is not positive, or a speed outside the lobes.
    """
    if not depth > 0:
        raise InputError(f"depth {depth:g} m must be positive")
    near = _within(lobes.spindle_speeds, spindle_speed, drift)
    limits = np.array([np.interp(s, lobes.spindle_speeds, _capped(lobes.depth_limits)) for s in near])
    spread = np.array([np.interp(s, lobes.spindle_speeds, np.nan_to_num(errors)) for s in near])
    return float(np.min(ndtr((limits - depth) / np.maximum(spread, 1e-12))))


def recommended_cut(
    lobes: StabilityLobes, errors: Real, *, confidence: float = 0.95, drift: float = 0.02, max_depth: float = math.inf
) -> RecommendedCut:
    """The cut with the largest depth times speed that is stable with ``confidence`` whatever the speed drifts.

    At a given feed per tooth and radial engagement the removal rate is proportional to depth times speed.

    Parameters
    ----------
    lobes, errors
        Limits and their standard errors.
    confidence
        Between 0.5 and 1.
    drift
        Largest relative deviation of the spindle's speed.
    max_depth
        That the cutter allows, m.

    Raises
    ------
    InputError
        A confidence or drift that cannot be, or no cut with that confidence.
    """
    if not 0.5 <= confidence < 1 or not 0 <= drift < 0.5:
        raise InputError(f"confidence {confidence:g} must lie in 0.5 ... 1 and drift {drift:g} in 0 ... 0.5")
    lower = _capped(lobes.depth_limits) - ndtri(confidence) * np.nan_to_num(errors)
    allowed = np.empty(len(lower))
    for k, speed in enumerate(lobes.spindle_speeds):
        near = _within(lobes.spindle_speeds, float(speed), drift)
        allowed[k] = np.interp(near, lobes.spindle_speeds, lower).min()
    allowed = np.minimum(allowed, max_depth)
    removal = allowed * lobes.spindle_speeds
    best = int(np.argmax(removal))
    if allowed[best] <= 0:
        raise InputError(f"no cut is stable with confidence {confidence:g}; measure longer or lower the confidence")
    return RecommendedCut(float(lobes.spindle_speeds[best]), float(allowed[best]), confidence, float(removal[best]))


def _capped(limits: Real) -> Real:
    """Where there is no limit below the largest depth asked for, the largest limit there is."""
    finite = limits[np.isfinite(limits)]
    return np.where(np.isfinite(limits), limits, finite.max() if len(finite) else 0.0)


def _within(speeds: Real, speed: float, drift: float) -> Real:
    low, high = speed * (1 - drift), speed * (1 + drift)
    if not speeds.min() <= speed <= speeds.max():
        raise InputError(
            f"{speed * 30 / math.pi:.0f} rpm is outside the lobes, {speeds.min() * 30 / math.pi:.0f} to "
            f"{speeds.max() * 30 / math.pi:.0f} rpm"
        )
    inside = speeds[(speeds >= low) & (speeds <= high)]
    return np.unique(np.concatenate([inside, np.clip([low, speed, high], speeds.min(), speeds.max())]))


def _sensitivity(
    structure: Frf | ModalModel, process: MillingProcess, frequencies: Real, depths: Real, delays: Real
) -> tuple[Complex, Complex, Complex]:
    """dg per dH (n, 3, 3), dg per Hz, dg per metre of depth."""
    source = tool_receptance(structure)
    alpha = average_directional_matrix(process)
    receptance = source.evaluate(frequencies)
    turn = 1 - np.exp(-2j * np.pi * frequencies * delays)
    factor = depths * process.ktc * turn
    values, right = np.linalg.eig(alpha @ receptance)
    chosen = np.argmin(np.abs(values * factor[:, None] - 1), axis=1)
    lines = np.arange(len(frequencies))
    x, eigenvalue = right[lines, :, chosen], values[lines, chosen]
    left = np.linalg.pinv(right)[lines, chosen]  # rows of the inverse: y^H, with y^H x = 1
    weights = factor[:, None, None] * np.einsum("kp,kq->kpq", left @ alpha, x)
    step = 1e-4 * frequencies
    beside = [source.evaluate(np.clip(frequencies + sign * step, *source.span)) for sign in (1, -1)]
    through_h = np.einsum("kpq,kpq->k", weights, (beside[0] - beside[1]) / (2 * step)[:, None, None])
    through_turn = depths * process.ktc * eigenvalue * 2j * np.pi * delays * (1 - turn)
    return weights, through_h + through_turn, process.ktc * turn * eigenvalue


def _model_changes(model: ModalModel, frequencies: Real, weights: Complex) -> Complex:
    """dg by each real parameter of the model, by central differences, (n_frequencies, n_parameters)."""
    packed = pack_parameters(model)
    size = np.maximum(np.abs(packed), 1e-3 * np.abs(packed).max())
    changes = np.empty((len(frequencies), len(packed)), dtype=complex)
    for number in range(len(packed)):
        step = np.zeros(len(packed))
        step[number] = 1e-6 * size[number]
        ends = [
            tool_receptance(unpack_parameters(model, packed + sign * step)).evaluate(frequencies) for sign in (1, -1)
        ]
        changes[:, number] = np.einsum("kpq,kpq->k", weights, ends[0] - ends[1]) / (2 * step[number])
    return changes


def _frf_variance(frf: Frf, frequencies: Real, weights: Complex) -> Real:
    """E|dg|^2 from the covariance of the measured lines nearest to each frequency."""
    assert frf.covariance is not None
    valid = np.flatnonzero(frf.valid)
    nearest = valid[np.argmin(np.abs(frf.frequencies[valid][None, :] - frequencies[:, None]), axis=1)]
    placed = weights[:, : len(frf.responses), : len(frf.excitations)]
    return np.asarray(
        np.real(
            np.einsum(
                "kpq,kpu,kqv,kuv->k",
                placed,
                frf.covariance.response[nearest],
                frf.covariance.excitation[nearest],
                placed.conj(),
                optimize=True,
            )
        )
    )
