"""Sensitivity of a certified limit to structure and cutting coefficients, and its standard error."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import Frf, to_receptance
from millfrf.core import Complex, InputError, Real
from millfrf.cutting import MillingProcess, directional_harmonics, refuse_varied
from modal_fit import ModalModel

from ..lobes_result import StabilityLobes
from ..milling_loop import delay_system
from ..tip_receptance import tool_directions, tool_receptance

MOST_LINES = 161
"""Lines of the motion at one limit that are taken at most."""

CLOSED = 0.03
"""How far the loop gain at a limit may be from 1: beyond it the limit is not one of this structure and cut."""

STEEP = 0.02
"""Sine of the angle between the loop's changes by depth and by frequency, below which a limit has no first order."""


@dataclass(frozen=True)
class LimitSensitivity:
    """Derivatives of a limit's depth by the receptance at the lines of its motion and by the cutting coefficients.

    ``da = Re sum_q sum_ij weights[q, i, j] dH(lines[q])[i, j] + coefficients . (dK_tc, dk_rc, dk_ac)``

    Parameters
    ----------
    lines : (n_lines,), Hz
        Frequencies of the tool's motion at the limit, negative ones too.
    weights : (n_lines, 3, 3), N
        Derivative of the depth by each entry of the receptance, at each line.
    coefficients : (3,)
        Derivatives of the depth: da / dK_tc (m/Pa), da / dk_rc and da / dk_ac (m).
    """

    lines: Real
    weights: Complex
    coefficients: Real


def limit_sensitivities(
    structure: Frf | ModalModel, process: MillingProcess, lobes: StabilityLobes
) -> list[LimitSensitivity | None]:
    """Sensitivity of every finite limit; None where there is none, or where the first order does not hold.

    At a limit the forces at ``f_q = f + q / tau`` close the loop, ``F = B F`` with
    ``B[p, q] = a K_tc (1 - exp(-2 pi i f tau)) alpha_(p-q) H(f_q)``, so that with its right and left vectors x and y a
    change dB moves the eigenvalue 1 by ``dg = y^H dB x / y^H x``. Depth and frequency follow from the two real
    equations ``dg = 0``: the derivative ``-(d|mu|/dp) / (d|mu|/da)`` of a Floquet multiplier on the unit circle, told
    for each line of the motion (B as in Merdol & Altintas 2004).

    Parameters
    ----------
    structure
        What the limits are of; a modal model, or an FRF.
    process
        Cutter and engagement.
    lobes
        Limits of :func:`millfrf.stability.certified_lobes`.

    Raises
    ------
    InputError
        Helical edges, unequal pitch or process damping, or a structure that cannot be used.
    """
    refuse_varied(process, "the first order of a limit", "take samples of the limit instead")
    moving, highest = _receptance(structure, process)
    found: list[LimitSensitivity | None] = []
    for speed, depth, frequency in zip(
        lobes.spindle_speeds, lobes.depth_limits, lobes.chatter_frequencies, strict=True
    ):
        if np.isfinite(depth) and np.isfinite(frequency):
            loop = _loop(moving, highest, process, process.teeth * float(speed) / (2 * np.pi), float(frequency))
            found.append(_sensitivity(loop, float(depth)))
        else:
            found.append(None)
    return found


def _receptance(structure: Frf | ModalModel, process: MillingProcess) -> tuple[Callable[[Real], Complex], float]:
    """H at frequencies of either sign, (n,) Hz to (n, 3, 3), and the highest frequency that matters."""
    if isinstance(structure, ModalModel):
        system = delay_system(structure, process)

        def of_model(lines: Real) -> Complex:
            s = 2j * np.pi * lines[:, None]
            ahead = np.einsum("kr,rp,rq->kpq", 1 / (s - system.poles), system.right, system.left, optimize=True)
            behind = np.einsum(
                "kr,rp,rq->kpq", 1 / (s - system.poles.conj()), system.right.conj(), system.left.conj(), optimize=True
            )
            return np.asarray(ahead + behind + system.upper)

        return of_model, 4 * float(np.abs(system.poles).max()) / (2 * np.pi)
    source = tool_receptance(structure)
    low, high = source.span

    def of_frf(lines: Real) -> Complex:
        size = np.abs(lines)
        values = source.evaluate(np.clip(size, low, high))
        values[size < low] = values[size < low].real
        values[size > high] = 0
        values[lines < 0] = values[lines < 0].conj()
        return values

    return of_frf, high


@dataclass(frozen=True)
class _Loop:
    """The loop of one speed and frequency, for a depth of 1 m: orders, lines, H and its slope, harmonics of alpha."""

    process: MillingProcess
    passing: float
    frequency: float
    lines: Real
    receptance: Complex
    slope: Complex
    harmonics: Complex
    by_coefficient: tuple[Complex, Complex]

    @property
    def delayed(self) -> complex:
        """``1 - exp(-i w tau)``."""
        return complex(1 - np.exp(-2j * np.pi * self.frequency / self.passing))


def _loop(
    moving: Callable[[Real], Complex], highest: float, process: MillingProcess, passing: float, frequency: float
) -> _Loop:
    share = (process.exit_angle - process.start_angle) * process.teeth / (2 * np.pi)
    reach = min(max(highest, passing * (3 + 4 / share)), 0.5 * MOST_LINES * passing)
    orders = np.arange(np.ceil((-reach - frequency) / passing), np.floor((reach - frequency) / passing) + 1).astype(int)
    lines = frequency + passing * orders
    step = 1e-5 * passing
    spread = orders[:, None] - orders[None, :]
    wanted = np.arange(spread.min(), spread.max() + 1)

    def harmonics(cut: MillingProcess) -> Complex:
        return np.asarray(directional_harmonics(cut, wanted)[spread - spread.min()])

    mean = harmonics(process)
    more = [replace(process, **{name: getattr(process, name) + 1.0}) for name in ("krc", "kac")]
    changes = (harmonics(more[0]) - mean, harmonics(more[1]) - mean)  # alpha is linear in both
    slope = (moving(lines + step) - moving(lines - step)) / (2 * step)
    return _Loop(process, passing, frequency, lines, moving(lines), slope, mean, changes)


def _sensitivity(loop: _Loop, depth: float) -> LimitSensitivity | None:
    """Depth's derivatives; None where the loop does not close, or where depth and frequency cannot be told apart."""
    factor = depth * loop.process.ktc * loop.delayed
    gain, force, left = _closing(
        factor * np.einsum("pqij,qjk->piqk", loop.harmonics, loop.receptance),
        np.asarray(loop.receptance.any(axis=(0, 1))),
    )
    if not abs(gain - 1) < CLOSED:
        return None
    arrived = factor * np.einsum("pi,pqij->qj", left, loop.harmonics, optimize=True)
    weights = np.einsum("qi,qj->qij", arrived, force)
    turn = 2j * np.pi / loop.passing * (1 - loop.delayed) / loop.delayed
    by_frequency, by_depth = complex(np.sum(weights * loop.slope) + gain * turn), gain / depth
    determinant = by_depth.real * by_frequency.imag - by_depth.imag * by_frequency.real
    if abs(determinant) < STEEP * abs(by_depth) * abs(by_frequency):
        return None
    turned = (-by_frequency.imag - 1j * by_frequency.real) / determinant  # Re(turned dg) is the change of depth
    motion = np.einsum("qij,qj->qi", loop.receptance, force)
    shares = [factor * np.einsum("pi,pqij,qj->", left, change, motion, optimize=True) for change in loop.by_coefficient]
    coefficients = np.real(turned * np.array([gain / loop.process.ktc, *shares]))
    return LimitSensitivity(loop.lines, np.asarray(turned * weights), coefficients)


def _closing(loop: Complex, moves: NDArray[np.bool_]) -> tuple[complex, Complex, Complex]:
    """The eigenvalue nearest to 1 of a loop (n, 3, n, 3), its right vector and its left one (``left . right = 1``).

    A direction in which a force moves nothing (``moves`` false) takes no part.
    """
    count, width = len(loop), int(moves.sum())
    matrix = loop[:, moves][:, :, :, moves].reshape(count * width, count * width)
    inverse = np.linalg.inv(matrix - (1 + 1e-9) * np.eye(len(matrix)))
    right, left = np.ones(len(matrix), dtype=complex), np.ones(len(matrix), dtype=complex)
    for _ in range(6):
        right, left = inverse @ right, left @ inverse
        right, left = right / np.linalg.norm(right), left / np.linalg.norm(left)
    gain = complex((left @ matrix @ right) / (left @ right))
    vectors = np.zeros((2, count, 3), dtype=complex)
    vectors[0][:, moves] = right.reshape(count, width)
    vectors[1][:, moves] = (left / (left @ right)).reshape(count, width)
    return gain, vectors[0], vectors[1]


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
    return float(np.min(scipy.special.ndtr((limits - depth) / np.maximum(errors_near, 1e-12))))


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
