"""Homogeneity: whether the FRF stays the same from one level of the forces to another."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from .cut_periods import SteadyPeriods, same_forces
from .line_tests import ratio_p_values, standing_out, together
from .linear_part import LinearApproximation, linear_approximation

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@dataclass(frozen=True)
class Homogeneity:
    """FRFs of two levels beside each other.

    Parameters
    ----------
    frequencies : (n_lines,), Hz
        Lines that both levels excite.
    first, second : (n_lines, n_responses, n_excitations)
        FRF at either level.
    levels : N
        Root mean square of the forces at either level.
    line_p_values : (n_lines, n_responses)
        Probability of a difference as large by the uncertainty of both.
    p_values : (n_responses,)
        The same of all lines together.
    differing : (n_lines, n_responses)
        Lines that differ; among them 5 % by chance.
    change : (n_responses,)
        Root mean square difference over root mean square FRF, uncertainty taken off.
    largest : (n_responses,), Hz
        Line of the largest difference.
    statement
        One sentence that says which uncertainty was counted.
    """

    frequencies: Real
    first: Complex
    second: Complex
    levels: tuple[float, float]
    line_p_values: Real
    p_values: Real
    differing: NDArray[np.bool_]
    change: Real
    largest: Real
    statement: str


def homogeneity(first: SteadyPeriods, second: SteadyPeriods) -> Homogeneity:
    """Test whether two levels have the same FRF.

    At each line and response ``d^H (C_1 + C_2)^-1 d / m ~ F(2 m, 2 v)`` with the difference d of the m entries of a
    row, the covariances C of both, and v degrees of freedom (Welch, Biometrika 34, 28, 1947). Where both levels play
    the same realisation, C is that of noise alone: what a nonlinearity adds by chance is the same for a homogeneous
    structure. Else it holds the stochastic contributions, if there are realisations enough to tell them.

    Parameters
    ----------
    first, second
        Steady periods of either level, of the same channels, rate and period.

    Raises
    ------
    InputError
        Unlike channels, or no line that both excite.
    """
    if (first.excitations, first.responses) != (second.excitations, second.responses):
        raise InputError("levels of different channels cannot be compared; give the same channels in the same order")
    one, other = linear_approximation(first), linear_approximation(second)
    same = len(first.realisations) == len(second.realisations) and all(
        same_forces(a, b) for a, b in zip(first.realisations, second.realisations, strict=True)
    )
    here, there = _common(one, other)
    delta = other.frf.values[there] - one.frf.values[here]
    pieces = [_uncertainty(each, lines, same) for each, lines in ((one, here), (other, there))]
    n, m = delta.shape[1:]
    line_p, variance = np.empty(delta.shape[:2]), np.empty(delta.shape[:2])
    for p in range(n):
        rows = [own[:, p, p].real[:, None, None] * excitation for own, excitation, _ in pieces]
        traces = [np.einsum("kqq->k", row).real for row in rows]
        freedom = sum(traces) ** 2 / np.maximum(
            sum(t**2 / v for t, (_, _, v) in zip(traces, pieces, strict=True)), 1e-300
        )
        size = np.linalg.solve(rows[0] + rows[1], delta[:, p, :, None])[:, :, 0]
        ratio = np.einsum("kq,kq->k", delta[:, p].conj(), size).real / m
        line_p[:, p], variance[:, p] = ratio_p_values(ratio, m, freedom), traces[0] + traces[1]
    difference = np.sum(np.abs(delta) ** 2, axis=2)
    whole = np.maximum(np.sum(np.abs(one.frf.values[here]) ** 2, axis=(0, 2)), 1e-300)
    counted = "noise alone, because both play the same realisation" if same else _counted(one, other)
    return Homogeneity(
        one.frf.frequencies[here],
        one.frf.values[here],
        other.frf.values[there],
        (one.level, other.level),
        line_p,
        np.array([together(line_p[:, p]) for p in range(n)]),
        np.stack([standing_out(line_p[:, p]) for p in range(n)], axis=1),
        np.sqrt(np.maximum(np.sum(difference - variance, axis=0), 0.0) / whole),
        one.frf.frequencies[here][np.argmax(difference, axis=0)],
        f"{len(here)} lines that both levels excite; the uncertainty is that of {counted}.",
    )


def _common(one: LinearApproximation, other: LinearApproximation) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Lines that both have, as indices of either."""
    a, b = (each.frf.frequencies for each in (one, other))
    nearest = np.clip(np.searchsorted(b, a - 1e-9 * a), 0, len(b) - 1)
    shared = (np.abs(b[nearest] - a) < 1e-6 * a) & one.frf.valid & other.frf.valid[nearest]
    if not shared.any():
        raise InputError("the levels excite no line in common; play the same lines at both")
    return np.flatnonzero(shared), nearest[shared]


def _uncertainty(linear: LinearApproximation, lines: NDArray[np.int64], same: bool) -> tuple[Complex, Complex, int]:
    """Covariance of the residual, factor of the excitation, degrees of freedom."""
    if same or linear.total is None:
        return linear.noise[lines], linear.excitation[lines], linear.noise_freedom
    return linear.total[lines], linear.excitation[lines], linear.total_freedom


def _counted(one: LinearApproximation, other: LinearApproximation) -> str:
    if one.total is None or other.total is None:
        return "noise alone, because one realisation does not tell its stochastic contributions: these count as change"
    return "noise and of stochastic contributions between realisations"
