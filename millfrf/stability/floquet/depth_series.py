"""The transition of the structure over a tooth period as a product of short power series in depth; compiled."""

from dataclasses import dataclass

import numpy as np

from millfrf.core import Complex, Index, InputError, Real
from millfrf.core.compilation import compiled
from millfrf.cutting import chip_direction, force_direction

from ..milling_loop import DelaySystem, Piece, engagement_pieces
from ..settings import SETTINGS
from .collocated_period import radau_nodes

MOST_POWERS = 64  # of a series; one that has not converged by then is not used


@dataclass(frozen=True)
class TransitionSeries:
    """Transition over a tooth period, ``M(b) = W_J(b) ... W_2(b) W_1(b)``, as power series in b of each window's W.

    For a motion that is multiplied by mu each tooth period, the force is ``b D(t) y`` with ``b = a (1 - 1 / mu)``,
    without a delay. M(b) is the transition of this periodic equation over a period, and multipliers satisfy
    ``det[mu - M(b)] = 0``. In a series over the whole period large terms would cancel, like those of ``exp(-x)`` at
    large x. The windows are so short that this does not happen.
    """

    coefficients: Real  # (n_speeds, n_windows, n_powers, n, n) of (b / radius)^k; n = 2 n_modes, as in `PeriodOperator`
    chips: Real  # (n_speeds, n_powers, n, n_nodes): chip at the nodes per coordinate before the window; may be empty
    needed: Index  # (n_speeds, 16): powers needed in each sixteenth of the radius to find roots (refinement uses all)
    radius: float  # m: largest ``|b|`` of the series
    windows: Index  # (n_nodes,): index of each node's window
    times: Real  # (n_nodes,), in periods
    weights: Real  # (n_nodes,), of the quadrature, in periods
    forces: Real  # (n_nodes, 3), Pa: force per unit depth and chip
    periods: Real  # (n_speeds,), s
    complete: bool  # whether all series have converged


@dataclass(frozen=True)
class Windows:
    """Windows of a tooth period in which teeth cut; they are so short that the terms of their series do not cancel."""

    begins: Real  # (n_windows,), in periods
    lengths: Real  # (n_windows,), in periods
    teeth: Index  # (n_windows,): number of teeth in the cut
    immersions: Real  # (sum of teeth,), rad: of each tooth at the beginning of its window, window by window
    radius: float  # m: largest ``|b|`` of the series
    turn: float  # rad: largest angle by which the fastest mode turns in a window
    growth: float  # largest exponent by which solutions grow in a window
    total_growth: float  # bound of the exponent by which solutions grow over the period


def series_windows(system: DelaySystem, longest: float, max_depth: float) -> Windows:
    """Choose windows for tooth periods up to ``longest`` (s) and depths up to ``max_depth`` (m).

    A stiffness b k(t) makes solutions grow no faster than ``exp(sqrt(|b| k / m) t)``; here 1 / m is the rate at which
    an impulse makes the chip grow.
    """
    process, radius = system.process, 2 * max_depth  # |b| = a |1 - 1 / mu| is at most 2 a
    pitch = 2 * np.pi / process.teeth
    fastest = float(np.abs(system.poles).max())
    at_once = 2 * np.real(system.right.T @ system.left)
    soon = 2 * np.real((system.right * system.poles[:, None]).T @ system.left)
    windows: list[Piece] = []
    turn, growth, total = 0.0, 0.0, 0.0
    for piece in engagement_pieces(process):
        along = np.linspace(0, piece.end - piece.begin, 9)
        angles = np.concatenate([phi + along for phi in piece.immersions])
        chip = chip_direction(process, angles)
        force = process.ktc * len(piece.immersions) * force_direction(process, angles)
        steep, jump = (float(np.abs((chip @ gain * force).sum(axis=1)).max()) for gain in (soon, at_once))
        duration = (piece.end - piece.begin) / pitch * longest
        piece_growth = (np.sqrt(radius * steep) + radius * jump) * duration
        piece_turn = fastest * duration
        # a window turns the fastest mode by at most 18 rad and lets solutions grow by at most exp(12)
        count = max(1, int(np.ceil(max(piece_turn / 18.0, piece_growth / 12.0))))
        if 20 * count > SETTINGS.most_nodes:
            raise _too_many(system, longest)
        windows += piece.split(count)
        turn, growth = max(turn, piece_turn / count), max(growth, piece_growth / count)
        total += float(piece_growth)
    return Windows(
        np.array([window.begin for window in windows]) / pitch,
        np.array([window.end - window.begin for window in windows]) / pitch,
        np.array([len(window.immersions) for window in windows]),
        np.array([phi for window in windows for phi in window.immersions]),
        radius,
        turn,
        growth,
        total,
    )


def _too_many(system: DelaySystem, longest: float) -> InputError:
    return InputError(
        f"more than {SETTINGS.most_nodes} nodes a tooth period at "
        f"{2 * np.pi / (system.process.teeth * longest):.4g} rad/s: the modes turn too often between two teeth; leave "
        "out the highest modes, or raise the speed"
    )


def transition_series(
    system: DelaySystem, periods: Real, windows: Windows, *, extra: int = 0, chips: bool = False
) -> TransitionSeries:
    """Compute the series at several tooth periods (n_speeds,), s, which share windows and nodes.

    In a window the forced motion is ``y = A z + b G y`` with ``G = Q o (A B^T)``: Q integrates at Radau's nodes, and A
    and B^T are the structure's free motion to and from a node. So ``y = sum b^k G^k A z``, and the k-th term decays
    like 1 / (2 k)!. The system has no residual flexibility. ``extra`` nodes in each window show the discretisation
    error; ``chips`` says whether the chips at the nodes are returned.
    """
    count = 12 + extra + int(np.ceil(0.8 * windows.turn + 0.6 * windows.growth))
    if count * len(windows.immersions) > SETTINGS.most_nodes:
        raise _too_many(system, float(periods.max()))
    nodes, weights, derivative = radau_nodes(count)
    pitch = 2 * np.pi / system.process.teeth
    owner = np.repeat(np.arange(len(windows.begins)), windows.teeth)
    half = windows.lengths[owner, None] / 2
    immersions = (windows.immersions[:, None] + pitch * half * (nodes + 1)).ravel()
    forces = system.process.ktc * force_direction(system.process, immersions)
    size = 2 * len(system.poles)
    # modal coordinates in which forces and motions have the same size, so that rounding can be told from M itself
    scale = np.sqrt(np.linalg.norm(system.left, axis=1) / np.maximum(np.linalg.norm(system.right, axis=1), 1e-300))
    scale = np.where(scale > 0, scale, 1.0)
    coefficients = np.zeros((len(periods), len(windows.begins), MOST_POWERS, size, size))
    chip_powers = np.zeros((len(periods), MOST_POWERS if chips else 0, size, len(immersions)))
    needed = np.ones((len(periods), 16), dtype=np.int64)
    used = _fill(
        system.poles,
        chip_direction(system.process, immersions) @ (system.right * scale[:, None]).T,
        forces @ (system.left / scale[:, None]).T,
        nodes,
        np.ascontiguousarray(np.linalg.inv(derivative)),
        windows.begins,
        windows.lengths,
        windows.teeth,
        periods,
        windows.radius,
        coefficients,
        chip_powers,
        needed,
    )
    return TransitionSeries(
        np.ascontiguousarray(coefficients[:, :, :used]),
        chip_powers,
        needed,
        windows.radius,
        np.repeat(owner, count),
        (windows.begins[owner, None] + half * (nodes + 1)).ravel(),
        (half * weights).ravel(),
        forces,
        periods,
        used < MOST_POWERS,
    )


@compiled(
    "(complex128[::1], complex128[:,::1], complex128[:,::1], float64[::1], float64[:,::1], float64[::1], "
    "float64[::1], int64[::1], float64[::1], float64, float64[:,:,:,:,::1], float64[:,:,:,::1], "
    "int64[:,::1])",
)
def _fill(
    poles: Complex,
    seen: Complex,
    pushed: Complex,
    nodes: Real,
    integral: Real,
    begins: Real,
    lengths: Real,
    teeth: Index,
    periods: Real,
    radius: float,
    coefficients: Real,
    chips: Real,
    needed: Index,
) -> int:
    """Write the series of every speed and window; return the largest number of powers needed.

    Parameters
    ----------
    poles : (n_modes,), rad/s
    seen, pushed : (n_nodes, n_modes)
        Chip per modal coordinate and modal force per chip at all nodes, window by window and tooth by tooth.
    nodes, integral : (count,), (count, count)
        Nodes in (-1, 1], and the matrix that integrates from -1 to each node.
    periods : (n_speeds,), s
    """
    count, size = len(nodes), 2 * len(poles)
    largest_block = count * teeth.max()
    before, after = np.empty((size, largest_block)), np.empty((size, largest_block))
    motion, impulse = np.empty((size, largest_block)), np.empty((size, largest_block))
    gain = np.empty((largest_block, largest_block))
    used = 1
    for s in range(len(periods)):
        end, start = 0.0, 0
        for w in range(len(begins)):
            gap, half = (begins[w] - end) * periods[s], lengths[w] * periods[s] / 2
            end = begins[w] + lengths[w]
            tail = (1.0 - end) * periods[s] if w == len(begins) - 1 else 0.0
            block = count * teeth[w]
            rows = slice(start, start + block)
            _free_motion(
                poles, seen[rows], pushed[rows], nodes, gap, half, tail, before, after, motion, coefficients[s, w, 0]
            )
            _impulses(poles, after, half * radius * integral[count - 1], block, 2 * half + tail, impulse)
            for j in range(block):
                for i in range(block):
                    total = 0.0
                    for c in range(size):
                        total += before[c, i] * after[c, j]
                    gain[j, i] = total * half * radius * integral[i % count, j % count]
            used = max(used, _powers(gain, impulse, motion, block, coefficients[s, w], chips[s, :, :, rows]))
            _count_needed(coefficients[s, w], 1e-9, needed[s])
            start += block
    return used


@compiled
def _free_motion(
    poles: Complex,
    seen: Complex,
    pushed: Complex,
    nodes: Real,
    gap: float,
    half: float,
    tail: float,
    before: Real,
    after: Real,
    motion: Real,
    free: Real,
) -> None:
    """Write a window's free motion to its nodes (A, chips) and from its nodes (B^T), and its uncut transition."""
    count, modes = len(nodes), len(poles)
    for r in range(modes):
        over_gap = np.exp(poles[r] * gap)
        over_all = over_gap * np.exp(poles[r] * (2 * half + tail))
        free[r, r], free[r, modes + r] = over_all.real, -over_all.imag
        free[modes + r, r], free[modes + r, modes + r] = over_all.imag, over_all.real
        for k in range(count):
            ring = np.exp(poles[r] * half * (nodes[k] + 1.0))
            back = 1.0 / ring
            for i in range(k, len(seen), count):
                chip = seen[i, r] * ring
                before[r, i], before[modes + r, i] = 2 * chip.real, -2 * chip.imag
                chip *= over_gap
                motion[r, i], motion[modes + r, i] = 2 * chip.real, -2 * chip.imag
                push = pushed[i, r] * back
                after[r, i], after[modes + r, i] = push.real, push.imag


@compiled
def _impulses(poles: Complex, after: Real, weights: Real, block: int, duration: float, impulse: Real) -> None:
    """Write the modal coordinates at the window's end that a unit chip at each node causes to ``impulse``."""
    modes = len(poles)
    for r in range(modes):
        decay = np.exp(poles[r] * duration)
        for i in range(block):
            push = complex(after[r, i], after[modes + r, i]) * decay * weights[i % len(weights)]
            impulse[r, i], impulse[modes + r, i] = push.real, push.imag


@compiled(
    "(float64[:,::1], float64[:,::1], float64[:,::1], int64, float64[:,:,::1], float64[:,:,:])",
)
def _powers(gain: Real, impulse: Real, motion: Real, block: int, coefficients: Real, chips: Real) -> int:
    """Write the coefficients of b^1, b^2, ... to ``coefficients``, and their chips to ``chips``.

    Stop when a coefficient is negligible; return the number of powers, b^0 included.
    """
    most, size = coefficients.shape[0], coefficients.shape[1]
    moved = np.empty_like(motion)
    largest = 1.0
    for k in range(1, most):
        term = 0.0
        for c in range(size):
            if len(chips):
                chips[k - 1, c] = motion[c, :block]
            for r in range(size):
                total = 0.0
                for i in range(block):
                    total += impulse[r, i] * motion[c, i]
                coefficients[k, r, c] = total
                term = max(term, abs(total))
        largest = max(largest, term)
        if term < 1e-18 * largest and k > 2:
            return k + 1
        _follow(gain, motion, block, moved)
        motion, moved = moved, motion
    return int(most)


@compiled
def _follow(gain: Real, motion: Real, block: int, moved: Real) -> None:
    """Multiply the chips in the rows of ``motion`` by the gain: the chips that their forces cause, in ``moved``."""
    for c in range(len(motion)):
        for i in range(block):
            moved[c, i] = 0.0
        for j in range(block):
            factor = motion[c, j]
            for i in range(block):
                moved[c, i] += gain[j, i] * factor


@compiled
def _count_needed(coefficients: Real, tolerance: float, needed: Index) -> None:
    """Raise ``needed`` to the number of powers that matter in each sixteenth of the radius.

    A power matters if its term exceeds the share ``tolerance`` of the largest term.
    """
    most = len(coefficients)
    sizes = np.empty(most)
    for k in range(most):
        sizes[k] = np.abs(coefficients[k]).max()
    for sixteenth in range(16):
        share, reach, largest, last = (sixteenth + 1) / 16, 1.0, 0.0, 1
        for k in range(most):
            largest = max(largest, sizes[k] * reach)
            reach *= share
        reach = 1.0
        for k in range(most):
            if sizes[k] * reach > tolerance * largest:
                last = k + 1
            reach *= share
        needed[sixteenth] = max(needed[sixteenth], last)
