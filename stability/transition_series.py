"""The transition of the structure over a tooth period as a product of short power series in depth; compiled."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cutting import chip_direction, force_direction
from cutting.compiled import compiled
from foundation import InputError

from .delay_system import DelaySystem
from .engagement import Piece, engagement_pieces
from .period_operator import radau_nodes

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Index = NDArray[np.int64]

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
        Of b / radius; n = 2 n_modes, real and imaginary parts of the modal coordinates.
    chips : (n_speeds, n_powers, n, n_nodes)
        Chip at the nodes for a unit of each coordinate before the node's window; no powers if not kept.
    needed : (n_speeds, 16)
        Powers that matter in each sixteenth of the radius: enough to find roots, not to refine.
    radius
        Largest ``|b|`` meant, m.
    windows : (n_nodes,)
        Which window a node is in.
    times, weights : (n_nodes,)
        Of the nodes and their quadrature, in periods.
    forces : (n_nodes, 3)
        Force per unit depth and chip, Pa.
    periods : (n_speeds,), s
    growth
        Bound of the exponent by which solutions grow over a period at the radius.
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
    growth: float
    complete: bool


def transition_series(
    system: DelaySystem, periods: Real, max_depth: float, *, extra: int = 0, chips: bool = False
) -> TransitionSeries:
    """Series for depths up to ``max_depth`` (m) at several tooth periods, which share windows and nodes.

    In a window the forced motion is ``y = A z + b G y`` with ``G = Q o (A B^T)``: Q integrates at Radau's nodes, and A
    and B^T are the structure's free motion to and from a node. So ``y = sum b^k G^k A z``, and the k-th term dies out
    like 1 / (2 k)!.

    Parameters
    ----------
    system
        Structure without residual flexibility, and process.
    periods : (n_speeds,), s
    max_depth
        m.
    extra
        Nodes a window beyond what is needed, to see what they change.
    chips
        Keep the chips at the nodes.

    Raises
    ------
    InputError
        The structure turns so often in a period that more than 4000 nodes would be needed.
    """
    radius, longest = 2 * max_depth, float(periods.max())
    windows, turn, growth, total = _windows(system, longest, radius)
    count = 9 + extra + int(np.ceil(0.6 * turn + 0.5 * growth))
    if count * sum(len(window.immersions) for window in windows) > 4000:
        raise InputError(
            f"more than 4000 nodes a tooth period at {2 * np.pi / (system.process.teeth * longest):.4g} rad/s: the "
            "modes turn too often between two teeth; leave out the highest modes, or raise the speed"
        )
    nodes, weights, derivative = radau_nodes(count)
    pitch = 2 * np.pi / system.process.teeth
    angles, owner, times, shares = [], [], [], []
    for k, window in enumerate(windows):
        length = window.end - window.begin
        for phi in window.immersions:
            angles.append(phi + length / 2 * (nodes + 1))
            times.append((window.begin + length / 2 * (nodes + 1)) / pitch)
            shares.append(weights * length / 2 / pitch)
            owner.append(np.full(count, k))
    immersions = np.concatenate(angles)
    forces = system.process.ktc * force_direction(system.process, immersions)
    seen = chip_direction(system.process, immersions) @ system.right.T
    pushed = forces @ system.left.T
    size, n_windows = 2 * len(system.poles), len(windows)
    coefficients = np.zeros((len(periods), n_windows, MOST_POWERS, size, size))
    kept = np.zeros((len(periods), MOST_POWERS if chips else 0, size, len(immersions)))
    used = _fill(
        system.poles,
        seen,
        pushed,
        nodes,
        np.ascontiguousarray(np.linalg.inv(derivative)),
        np.array([window.begin for window in windows]) / pitch,
        np.array([window.end - window.begin for window in windows]) / pitch,
        np.array([len(window.immersions) for window in windows]),
        periods,
        radius,
        coefficients,
        kept,
    )
    coefficients = np.ascontiguousarray(coefficients[:, :, :used])
    needed = _needed_powers(coefficients, 1e-9)
    return TransitionSeries(
        coefficients,
        kept[:, :used],
        needed,
        radius,
        np.concatenate(owner),
        np.concatenate(times),
        np.concatenate(shares),
        forces,
        periods,
        total,
        used < MOST_POWERS,
    )


def _windows(system: DelaySystem, period: float, radius: float) -> tuple[list[Piece], float, float, float]:
    """Windows of a period, the largest turn and growth in one, and the growth over all."""
    pitch = 2 * np.pi / system.process.teeth
    fastest = float(np.abs(system.poles).max())
    at_once = 2 * np.real(system.right.T @ system.left)
    soon = 2 * np.real((system.right * system.poles[:, None]).T @ system.left)
    windows, turn, growth, total = [], 0.0, 0.0, 0.0
    for whole in engagement_pieces(system.process):
        share = np.linspace(0, whole.end - whole.begin, 9)
        angles = np.concatenate([phi + share for phi in whole.immersions])
        chip, force = chip_direction(system.process, angles), force_direction(system.process, angles)
        force = force * system.process.ktc * len(whole.immersions)
        steep = np.abs(np.einsum("ni,ij,nj->n", chip, soon, force)).max()
        jump = np.abs(np.einsum("ni,ij,nj->n", chip, at_once, force)).max()
        duration = (whole.end - whole.begin) / pitch * period
        whole_growth = (np.sqrt(radius * steep) + radius * jump) * duration
        whole_turn = fastest * duration
        count = max(1, int(np.ceil(max(whole_turn / LONGEST_TURN, whole_growth / LARGEST_GROWTH))))
        windows += whole.split(count) if count < 4000 else [whole] * 4000
        turn, growth = max(turn, whole_turn / count), max(growth, whole_growth / count)
        total += float(whole_growth)
    return windows, turn, growth, total


@compiled
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
) -> int:
    """Write the series of every speed and window; return how many powers were needed at most.

    Parameters
    ----------
    poles : (n_modes,), rad/s
    seen, pushed : (n_nodes, n_modes)
        Chip per modal coordinate and modal force per chip at all nodes, window by window and tooth by tooth.
    nodes, integral : (count,), (count, count)
        In (-1, 1], and the integral from -1 to each node.
    begins, lengths : (n_windows,)
        In periods.
    teeth : (n_windows,)
        In the cut.
    periods : (n_speeds,), s
    radius
        m.
    coefficients, chips
        Receive the result.
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
    """What the chip at each node leaves in the modal coordinates when the window is over."""
    modes = len(poles)
    for r in range(modes):
        rest = np.exp(poles[r] * duration)
        for i in range(block):
            push = complex(after[r, i], after[modes + r, i]) * rest * weights[i % len(weights)]
            impulse[r, i], impulse[modes + r, i] = push.real, push.imag


@compiled
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


def _needed_powers(coefficients: Real, tolerance: float) -> Index:
    """Powers whose share of the largest term matters in any window, in each sixteenth of the radius."""
    count = coefficients.shape[2]
    size = np.abs(coefficients).max(axis=(3, 4))
    share = np.arange(1, 17) / 16
    reach = size[:, :, None, :] * share[:, None] ** np.arange(count)
    matters = (reach > tolerance * reach.max(axis=3, keepdims=True)).any(axis=1)
    return np.asarray(count - np.argmax(matters[:, :, ::-1], axis=2), dtype=np.int64)
