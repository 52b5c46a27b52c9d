"""Which postures to measure next: those that take most from the variance of the lowest modes' peaks."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from foundation import InputError

from .conditioned import conditioned, distances_to
from .learning import LearnedPostures
from .modes import ModalBasis, PosturePlace, basis_at, corrected_modes
from .posture_kernels import squared_distances
from .process_covariance import covariance_parts
from .process_rows import DAMPING, FREQUENCY, SHAPE, Rows, joined, linear_mode_rows, unknown_rows

Real = NDArray[np.float64]

LOWEST = 3
"""Modes whose peaks matter: on a robot the lowest ones limit the depth of a cut."""

MEASURABLE = 6
"""Modes that a measurement is expected to give at most."""


@dataclass(frozen=True)
class ChosenPosture:
    """A posture to measure, and what it is expected to be worth.

    Parameters
    ----------
    driven : (n_active,), rad or m
        Driven joint values.
    before, after
        Standard error of the logarithm of the lowest modes' peak receptance over the targets (root of the mean
        square), before and after this posture and those chosen before it are measured; without scatter.
    """

    driven: Real
    before: float
    after: float


@dataclass(frozen=True)
class _Posed:
    """Rows of one posture, and where it lies."""

    rows: Rows
    place: PosturePlace


def choose_postures(
    learned: LearnedPostures, candidates: Real, targets: Real, count: int = 1
) -> tuple[ChosenPosture, ...]:
    """Choose postures one after the other so that the targets' variance falls most (Krause et al., JMLR 9, 2008).

    The peak receptance of a light mode is ``|phi|^2 / (2 zeta w^2)``, and the smallest depth limit over spindle speeds
    goes as its inverse. Its logarithm is a linear form of the process, so that the variance after a measurement does
    not depend on what will be measured: ``C_tt - C_tc (C_cc + N)^-1 C_ct`` given the measurements so far.

    Parameters
    ----------
    learned
        Process over postures.
    candidates : (n_candidates, n_active), rad or m
        Postures that can be measured.
    targets : (n_targets, n_active), rad or m
        Postures whose predictions matter.
    count
        Number of postures to choose.

    Raises
    ------
    InputError
        Fewer candidates than postures to choose, or no target.
    """
    if not 1 <= count <= len(candidates) or not len(targets):
        raise InputError(f"{count} postures of {len(candidates)} candidates for {len(targets)} targets; give more")
    wanted = [_posed(learned, q, LOWEST) for q in targets]
    forms = [_peak_forms(one.rows) for one in wanted]
    offered = [_posed(learned, q, MEASURABLE, noise=True) for q in candidates]
    rows, places = learned.evidence.rows, list(learned.places)
    chosen: list[ChosenPosture] = []
    left = list(range(len(offered)))
    while len(chosen) < count:
        before, gains = _gains(learned, rows, places, wanted, forms, [offered[i] for i in left])
        best = left.pop(int(np.argmax(gains)))
        after = float(np.sqrt(max(before - float(np.max(gains)), 0.0)))
        chosen.append(ChosenPosture(np.asarray(candidates[best]), float(np.sqrt(before)), after))
        rows, places = joined([rows, _at(offered[best].rows, len(places))]), [*places, offered[best].place]
    return tuple(chosen)


def _posed(learned: LearnedPostures, driven: Real, most: int, noise: bool = False) -> _Posed:
    """Rows of the lowest modes of a posture, linear about the expected unknowns; with the noise that is usual."""
    basis, place = basis_at(learned.robot, driven)
    unknown = _expected(learned, basis, place)
    modes = corrected_modes(basis, *unknown)
    top = 2 * np.pi * 1.05 * max(float(one.frequencies.max()) for one in learned.measured)
    count = max(1, min(most, int(np.sum(modes.natural < top))))
    rows = joined([linear_mode_rows(0, basis, modes, r, np.eye(3), unknown) for r in range(count)])
    usual = np.median(np.vstack([one.errors for one in learned.measured]), axis=0)
    kinds = {FREQUENCY: usual[0], DAMPING: usual[1], SHAPE: usual[2]}
    errors = np.array([kinds[int(kind)] for kind in rows.kind]) if noise else np.zeros(len(rows))
    return _Posed(Rows(**{**vars(rows), "noise": errors}), place)


def _expected(learned: LearnedPostures, basis: ModalBasis, place: PosturePlace) -> tuple[Real, Real]:
    n, m = len(basis.stiffness), len(basis.mass)
    middle = conditioned(learned.evidence, learned.best)
    mean = middle.given(unknown_rows(0, n, m), *distances_to(learned, [place]))[0]
    return mean[:n], mean[n : n + m]


def _peak_forms(rows: Rows) -> Real:
    """Logarithm of each mode's peak over its rows, (n_modes, n_rows): ``2 d|phi| / |phi| - d zeta - 2 d w``."""
    starts = np.flatnonzero(rows.kind == FREQUENCY)
    forms = np.zeros((len(starts), len(rows)))
    for mode, start in enumerate(starts):
        forms[mode, start : start + 2] = -2.0, -1.0
        forms[mode, start + 2 : start + 5] = 2 * rows.motion[start + 2]
    return forms


def _gains(
    learned: LearnedPostures,
    rows: Rows,
    places: list[PosturePlace],
    wanted: Sequence[_Posed],
    forms: Sequence[Real],
    offered: Sequence[_Posed],
) -> tuple[float, Real]:
    """Mean variance of the targets' peaks given the rows so far, and how much each candidate takes from it."""
    whole = _covariance(learned, rows, rows, places, places, same=True)
    factor = cho_factor(whole + np.diag(rows.noise**2), lower=True)
    targets = joined([_at(one.rows, i) for i, one in enumerate(wanted)])
    at = [one.place for one in wanted]
    form = np.zeros((sum(len(one) for one in forms), len(targets)))
    row = column = 0
    for one in forms:
        form[row : row + len(one), column : column + one.shape[1]] = one
        row, column = row + len(one), column + one.shape[1]
    across = form @ _covariance(learned, targets, rows, at, places)
    pulled = cho_solve(factor, across.T)
    own = form @ _covariance(learned, targets, targets, at, at) @ form.T
    before = float(np.mean(np.diag(own) - np.sum(across * pulled.T, axis=1)))
    gains = []
    for candidate in offered:
        there, seen = [candidate.place], candidate.rows
        to_known = _covariance(learned, seen, rows, there, places)
        spread = _covariance(learned, seen, seen, there, there, same=True) + np.diag(seen.noise**2)
        spread = spread - to_known @ cho_solve(factor, to_known.T)
        cross = form @ _covariance(learned, targets, seen, at, there) - pulled.T @ to_known.T
        gains.append(float(np.sum(cross * np.linalg.solve(spread, cross.T).T)) / len(form))
    return before, np.array(gains)


def _covariance(
    learned: LearnedPostures,
    first: Rows,
    second: Rows,
    at: list[PosturePlace],
    there: list[PosturePlace],
    same: bool = False,
) -> Real:
    distances = squared_distances(learned.metric, at, there)
    parts = covariance_parts(first, second, distances, float(np.exp(learned.best[-1])), same)
    return np.asarray(np.tensordot(np.exp(2 * learned.best[:-1]), parts, 1))


def _at(rows: Rows, posture: int) -> Rows:
    return Rows(**{**vars(rows), "posture": np.full(len(rows), posture)})
