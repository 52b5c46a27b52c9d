"""One tooth period as matrices: spectral collocation, split at tooth entry and exit."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, InputError, Real
from millfrf.cutting import chip_direction, force_direction

from ..milling_loop import DelaySystem, Piece, engagement_pieces


@dataclass(frozen=True)
class PeriodOperator:
    """Effect of one period's chip thickness on itself and on the structure, per unit depth, at several speeds.

    With h the regenerated chip at the nodes, z = (Re q, Im q) the structure at the period's beginning and a the depth:
    ``y = E z + a G h`` is the tool's motion along the chip at the nodes and ``z_next = Phi z + a S h``.

    Parameters
    ----------
    within : (n_speeds, n_nodes, n_nodes)
        Matrix G, nearly triangular: a chip acts only later.
    motion : (n_speeds, n_nodes, 2 n_modes)
        Matrix E: motion along the chip for a unit of each coordinate of the structure.
    impulse : (n_speeds, 2 n_modes, n_nodes)
        Matrix S: state at the period's end for a unit chip at each node.
    free : (n_speeds, 2 n_modes, 2 n_modes)
        Matrix Phi: the structure left alone for a period.
    times : (n_nodes,)
        Times of the nodes, in periods.
    weights : (n_nodes,)
        Weights of the quadrature over the period, in periods.
    forces : (n_nodes, 3)
        Force per unit depth and chip, Pa.
    periods : (n_speeds,), s
        Tooth period at each speed.
    """

    within: Real
    motion: Real
    impulse: Real
    free: Real
    times: Real
    weights: Real
    forces: Real
    periods: Real


@cache
def radau_nodes(count: int) -> tuple[Real, Real, Real]:
    """Nodes in (-1, 1] with their last at 1, quadrature weights, and the derivative there of what is zero at -1.

    Radau's nodes, the zeros of ``P_(n-1) - P_n``: as spectral as Chebyshev's, and what they give at the end of a
    piece converges twice as fast (Hairer & Wanner, Solving ODEs II, section IV.5; Trefethen, Spectral Methods in
    MATLAB, chapter 6, for the barycentric derivative).

    Returns
    -------
    nodes : (count,), weights : (count,), derivative : (count, count)

    Examples
    --------
    >>> nodes, weights, _ = radau_nodes(2)
    >>> nodes.round(6).tolist(), weights.round(6).tolist()
    ([-0.333333, 1.0], [1.5, 0.5])
    """
    legendre = np.polynomial.legendre
    series = np.zeros(count + 1)
    series[count - 1], series[count] = 1.0, -1.0
    nodes = np.sort(np.real(legendre.legroots(series)))
    for _ in range(2):
        nodes = nodes - legendre.legval(nodes, series) / legendre.legval(nodes, legendre.legder(series))
    nodes[-1] = 1.0
    lower = np.zeros(count)
    lower[count - 1] = 1.0
    # mirrored from the rule with its fixed node at -1: w = (1 - x) / (n P_(n-1)(x))^2
    weights = (1 + nodes) / (count * legendre.legval(nodes, lower)) ** 2
    weights[-1] = 2 / count**2
    points = np.concatenate([[-1.0], nodes])
    gaps = points[:, None] - points
    np.fill_diagonal(gaps, 1.0)
    logs = np.log(np.abs(gaps)).sum(axis=1)
    signs = np.sign(gaps).prod(axis=1)
    ratio = (signs[:, None] * signs) * np.exp(logs[:, None] - logs)
    derivative = ratio / gaps
    np.fill_diagonal(derivative, 0.0)
    np.fill_diagonal(derivative, -derivative.sum(axis=1))
    return nodes, weights, derivative[1:, 1:]


def piece_nodes(system: DelaySystem, periods: Real, *, extra: int = 0) -> list[tuple[Piece, int]]:
    """Split long pieces, and say how many nodes each needs at the longest of ``periods``.

    A piece is split so that the fastest mode turns by at most 24 rad in it; nodes then grow with that turn.
    """
    fastest = float(np.abs(system.poles).max()) * float(periods.max()) * system.process.teeth / (2 * np.pi)
    result = []
    for whole in engagement_pieces(system.process):
        turn = fastest * (whole.end - whole.begin)
        pieces = max(1, int(np.ceil(turn / 24)))
        count = 14 + extra + int(np.ceil(0.62 * turn / pieces))
        result += [(piece, count) for piece in whole.split(pieces)]
    total = sum(count * len(piece.immersions) for piece, count in result)
    if total > 4000:
        raise InputError(
            f"{total} nodes a tooth period at {2 * np.pi / (system.process.teeth * periods.max()):.4g} rad/s: the "
            "modes turn too often between two teeth; leave out the highest modes, or raise the speed"
        )
    return result


def period_operator(system: DelaySystem, periods: Real, *, extra: int = 0) -> PeriodOperator:
    """Discretise one tooth period at several tooth periods at once.

    On each piece ``v' = p v + force`` is collocated for every pole; a tooth's force has rank one, so that the unknown
    is one chip thickness a node, not the whole state, and its size does not grow with the modes.

    Parameters
    ----------
    system
        Structure and process.
    periods : (n_speeds,), s
        All are given the nodes that the longest needs.
    extra
        Nodes a piece beyond what is needed, to see what they change.

    Raises
    ------
    InputError
        The structure turns so often in a period that more than 4000 nodes would be needed.
    """
    pieces = piece_nodes(system, periods, extra=extra)
    poles, n_modes = system.poles, len(system.poles)
    sizes = [count * len(piece.immersions) for piece, count in pieces]
    starts = np.concatenate([[0], np.cumsum(sizes)])
    n = int(starts[-1])
    within = np.zeros((len(periods), n, n))
    motion = np.zeros((len(periods), n, n_modes), dtype=complex)
    impulse = np.zeros((len(periods), n_modes, n), dtype=complex)
    times, weights, forces = np.zeros(n), np.zeros(n), np.zeros((n, 3))
    pitch = 2 * np.pi / system.process.teeth
    for (piece, count), start in zip(pieces, starts, strict=False):
        block = _piece(system, periods, piece, count)
        here = slice(start, start + count * len(piece.immersions))
        begin, end = piece.begin / pitch * periods, piece.end / pitch * periods
        times[here], weights[here], forces[here] = block.times, block.weights, block.forces
        motion[:, here] = block.decay * np.exp(np.outer(begin, poles))[:, None, :]
        # what earlier pieces left at the period's beginning, were it carried back there, rings on here
        within[:, here, :start] = 2 * np.real(motion[:, here] @ impulse[:, :, :start])
        within[:, here, here] = block.within
        impulse[:, :, here] = block.impulse * np.exp(-np.outer(end, poles))[:, :, None]
    return _joined(within, motion, impulse, np.exp(np.outer(periods, poles)), (times, weights, forces, periods))


def _joined(
    within: Real, motion: Complex, impulse: Complex, turn: Complex, nodes: tuple[Real, Real, Real, Real]
) -> PeriodOperator:
    """Real matrices from those of the upper half of the poles."""
    impulse = impulse * turn[:, :, None]
    diagonal = np.eye(turn.shape[1])
    real, imaginary = turn.real[:, :, None] * diagonal, turn.imag[:, :, None] * diagonal
    free = np.concatenate(
        [np.concatenate([real, -imaginary], axis=2), np.concatenate([imaginary, real], axis=2)], axis=1
    )
    return PeriodOperator(
        within,
        2 * np.concatenate([motion.real, -motion.imag], axis=2),
        np.concatenate([impulse.real, impulse.imag], axis=1),
        free,
        *nodes,
    )


@dataclass(frozen=True)
class _Block:
    """One piece on its own; ``decay`` and ``impulse`` are from its beginning and to its end."""

    within: Real
    decay: Complex
    impulse: Complex
    times: Real
    weights: Real
    forces: Real


def _piece(system: DelaySystem, periods: Real, piece: Piece, count: int) -> _Block:
    nodes, weight, derivative = radau_nodes(count)
    pitch = 2 * np.pi / system.process.teeth
    share = (piece.end - piece.begin) / pitch
    half = share * periods / 2
    angles = (piece.end - piece.begin) / 2 * (nodes + 1)
    teeth = len(piece.immersions)
    immersions = np.concatenate([phi + angles for phi in piece.immersions])
    forces = system.process.ktc * force_direction(system.process, immersions)
    chips = chip_direction(system.process, immersions)
    poles = system.poles
    turning = derivative - (half[:, None] * poles)[:, :, None, None] * np.eye(count)
    inverse = np.linalg.inv(turning) * half[:, None, None, None]  # (n_speeds, n_modes, count, count)
    pushed = np.einsum("rd,nd->rn", system.left, forces)
    seen = np.einsum("nd,rd->nr", chips, system.right)
    seen_by_tooth, pushed_by_tooth = seen.reshape(teeth, count, -1), pushed.reshape(-1, teeth, count)
    within = 2 * np.real(
        np.einsum("tir,srij,ruj->stiuj", seen_by_tooth, inverse, pushed_by_tooth, optimize=True)
    ).reshape(len(periods), teeth * count, teeth * count)
    if system.upper.any():
        same = np.tile(np.eye(count), (teeth, teeth))
        within = within + same * (chips @ system.upper @ forces.T)
    ring = np.exp(half[:, None, None] * (nodes + 1)[:, None] * poles)
    decay = seen * np.tile(ring, (1, teeth, 1))
    impulse = np.tile(inverse[:, :, -1, :], (1, 1, teeth)) * pushed
    times = np.tile(piece.begin / pitch + share / 2 * (nodes + 1), teeth)
    return _Block(within, decay, impulse, times, np.tile(weight * share / 2, teeth), forces)


@dataclass(frozen=True)
class LoopGain:
    """The operator whose eigenvalue is 1 / depth where a cut is on the boundary of stability.

    A motion that is multiplied by ``mu = exp(i theta)`` each tooth period has ``h = (1 - 1 / mu) y`` and
    ``z = (mu - Phi)^-1 a S h``; put into ``y = E z + a G h`` this is

    ``h / a = (1 - 1 / mu) [G + E (mu - Phi)^-1 S] h``,

    so all depths at which a multiplier is on the unit circle come out of eigenvalues over theta in (0, pi], without
    a grid of depths, exactly as in the zero-order solution but with the coefficients as they vary.

    Parameters
    ----------
    operator
        One tooth period at several speeds.
    """

    operator: PeriodOperator

    def matrices(self, speeds: NDArray[np.int64], theta: Real) -> Complex:
        """The operator for each pair of speed index and theta, shape (n_pairs, n, n), 1/m."""
        multiplier = np.exp(1j * theta)[:, None, None]
        size = self.operator.free.shape[-1]
        carried = np.linalg.solve(multiplier * np.eye(size) - self.operator.free[speeds], self.operator.impulse[speeds])
        return np.asarray(
            (1 - 1 / multiplier) * (self.operator.within[speeds] + self.operator.motion[speeds] @ carried)
        )

    def eigenvalues(self, speeds: NDArray[np.int64], theta: Real) -> Complex:
        """Eigenvalues, largest first, shape (n_pairs, n), 1/m."""
        values = np.linalg.eigvals(self.matrices(speeds, theta))
        order = np.argsort(-np.abs(values), axis=1)
        return np.asarray(np.take_along_axis(values, order, axis=1))
