"""Semi-discretisation of first and third order: the delayed motion is a polynomial on small steps."""

import math

import numpy as np
import scipy

from estimation import Frf
from millfrf.core import Index, InputError, Real
from millfrf.cutting import MillingProcess, chip_direction, force_direction, refuse_varied
from modal_fit import ModalModel

from ..floquet.critical_lines import strongest_line
from ..floquet.multipliers import Multipliers, check_cut, sorted_multipliers
from ..lobes_result import StabilityLobes
from ..milling_loop import DelaySystem, Piece, delay_system, engagement_pieces
from .zero_order import checked_speeds


def semi_discretised_multipliers(
    model: ModalModel, process: MillingProcess, spindle_speed: float, depth: float, *, steps: int = 40, order: int = 1
) -> Multipliers:
    """Compute the Floquet multipliers of a cut by semi-discretisation.

    Order 1 is the classical method: on each step the coefficients are their average and the delayed motion is linear;
    the multipliers converge with the square of the step (Insperger & Stepan, Semi-Discretization for Time-Delay
    Systems, section 3.3.2). Order 3 approximates the delayed motion by a cubic and the varying coefficients by a Magnus
    expansion with two Gauss points; it converges with the fourth power. Steps never contain a tooth's entry or exit,
    which would reduce both orders of convergence. The time without cutting is one exact step.

    Parameters
    ----------
    spindle_speed : rad/s
        Spindle speed of the cut.
    depth : m
        Axial depth of cut.
    """
    check_cut(spindle_speed, depth)
    if order not in (1, 3):
        raise InputError(f"order {order!r} of semi-discretisation is not offered; use 1 or 3")
    if steps < 4:
        raise InputError(f"{steps} steps are too few; give 4 or more")
    refuse_varied(process, "semi-discretisation", "use collocation")
    system = delay_system(model, process)
    if system.upper.any():
        raise InputError("semi-discretisation cannot take a residual flexibility; use collocation or multi-frequency")
    return semi_discretised(system, spindle_speed, depth, steps=steps, order=order)


def semi_discretised(system: DelaySystem, speed: float, depth: float, *, steps: int, order: int) -> Multipliers:
    """Compute the multipliers of ``semi_discretised_multipliers`` from arguments that were checked."""
    moving = np.flatnonzero(np.abs(system.right).any(axis=0))
    output = system.output_matrix[moving]
    pieces = engagement_pieces(system.process)
    total = sum(piece.end - piece.begin for piece in pieces)
    counts = [max(4, round(steps * (piece.end - piece.begin) / total)) for piece in pieces]
    size, width = len(system.state_matrix), len(moving)
    length = size + width * sum(count + 1 for count in counts)
    state = np.eye(size, length)
    history, angle, row = [], 0.0, size
    for piece, count in zip(pieces, counts, strict=True):
        state = scipy.linalg.expm(system.state_matrix * (piece.begin - angle) / speed) @ state
        advance, delayed = _steps(system, piece, count, (speed, depth, order), moving)
        history.append(output @ state)
        for k in range(count):
            first = row + width * _first_node(k, count, order)
            state = advance[k] @ state
            state[:, first : first + delayed.shape[2]] += delayed[k]
            history.append(output @ state)
        row += width * (count + 1)
        angle = piece.end
    pitch = 2 * np.pi / system.process.teeth
    state = scipy.linalg.expm(system.state_matrix * (pitch - angle) / speed) @ state
    return sorted_multipliers(np.concatenate([state, *history]), pitch / speed)


def _first_node(step: int, count: int, order: int) -> int:
    """Return the first of the ``order + 1`` nodes between which the delayed motion is interpolated on a step."""
    return step if order == 1 else min(max(step - 1, 0), count - 3)


def _cutting_matrices(system: DelaySystem, piece: Piece, angles: Real) -> Real:
    """Compute K_tc alpha of the teeth that cut in a piece, (n, 3, 3), at angles (n,) from the piece's beginning.

    At the ends of the piece the same teeth count.
    """
    total = np.zeros((len(angles), 3, 3))
    for phi in piece.immersions:
        force = force_direction(system.process, phi + angles)
        total += force[:, :, None] * chip_direction(system.process, phi + angles)[:, None, :]
    return system.process.ktc * total


def _steps(
    system: DelaySystem, piece: Piece, count: int, cut: tuple[float, float, int], moving: Index
) -> tuple[Real, Real]:
    """Compute two matrices for each step of a piece: from state and from delayed motions to the next state."""
    speed, depth, order = cut
    turn = (piece.end - piece.begin) / count
    h = turn / speed
    # Gauss points of all steps: two for the Magnus expansion, four for an average that is exact to rounding
    points, weights = np.polynomial.legendre.leggauss(2 if order == 3 else 4)
    angles = turn * (np.arange(count)[:, None] + (points + 1) / 2)
    cutting = depth * _cutting_matrices(system, piece, angles.ravel()).reshape(count, len(points), 3, 3)[..., moving]
    pushed = system.input_matrix @ cutting  # (count, points, size, width)
    output = system.output_matrix[moving]
    if order == 1:
        mean = np.einsum("g,kgij->kij", weights / 2, pushed)
        return _linear(system.state_matrix + mean @ output, -mean, h)
    return _cubic(system.state_matrix + pushed @ output, -pushed, h, points)


def _linear(matrices: Real, inputs: Real, h: float) -> tuple[Real, Real]:
    """Solve ``x' = P x + R (w_0 + (w_1 - w_0) s / h)`` exactly, with P and R constant on the step."""
    count, size, width = inputs.shape
    exponent = np.zeros((count, size + 2 * width, size + 2 * width))
    exponent[:, :size, :size], exponent[:, :size, size : size + width] = h * matrices, h * inputs
    exponent[:, size : size + width, size + width :] = np.eye(width)
    step = scipy.linalg.expm(exponent)[:, :size]
    start, rise = step[:, :, size : size + width], step[:, :, size + width :]
    return step[:, :, :size], np.concatenate([start - rise, rise], axis=2)


def _cubic(matrices: Real, inputs: Real, h: float, points: Real) -> tuple[Real, Real]:
    """Make a fourth-order Magnus step of ``x' = P(s) x + R(s) sum_j l_j(s) w_j`` with four delayed motions w_j."""
    count, _, size, width = inputs.shape
    exponent = np.zeros((count, 2, size + 4 * width, size + 4 * width))
    exponent[:, :, :size, :size] = h * matrices
    for k in range(count):
        nodes = _first_node(k, count, 3) - k + np.arange(4.0)
        for g, at in enumerate((points + 1) / 2):
            for j in range(4):
                others = np.delete(nodes, j)
                share = np.prod((at - others) / (nodes[j] - others))
                exponent[k, g, :size, size + j * width : size + (j + 1) * width] = h * share * inputs[k, g]
    first, second = exponent[:, 0], exponent[:, 1]
    step = scipy.linalg.expm((first + second) / 2 + math.sqrt(3) / 12 * (second @ first - first @ second))[:, :size]
    return step[:, :, :size], step[:, :, size:]


def semi_discretisation(
    structure: Frf | ModalModel,
    process: MillingProcess,
    spindle_speeds: Real,
    max_depth: float,
    *,
    steps: int = 40,
    order: int = 1,
    n_depths: int = 40,
) -> StabilityLobes:
    """Compute the lowest unstable depth at each speed by a scan over depth and bisection.

    This method is a reference: collocation is faster, finds every island and states its error. Here an island thinner
    than a step of the scan may be missed.

    Parameters
    ----------
    structure
        Modal model at the tool tip.
    process, spindle_speeds, max_depth
        As for :func:`collocation`.
    steps, order
        As for ``semi_discretised_multipliers``.
    n_depths
        Number of steps of the scan.

    Raises
    ------
    InputError
        As ``semi_discretised_multipliers``, or an FRF.
    """
    if isinstance(structure, Frf):
        raise InputError("semi-discretisation needs a modal model, this is an FRF; fit it, or use multi-frequency")
    speeds = checked_speeds(spindle_speeds, max_depth)
    limits, chatter, kinds = np.full(len(speeds), np.inf), np.full(len(speeds), np.nan), ["none"] * len(speeds)

    def solved(speed: float, depth: float) -> Multipliers:
        return semi_discretised_multipliers(structure, process, speed, depth, steps=steps, order=order)

    scan = np.linspace(max_depth / n_depths, max_depth, n_depths)
    for k, speed in enumerate(speeds):
        unstable = next((i for i, depth in enumerate(scan) if not solved(speed, depth).stable), None)
        if unstable is None:
            continue
        low, high = (scan[unstable - 1] if unstable else 0.0), scan[unstable]
        while high - low > 1e-6 * max_depth:
            middle = (low + high) / 2
            low, high = (middle, high) if solved(speed, middle).stable else (low, middle)
        critical = solved(speed, high)
        limits[k], kinds[k] = high, critical.bifurcation
        chatter[k] = strongest_line(delay_system(structure, process), float(speed), high, complex(critical.values[0]))
    return StabilityLobes(speeds, limits, chatter, tuple(kinds), "semi-discretization")
