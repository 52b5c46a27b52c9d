"""One tooth period of a cut with straight edges at equal pitch as matrices: spectral collocation."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from millfrf.core import Complex, Index, InputError, Real
from millfrf.cutting import chip_direction, force_direction

from ..milling_loop import DelaySystem, Piece, engagement_pieces
from ..settings import SETTINGS


@dataclass(frozen=True)
class PeriodOperator:
    """Matrices that describe how the chip thickness moves the tool within one period, at several speeds.

    With the regenerated chip h at the nodes, the structure's state z = (Re q, Im q) at the beginning of the period and
    the depth a, the tool moves along the chip by ``y = E z + a G h``, and the next state is ``z_next = Phi z + a S h``.
    """

    within: Real  # G (n_speeds, n_nodes, n_nodes), nearly triangular: a chip acts only later
    motion: Real  # E (n_speeds, n_nodes, 2 n_modes): motion along the chip for a unit of each modal coordinate
    impulse: Real  # S (n_speeds, 2 n_modes, n_nodes): state at the period's end for a unit chip at each node
    free: Real  # Phi (n_speeds, 2 n_modes, 2 n_modes): transition of the structure without cutting
    times: Real  # (n_nodes,), in periods
    weights: Real  # (n_nodes,), of the quadrature over the period, in periods
    forces: Real  # (n_nodes, 3), Pa: force per unit depth and chip
    periods: Real  # (n_speeds,), s: tooth period


@cache
def radau_nodes(count: int) -> tuple[Real, Real, Real]:
    """Compute n Radau nodes in (-1, 1], quadrature weights, and the derivative matrix of functions that vanish at -1.

    The nodes are the zeros of ``P_(n-1) - P_n``, the last of them 1. They are as accurate as Chebyshev's, and the value
    at the end of a piece converges twice as fast (Hairer & Wanner, Solving ODEs II, section IV.5; Trefethen, Spectral
    Methods in MATLAB, chapter 6, for the barycentric derivative).

    Examples
    --------
    >>> nodes, weights, derivative = radau_nodes(2)
    >>> nodes.round(6).tolist(), weights.round(6).tolist(), derivative.shape
    ([-0.333333, 1.0], [1.5, 0.5], (2, 2))
    """
    legendre = np.polynomial.legendre
    series = np.zeros(count + 1)
    series[count - 1], series[count] = 1.0, -1.0
    nodes = np.sort(np.real(legendre.legroots(series)))
    for _ in range(2):  # eigenvalues are not right to the last digit; Newton's steps are
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
    # products of many small gaps would underflow, so that their logarithms are added
    logs = np.log(np.abs(gaps)).sum(axis=1)
    signs = np.sign(gaps).prod(axis=1)
    ratio = (signs[:, None] * signs) * np.exp(logs[:, None] - logs)
    derivative = ratio / gaps
    np.fill_diagonal(derivative, 0.0)
    np.fill_diagonal(derivative, -derivative.sum(axis=1))
    return nodes, weights, derivative[1:, 1:]


def piece_nodes(system: DelaySystem, periods: Real, *, extra: int = 0) -> list[tuple[Piece, int]]:
    """Divide the period into pieces, each with the number of nodes that it needs at the longest of ``periods``.

    In a piece the phase of the fastest mode advances by at most 24 rad; more advance requires more nodes.
    """
    fastest = float(np.abs(system.poles).max()) * float(periods.max()) * system.process.teeth / (2 * np.pi)
    result = []
    for whole_piece in engagement_pieces(system.process):
        turn = fastest * (whole_piece.end - whole_piece.begin)
        pieces = max(1, int(np.ceil(turn / 24)))
        count = 14 + extra + int(np.ceil(0.62 * turn / pieces))
        result += [(piece, count) for piece in whole_piece.split(pieces)]
    total = sum(count * len(piece.immersions) for piece, count in result)
    if total > SETTINGS.most_nodes:
        raise InputError(
            f"{total} nodes a tooth period at {2 * np.pi / (system.process.teeth * periods.max()):.4g} rad/s: the "
            "modes turn too often between two teeth; leave out the highest modes, or raise the speed"
        )
    return result


def period_operator(system: DelaySystem, periods: Real, *, extra: int = 0) -> PeriodOperator:
    """Discretise one tooth period at several tooth periods (n_speeds,), s, all with the nodes of the longest.

    On each piece ``v' = p v + force`` is collocated for every pole. A tooth's force has rank one, so that the unknown
    is one chip thickness per node, not the whole state, and its size does not grow with the modes. ``extra`` nodes in
    each piece show the discretisation error.
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
        rows = slice(start, start + count * len(piece.immersions))
        begin, end = piece.begin / pitch * periods, piece.end / pitch * periods
        times[rows], weights[rows], forces[rows] = block.times, block.weights, block.forces
        motion[:, rows] = block.decay * np.exp(np.outer(begin, poles))[:, None, :]
        # the vibration that earlier pieces caused, referred to the period's beginning, continues in this piece
        within[:, rows, :start] = 2 * np.real(motion[:, rows] @ impulse[:, :, :start])
        within[:, rows, rows] = block.within
        impulse[:, :, rows] = block.impulse * np.exp(-np.outer(end, poles))[:, :, None]
    turn = np.exp(np.outer(periods, poles))
    impulse = impulse * turn[:, :, None]
    diagonal = np.eye(n_modes)
    real, imaginary = turn.real[:, :, None] * diagonal, turn.imag[:, :, None] * diagonal
    return PeriodOperator(
        within,
        2 * np.concatenate([motion.real, -motion.imag], axis=2),
        np.concatenate([impulse.real, impulse.imag], axis=1),
        np.block([[real, -imaginary], [imaginary, real]]),
        times,
        weights,
        forces,
        periods,
    )


@dataclass(frozen=True)
class _Block:
    """Arrays of a single piece, named as in `PeriodOperator` but from the beginning to the end of the piece."""

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
    modal_force = np.einsum("rd,nd->rn", system.left, forces)  # per chip at each node
    modal_chip = np.einsum("nd,rd->nr", chips, system.right)  # at each node per modal coordinate
    chip_by_tooth, force_by_tooth = modal_chip.reshape(teeth, count, -1), modal_force.reshape(-1, teeth, count)
    within = 2 * np.real(
        np.einsum("tir,srij,ruj->stiuj", chip_by_tooth, inverse, force_by_tooth, optimize=True)
    ).reshape(len(periods), teeth * count, teeth * count)
    if system.upper.any():
        same_instant = np.tile(np.eye(count), (teeth, teeth))
        within = within + same_instant * (chips @ system.upper @ forces.T)
    ring = np.exp(half[:, None, None] * (nodes + 1)[:, None] * poles)
    decay = modal_chip * np.tile(ring, (1, teeth, 1))
    impulse = np.tile(inverse[:, :, -1, :], (1, 1, teeth)) * modal_force
    times = np.tile(piece.begin / pitch + share / 2 * (nodes + 1), teeth)
    return _Block(within, decay, impulse, times, np.tile(weight * share / 2, teeth), forces)


@dataclass(frozen=True)
class LoopGain:
    """The operator that has the eigenvalue 1 / depth if a cut is on the boundary of stability.

    A motion that is multiplied by ``mu = exp(i theta)`` each tooth period has ``h = (1 - 1 / mu) y`` and
    ``z = (mu - Phi)^-1 a S h``. Inserted into ``y = E z + a G h`` this is

    ``h / a = (1 - 1 / mu) [G + E (mu - Phi)^-1 S] h``.

    All depths at which a multiplier is on the unit circle are reciprocal eigenvalues for theta in (0, pi]; no grid of
    depths is needed. The method is the zero-order solution with coefficients that vary over the period.
    """

    operator: PeriodOperator

    def eigenvalues(self, speeds: Index, theta: Real) -> Complex:
        """Compute eigenvalues, largest first, for pairs of speed index and theta, (n_pairs, n), 1/m."""
        multiplier = np.exp(1j * theta)[:, None, None]
        size = self.operator.free.shape[-1]
        carried = np.linalg.solve(multiplier * np.eye(size) - self.operator.free[speeds], self.operator.impulse[speeds])
        gain = (1 - 1 / multiplier) * (self.operator.within[speeds] + self.operator.motion[speeds] @ carried)
        return largest_first(np.linalg.eigvals(gain))


def largest_first(values: Complex) -> Complex:
    """Sort eigenvalues (n, size) in each row by falling modulus."""
    return np.asarray(np.take_along_axis(values, np.argsort(-np.abs(values), axis=1), axis=1))
