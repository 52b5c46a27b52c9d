"""The transition of the structure over a tooth period as a product of short power series in depth; compiled."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from millfrf.core import Complex, Index, InputError, Real
from millfrf.core.compilation import compiled
from millfrf.cutting import chip_direction, force_direction

from ..milling_loop import DelaySystem, Piece, engagement_pieces
from .collocated_period import radau_nodes

MOST_NODES = 4000
MOST_POWERS = 64
LONGEST_TURN = 18.0
LARGEST_GROWTH = 12.0


@dataclass(frozen=True)
class TransitionSeries:
    """``M(b) = W_J(b) ... W_2(b) W_1(b)``, each window's W an entire function of b known from its first powers.

    A motion multiplied by mu each tooth period sees the delayed force as ``b D(t) y`` with ``b = a (1 - 1 / mu)``: an
    ordinary periodic equation, with M(b) its transition over a period and multipliers where ``det[mu - M(b)] = 0``.
    Over a whole period the terms of a series in b grow like those of ``exp(-x)`` at large x and cancel; windows are so
    short that those of each W do not.

    Parameters
    ----------
    coefficients : (n_speeds, n_windows, n_powers, n, n)
        Coefficients of the powers of b / radius; n = 2 n_modes, real and imaginary parts of the modal coordinates.
    chips : (n_speeds, n_powers, n, n_nodes)
        Chip at the nodes for a unit of each coordinate before the node's window; no powers if not kept.
    needed : (n_speeds, 16)
        Powers that matter in each sixteenth of the radius: enough to find roots, not to refine.
    radius : m
        Largest ``|b|`` that the series are made for.
    windows : (n_nodes,)
        Index of the window in which each node lies.
    times, weights : (n_nodes,)
        Times of the nodes and weights of their quadrature, in periods.
    forces : (n_nodes, 3), Pa
        Force per unit depth and chip.
    periods : (n_speeds,), s
        Tooth period at each speed.
    complete
        Whether all series have converged.
    """

    coefficients: Real
    chips: Real
    needed: Index
    radius: float
    windows: Index
    times: Real
    weights: Real
    forces: Real
    periods: Real
    complete: bool


@dataclass(frozen=True)
class Windows:
    """Windows of a tooth period in which teeth cut, short enough for their series not to cancel.

    Parameters
    ----------
    begins, lengths : (n_windows,)
        Begin and length of each window, in periods.
    teeth : (n_windows,)
        Number of teeth in the cut in each window.
    immersions : (sum of teeth,), rad
        Immersion angle of each tooth at the beginning of its window, window by window.
    radius : m
        Largest ``|b|`` that the series are made for.
    turn, growth
        Angle (rad) by which the fastest mode turns in a window, and exponent by which solutions grow, at most.
    total_growth
        Exponent by which solutions grow over the period, at most.
    """

    begins: Real
    lengths: Real
    teeth: Index
    immersions: Real
    radius: float
    turn: float
    growth: float
    total_growth: float


def series_windows(system: DelaySystem, longest: float, max_depth: float) -> Windows:
    """Windows for tooth periods up to ``longest`` (s) and depths up to ``max_depth`` (m).

    A stiffness b k(t) makes solutions grow no faster than ``exp(sqrt(|b| k / m) t)``; here 1 / m is the rate at which
    an impulse makes the chip grow.
    """
    process, radius = system.process, 2 * max_depth
    pitch = 2 * np.pi / process.teeth
    fastest = float(np.abs(system.poles).max())
    at_once = 2 * np.real(system.right.T @ system.left)
    soon = 2 * np.real((system.right * system.poles[:, None]).T @ system.left)
    windows: list[Piece] = []
    turn, growth, total = 0.0, 0.0, 0.0
    for whole in engagement_pieces(process):
        along = np.linspace(0, whole.end - whole.begin, 9)
        angles = np.concatenate([phi + along for phi in whole.immersions])
        chip = chip_direction(process, angles)
        force = process.ktc * len(whole.immersions) * force_direction(process, angles)
        steep, jump = (float(np.abs((chip @ gain * force).sum(axis=1)).max()) for gain in (soon, at_once))
        duration = (whole.end - whole.begin) / pitch * longest
        whole_growth = (np.sqrt(radius * steep) + radius * jump) * duration
        whole_turn = fastest * duration
        count = max(1, int(np.ceil(max(whole_turn / LONGEST_TURN, whole_growth / LARGEST_GROWTH))))
        if 20 * count > MOST_NODES:
            raise _too_many(system, longest)
        windows += whole.split(count)
        turn, growth = max(turn, whole_turn / count), max(growth, whole_growth / count)
        total += float(whole_growth)
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
        f"more than {MOST_NODES} nodes a tooth period at {2 * np.pi / (system.process.teeth * longest):.4g} rad/s: the "
        "modes turn too often between two teeth; leave out the highest modes, or raise the speed"
    )


def transition_series(
    system: DelaySystem, periods: Real, windows: Windows, *, extra: int = 0, chips: bool = False
) -> TransitionSeries:
    """Compute the series at several tooth periods, which share windows and nodes.

    In a window the forced motion is ``y = A z + b G y`` with ``G = Q o (A B^T)``: Q integrates at Radau's nodes, and A
    and B^T are the structure's free motion to and from a node. So ``y = sum b^k G^k A z``, and the k-th term dies out
    like 1 / (2 k)!.

    Parameters
    ----------
    system
        Structure without residual flexibility, and process.
    periods : (n_speeds,), s
        Tooth periods at which the series are wanted.
    windows
        Windows made for the longest of the periods.
    extra
        Number of nodes a window beyond what is needed, to see what they change.
    chips
        Whether the chips at the nodes are kept.

    Raises
    ------
    InputError
        The structure turns so often in a period that more than 4000 nodes would be needed.
    """
    count = 12 + extra + int(np.ceil(0.8 * windows.turn + 0.6 * windows.growth))
    if count * len(windows.immersions) > MOST_NODES:
        raise _too_many(system, float(periods.max()))
    nodes, weights, integral = _integration(count)
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
    kept = np.zeros((len(periods), MOST_POWERS if chips else 0, size, len(immersions)))
    needed = np.ones((len(periods), 16), dtype=np.int64)
    used = _fill(
        system.poles,
        chip_direction(system.process, immersions) @ (system.right * scale[:, None]).T,
        forces @ (system.left / scale[:, None]).T,
        nodes,
        integral,
        windows.begins,
        windows.lengths,
        windows.teeth,
        periods,
        windows.radius,
        coefficients,
        kept,
        needed,
    )
    return TransitionSeries(
        np.ascontiguousarray(coefficients[:, :, :used]),
        kept,
        needed,
        windows.radius,
        np.repeat(owner, count),
        (windows.begins[owner, None] + half * (nodes + 1)).ravel(),
        (half * weights).ravel(),
        forces,
        periods,
        used < MOST_POWERS,
    )


@cache
def _integration(count: int) -> tuple[Real, Real, Real]:
    """Radau's nodes in (-1, 1], their weights, and the integral from -1 to each node."""
    nodes, weights, derivative = radau_nodes(count)
    return nodes, weights, np.ascontiguousarray(np.linalg.inv(derivative))


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
    """Write the series of every speed and window; return how many powers were needed at most.

    Parameters
    ----------
    poles : (n_modes,), rad/s
    seen, pushed : (n_nodes, n_modes)
        Chip per modal coordinate and modal force per chip at all nodes, window by window and tooth by tooth.
    nodes, integral : (count,), (count, count)
        Nodes in (-1, 1], and the matrix that integrates from -1 to each node.
    begins, lengths : (n_windows,)
        Begin and length of each window, in periods.
    teeth : (n_windows,)
        Number of teeth in the cut in each window.
    periods : (n_speeds,), s
        Tooth periods at which the series are wanted.
    radius : m
        Largest ``|b|`` that the series are made for.
    coefficients, chips, needed
        Arrays that receive the result, as in ``TransitionSeries``.
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
            here = slice(start, start + block)
            _free_motion(
                poles, seen[here], pushed[here], nodes, gap, half, tail, before, after, motion, coefficients[s, w, 0]
            )
            _impulses(poles, after, half * radius * integral[count - 1], block, 2 * half + tail, impulse)
            for j in range(block):
                for i in range(block):
                    total = 0.0
                    for c in range(size):
                        total += before[c, i] * after[c, j]
                    gain[j, i] = total * half * radius * integral[i % count, j % count]
            used = max(used, _powers(gain, impulse, motion, block, coefficients[s, w], chips[s, :, :, here]))
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
    """A and B^T of a window, the chips of its free motion, and its transition if nothing is cut."""
    count, modes = len(nodes), len(poles)
    for r in range(modes):
        late = np.exp(poles[r] * gap)
        whole = late * np.exp(poles[r] * (2 * half + tail))
        free[r, r], free[r, modes + r] = whole.real, -whole.imag
        free[modes + r, r], free[modes + r, modes + r] = whole.imag, whole.real
        for k in range(count):
            ring = np.exp(poles[r] * half * (nodes[k] + 1.0))
            back = 1.0 / ring
            for i in range(k, len(seen), count):
                here = seen[i, r] * ring
                before[r, i], before[modes + r, i] = 2 * here.real, -2 * here.imag
                here *= late
                motion[r, i], motion[modes + r, i] = 2 * here.real, -2 * here.imag
                push = pushed[i, r] * back
                after[r, i], after[modes + r, i] = push.real, push.imag


@compiled
def _impulses(poles: Complex, after: Real, weights: Real, block: int, duration: float, impulse: Real) -> None:
    """Give the modal coordinates that the chip at each node leaves when the window is over."""
    modes = len(poles)
    for r in range(modes):
        rest = np.exp(poles[r] * duration)
        for i in range(block):
            push = complex(after[r, i], after[modes + r, i]) * rest * weights[i % len(weights)]
            impulse[r, i], impulse[modes + r, i] = push.real, push.imag


@compiled(
    "(float64[:,::1], float64[:,::1], float64[:,::1], int64, float64[:,:,::1], float64[:,:,:])",
)
def _powers(gain: Real, impulse: Real, motion: Real, block: int, coefficients: Real, chips: Real) -> int:
    """Write the powers from the first on, until they have died out; return how many there are."""
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
    """Chips that follow from the forces of chips: rows of ``motion`` times the gain."""
    for c in range(len(motion)):
        for i in range(block):
            moved[c, i] = 0.0
        for j in range(block):
            factor = motion[c, j]
            for i in range(block):
                moved[c, i] += gain[j, i] * factor


@compiled
def _count_needed(coefficients: Real, tolerance: float, needed: Index) -> None:
    """Raise ``needed`` to the powers whose share of the largest term matters in each sixteenth of the radius."""
    most = len(coefficients)
    sizes = np.empty(most)
    for k in range(most):
        sizes[k] = np.abs(coefficients[k]).max()
    for part in range(16):
        share, reach, largest, last = (part + 1) / 16, 1.0, 0.0, 1
        for k in range(most):
            largest = max(largest, sizes[k] * reach)
            reach *= share
        reach = 1.0
        for k in range(most):
            if sizes[k] * reach > tolerance * largest:
                last = k + 1
            reach *= share
        needed[part] = max(needed[part], last)
