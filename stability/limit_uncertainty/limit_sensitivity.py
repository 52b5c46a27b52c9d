"""How a certified depth limit moves with the structure and with the cutting coefficients, to first order."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess, directional_harmonics, refuse_varied
from estimation import Frf
from modal_fit import ModalModel

from ..lobes import StabilityLobes
from ..milling_loop import delay_system, tool_receptance

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Index = NDArray[np.int64]

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
        Limits of :func:`stability.certified_lobes`.

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
