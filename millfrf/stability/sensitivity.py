"""Sensitivity of a certified limit to structure and cutting coefficients, and its standard error."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, to_receptance
from millfrf.core import Complex, InputError, Real
from millfrf.cutting import MillingProcess, directional_harmonics, refuse_varied
from modal_fit import ModalModel

from .lobes_result import StabilityLobes
from .milling_loop import delay_system
from .settings import SETTINGS
from .tip_receptance import tool_directions, tool_receptance

EXPONENT_STEP = 1e-5  # of the differences by an exponent


@dataclass(frozen=True)
class LimitSensitivity:
    """Derivatives of a limit's depth with respect to cutting coefficients and to the receptance at the motion's lines.

    ``da = Re sum_q sum_ij weights[q, i, j] dH(lines[q])[i, j] + coefficients . (dK_tc, dk_rc, dk_ac, dm)``

    Parameters
    ----------
    lines : (n_lines,), Hz
        Frequencies of the tool's motion at the limit, positive and negative.
    weights : (n_lines, 3, 3), N
        Derivative of the depth by each entry of the receptance, at each line.
    coefficients : (6,)
        Derivatives of the depth: da / dK_tc (m/Pa), da / dk_rc and da / dk_ac (m), and by the exponents of the three
        (m; zero without exponents).
    """

    lines: Real
    weights: Complex
    coefficients: Real


def limit_sensitivities(
    structure: Frf | ModalModel, process: MillingProcess, lobes: StabilityLobes
) -> list[LimitSensitivity | None]:
    """Compute the sensitivity of every finite limit; None where there is no limit or no valid first order.

    At a limit the forces at ``f_q = f + q / tau`` close the loop, ``F = B F`` with
    ``B[p, q] = a K_tc (1 - exp(-2 pi i f tau)) alpha_(p-q) H(f_q)``, so that with its right and left vectors x and y a
    change dB moves the eigenvalue 1 by ``dg = y^H dB x / y^H x``. Depth and frequency follow from the two real
    equations ``dg = 0``. This is the derivative ``-(d|mu|/dp) / (d|mu|/da)`` of a Floquet multiplier on the unit
    circle, resolved by the lines of the motion (B as in Merdol & Altintas 2004).

    Parameters
    ----------
    structure
        Modal model or FRF that the limits were computed from.
    process
        Cutter and engagement.
    lobes
        Limits of :func:`millfrf.stability.certified_lobes`.

    Raises
    ------
    InputError
        A cutter of another shape, unequal pitch or process damping, or a structure that cannot be used.
    """
    refuse_varied(
        process,
        "the first order of a limit",
        "its certified limits have no band; keep a margin of your own",
        takes=("turning", "helix"),
    )
    receptance, highest = structure_receptance(structure, process)
    sensitivities: list[LimitSensitivity | None] = []
    for speed, depth, frequency in zip(
        lobes.spindle_speeds, lobes.depth_limits, lobes.chatter_frequencies, strict=True
    ):
        if np.isfinite(depth) and np.isfinite(frequency):
            passing = process.teeth * float(speed) / (2 * np.pi)
            loop = _loop(receptance, highest, process, passing, float(frequency), float(depth))
            sensitivities.append(_sensitivity(loop, float(depth)))
        else:
            sensitivities.append(None)
    return sensitivities


def structure_receptance(
    structure: Frf | ModalModel, process: MillingProcess
) -> tuple[Callable[[Real], Complex], float]:
    """Return the receptance H as a function of frequencies of either sign, Hz, and the highest frequency needed, Hz."""
    if isinstance(structure, ModalModel):
        system = delay_system(structure, process)
        return lambda lines: system.receptance(2 * np.pi * lines), 4 * float(np.abs(system.poles).max()) / (2 * np.pi)
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
    """The loop of one speed and frequency, per metre of depth; the harmonics are those at the depth of the limit."""

    process: MillingProcess
    passing: float  # Hz, tooth passing
    frequency: float  # Hz, of the limit
    lines: Real  # (n_lines,), Hz
    receptance: Complex  # H (n_lines, 3, 3) at the lines
    slope: Complex  # dH/df
    harmonics: Complex  # of alpha, (n_lines, n_lines, 3, 3)
    by_coefficient: tuple[Complex, ...]  # derivatives of the harmonics by k_rc, k_ac and the three exponents
    by_depth: Complex  # of the harmonics, 1/m: zero for straight edges

    @property
    def delayed(self) -> complex:
        """Return ``1 - exp(-i w tau)``, the factor of regeneration at the limit's frequency."""
        return complex(1 - np.exp(-2j * np.pi * self.frequency / self.passing))


def _loop(
    receptance: Callable[[Real], Complex],
    highest: float,
    process: MillingProcess,
    passing: float,
    frequency: float,
    depth: float,
) -> _Loop:
    share = (process.exit_angle - process.start_angle) * process.teeth / (2 * np.pi)
    reach = min(max(highest, passing * (3 + 4 / share)), 0.5 * 161 * passing)  # at most 161 lines
    orders = np.arange(np.ceil((-reach - frequency) / passing), np.floor((reach - frequency) / passing) + 1).astype(int)
    if process.is_turning:  # constant coefficients couple no lines
        orders = np.zeros(1, dtype=int)
    lines = frequency + passing * orders
    step = 1e-5 * passing
    spread = orders[:, None] - orders[None, :]
    needed = np.arange(spread.min(), spread.max() + 1)

    def harmonics(cut: MillingProcess, at: float = depth) -> Complex:
        return np.asarray(directional_harmonics(cut, needed, at)[spread - spread.min()])

    base = harmonics(process)
    # alpha is linear in both coefficients, so that a difference is the derivative
    by_krc = harmonics(replace(process, krc=process.krc + 1.0)) - base
    by_kac = harmonics(replace(process, kac=process.kac + 1.0)) - base
    law = process.chip_law
    by_exponent = [0 * base] * 3
    for k in range(3 if law.varies else 0):
        step_of_m = EXPONENT_STEP * np.eye(3)[k] * (1 if law.exponents[k] < 0.5 else -1)
        moved = replace(process, chip_law=replace(law, exponents=tuple((law.exponents + step_of_m).tolist())))
        by_exponent[k] = (harmonics(moved) - base) / step_of_m[k]
    slope = (receptance(lines + step) - receptance(lines - step)) / (2 * step)
    deeper = 1e-5 * depth if max(process.helices) else 0.0
    by_depth = (harmonics(process, depth + deeper) - base) / deeper if deeper else 0 * base
    by_coefficient = (by_krc, by_kac, *by_exponent)
    return _Loop(process, passing, frequency, lines, receptance(lines), slope, base, by_coefficient, by_depth)


def _sensitivity(loop: _Loop, depth: float) -> LimitSensitivity | None:
    """Compute derivatives of the depth; None if the gain is not 1, or if depth and frequency cannot be separated."""
    factor = depth * loop.process.ktc * loop.delayed
    gain, force, left = _closing(
        factor * np.einsum("pqij,qjk->piqk", loop.harmonics, loop.receptance),
        np.asarray(loop.receptance.any(axis=(0, 1))),
    )
    if not abs(gain - 1) < SETTINGS.closed_loop:
        return None
    adjoint = factor * np.einsum("pi,pqij->qj", left, loop.harmonics, optimize=True)
    weights = np.einsum("qi,qj->qij", adjoint, force)
    delay_slope = 2j * np.pi / loop.passing * (1 - loop.delayed) / loop.delayed
    motion = np.einsum("qij,qj->qi", loop.receptance, force)

    def by(change: Complex) -> complex:
        return complex(factor * np.einsum("pi,pqij,qj->", left, change, motion, optimize=True))

    by_frequency = complex(np.sum(weights * loop.slope) + gain * delay_slope)
    by_depth = gain / depth + by(loop.by_depth)
    determinant = by_depth.real * by_frequency.imag - by_depth.imag * by_frequency.real
    if abs(determinant) < SETTINGS.least_angle * abs(by_depth) * abs(by_frequency):
        return None
    to_depth = (-by_frequency.imag - 1j * by_frequency.real) / determinant  # Re(to_depth dg) is the change of depth
    coefficients = np.real(to_depth * np.array([gain / loop.process.ktc, *map(by, loop.by_coefficient)]))
    return LimitSensitivity(loop.lines, np.asarray(to_depth * weights), coefficients)


def _closing(loop: Complex, moves: NDArray[np.bool_]) -> tuple[complex, Complex, Complex]:
    """Compute the eigenvalue nearest to 1 of a loop (n, 3, n, 3), and its right and left vector, (n, 3) each.

    The vectors are scaled to ``left . right = 1``. Directions in which a force causes no motion (``moves`` false) are
    left out. The method is inverse iteration.
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


def depth_errors(structure: Frf | ModalModel, process: MillingProcess, lobes: StabilityLobes) -> Real:
    """Estimate the standard error of each certified limit to first order.

    ``var(a) = g^T C g + c^T C_k c`` with g the limit's derivatives by the modal parameters (or by the FRF's lines), c
    those by the coefficients K_tc, k_rc, k_ac and their exponents, and C_k their covariance; see
    :func:`limit_sensitivities`. It holds for Hopf, period doubling and fold. Where two lobes meet the true
    distribution is not symmetric: :func:`limit_band` takes samples.

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
        Neither a covariance nor errors of the coefficients, lobes with averaged coefficients, or a cutter of another
        shape, with unequal pitch or with process damping.
    """
    if structure.covariance is None and not any(process.coefficient_errors):
        raise InputError("the structure has no covariance; fit or estimate it from more averages")
    if lobes.method in ("zero-order", "nyquist"):
        raise InputError(
            f"the limits of {lobes.method} are those of averaged coefficients, not of the cut; "
            "give those of certified_lobes (the default of millfrf lobes)"
        )
    if isinstance(structure, Frf):
        structure = to_receptance(structure)
    errors = np.full(len(lobes.depth_limits), np.nan)
    stated = process.coefficient_covariance
    for k, sensitivity in enumerate(limit_sensitivities(structure, process, lobes)):
        if sensitivity is not None:
            variance = float(sensitivity.coefficients @ stated @ sensitivity.coefficients)
            variance += _structure_variance(structure, sensitivity)
            errors[k] = math.sqrt(max(variance, 0.0))
    return errors


def usable_limits(lobes: StabilityLobes, errors: Real, max_depth: float) -> tuple[Real, Real]:
    """Return limits and standard errors without infinities, each (n_speeds,), m; NaN where nothing is known.

    A speed without a limit gets ``max_depth``, or, if ``max_depth`` is infinite, the largest finite limit. Its relative
    error is the largest relative error of the finite limits.
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
    """Return the ``speeds`` within a relative ``drift`` of ``speed``, and both ends of this range."""
    low, high = speed * (1 - drift), speed * (1 + drift)
    if not speeds.min() <= speed <= speeds.max():
        raise InputError(
            f"{speed * 30 / math.pi:.0f} rpm is outside the lobes, {speeds.min() * 30 / math.pi:.0f} to "
            f"{speeds.max() * 30 / math.pi:.0f} rpm; choose a speed inside"
        )
    inside = speeds[(speeds >= low) & (speeds <= high)]
    return np.unique(np.concatenate([inside, np.clip([low, speed, high], speeds.min(), speeds.max())]))


def _structure_variance(structure: Frf | ModalModel, sensitivity: LimitSensitivity) -> float:
    if structure.covariance is None:
        return 0.0
    if isinstance(structure, ModalModel):
        gradient = _by_parameters(structure, sensitivity)
        return float(gradient @ structure.covariance @ gradient)
    return _frf_variance(structure, sensitivity)


def _by_parameters(model: ModalModel, sensitivity: LimitSensitivity) -> Real:
    """Compute the derivative of the depth by each real model parameter, in the order of ``ModalModel.covariance``."""
    place = tool_directions(model)
    responses, excitations = place.responses, place.excitations
    right, left = responses.place(model.right), excitations.place(model.left)
    s = 2j * np.pi * sensitivity.lines[:, None]
    poles, ends = np.empty((2, len(right)), complex), np.empty((2, 2, *right.shape), complex)
    halves = ((model.poles, right, left), (model.poles.conj(), right.conj(), left.conj()))
    for k, (pole, out, into) in enumerate(halves):
        gain = 1 / (s - pole)
        ends[0, k] = np.einsum("qr,qij,rj->ri", gain, sensitivity.weights, into, optimize=True)
        ends[1, k] = np.einsum("qr,qij,ri->rj", gain, sensitivity.weights, out, optimize=True)
        poles[k] = np.einsum("qr,qij,ri,rj->r", gain**2, sensitivity.weights, out, into, optimize=True)
    by_right, by_left = np.zeros((2, *model.right.shape), complex), np.zeros((2, *model.left.shape), complex)
    by_right[:, :, responses.entries] = ends[0][:, :, responses.axes] * responses.signs
    by_left[:, :, excitations.entries] = ends[1][:, :, excitations.axes] * excitations.signs
    derivatives = []
    for direct, conjugate in (poles, by_right, by_left):
        derivatives += [np.real(direct + conjugate).ravel(), np.real(1j * (direct - conjugate)).ravel()]
    return np.concatenate(derivatives)


def _frf_variance(frf: Frf, sensitivity: LimitSensitivity) -> float:
    """Compute the variance of the depth from an FRF's errors, ``E (Re sum w dH)^2``.

    dH are the errors of the nearest measured lines: circular, and independent from line to line, and errors that all
    lines share.
    """
    assert frf.covariance is not None
    place = tool_directions(frf)
    valid = np.flatnonzero(frf.valid & (frf.frequencies > 0))
    size = np.abs(sensitivity.lines)
    inside = size <= frf.frequencies[valid[-1]]
    nearest = valid[np.argmin(np.abs(frf.frequencies[valid][None, :] - size[inside][:, None]), axis=1)]
    folded = np.where((sensitivity.lines < 0)[:, None, None], sensitivity.weights.conj(), sensitivity.weights)
    below = size < frf.frequencies[valid[0]]  # where the real part of the first line is used
    folded = np.where(below[:, None, None], folded.real, folded)[inside]
    total, shared = 0.0, np.zeros(0 if frf.common_errors is None else len(frf.common_errors))
    for line in np.unique(nearest):
        tool = folded[nearest == line].sum(axis=0)
        weights = np.zeros((len(frf.responses), len(frf.excitations)), dtype=complex)
        signs = np.outer(place.responses.signs, place.excitations.signs)
        at_tool = tool[place.responses.axes][:, place.excitations.axes] * signs
        weights[np.ix_(place.responses.entries, place.excitations.entries)] = at_tool
        response, excitation = frf.covariance.response[line], frf.covariance.excitation[line]
        total += 0.5 * float(np.real(np.sum((weights.T @ response @ weights.conj()) * excitation)))
        if frf.common_errors is not None:
            shared += np.sum(weights * frf.common_errors[:, line], axis=(1, 2)).real
    return total + float(shared @ shared)
