"""Leave-one-posture-out checks, and the postures that are most informative to measure next."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import InputError, Real

from .learning import LearnedPostures, assembled
from .measured_modes import KNOWN, MeasuredModes, mode_pairs
from .modal_basis import ModalBasis, PosturePlace, basis_at, corrected_modes
from .predicting import PredictedPosture, conditioned, distances_to, predict_posture
from .process import covariance_parts, squared_distances
from .process_rows import DAMPING, FREQUENCY, SHAPE, Rows, joined, linear_mode_rows, unknown_rows

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
    factor = scipy.linalg.cho_factor(whole + np.diag(rows.noise**2), lower=True)
    targets = joined([_at(one.rows, i) for i, one in enumerate(wanted)])
    at = [one.place for one in wanted]
    form = np.zeros((sum(len(one) for one in forms), len(targets)))
    row = column = 0
    for one in forms:
        form[row : row + len(one), column : column + one.shape[1]] = one
        row, column = row + len(one), column + one.shape[1]
    across = form @ _covariance(learned, targets, rows, at, places)
    pulled = scipy.linalg.cho_solve(factor, across.T)
    own = form @ _covariance(learned, targets, targets, at, at) @ form.T
    before = float(np.mean(np.diag(own) - np.sum(across * pulled.T, axis=1)))
    gains = []
    for candidate in offered:
        there, seen = [candidate.place], candidate.rows
        to_known = _covariance(learned, seen, rows, there, places)
        spread = _covariance(learned, seen, seen, there, there, same=True) + np.diag(seen.noise**2)
        spread = spread - to_known @ scipy.linalg.cho_solve(factor, to_known.T)
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


LEAST = 3
"""Postures without which leaving one out says nothing."""

SAME_POSTURE = 1e-3
"""Difference of joint values (rad, m) up to which two measurements are of one posture, and are left out together."""


@dataclass(frozen=True)
class LeftOutPosture:
    """One measured posture beside what the others predict.

    Parameters
    ----------
    name
        Name of the measurement.
    errors : (n_modes, 2)
        Logarithms of measured over predicted frequency and damping ratio.
    held : (n_modes, 2), bool
        Whether the 95 % band, widened by the measurement's own error, holds them.
    measured : (n_modes, 2)
        Measured natural frequency (Hz) and damping ratio of the modes that have a predicted partner.
    low, high : (n_modes, 2)
        Ends of that band.
    """

    name: str
    errors: Real
    held: NDArray[np.bool_]
    measured: Real
    low: Real
    high: Real


def left_out_postures(learned: LearnedPostures, samples: int = 120) -> tuple[LeftOutPosture, ...]:
    """Predict every measured posture from the others; empty for fewer than three postures.

    All measurements of one posture are left out together: what a repeat says of its posture is no prediction.

    The hyperparameters and the point of linearisation stay those of all postures; measurements do not.

    Parameters
    ----------
    learned
        Process over postures.
    samples
        Number of models to draw for each posture.
    """
    groups = _of_one_posture(learned)
    if len(groups) < LEAST:
        return ()
    found = {p: one for group in groups for p, one in zip(group, _left_out(learned, group, samples), strict=True)}
    return tuple(found[p] for p in sorted(found))


def _of_one_posture(learned: LearnedPostures) -> list[list[int]]:
    """Numbers of the measurements of each posture."""
    groups: list[list[int]] = []
    for p, one in enumerate(learned.measured):
        for group in groups:
            if np.abs(learned.measured[group[0]].driven - one.driven).max() <= SAME_POSTURE:
                group.append(p)
                break
        else:
            groups.append([p])
    return groups


def _left_out(learned: LearnedPostures, group: list[int], samples: int) -> list[LeftOutPosture]:
    kept = [p for p in range(len(learned.measured)) if p not in group]
    others = assembled(
        learned.robot,
        [learned.measured[p] for p in kept],
        tuple(learned.pairs[p] for p in kept),
        (learned.best, learned.draws),
        (learned.stiffness[kept], learned.mass),
    )
    found = predict_posture(others, learned.measured[group[0]].driven, samples=samples)
    return [_beside(learned.measured[number], number, found) for number in group]


def _beside(one: MeasuredModes, number: int, found: PredictedPosture) -> LeftOutPosture:
    """One measurement beside the prediction of its posture."""
    model = found.model
    moved = model.right.real @ one.directions.T
    pairs = mode_pairs(one.frequencies, one.shapes, model.natural_frequencies, moved, KNOWN)
    rng = np.random.default_rng(number)
    rows = []
    drawn = np.array([[draw.natural_frequencies, draw.damping_ratios] for draw in found.draws])
    for i, r in pairs:
        measured = np.log([one.frequencies[i], one.damping[i]])
        seen = np.log(drawn[:, :, r]) + one.errors[i, :2] * rng.normal(size=(len(drawn), 2))
        low, high = np.quantile(seen, [0.025, 0.975], axis=0)
        rows.append((measured - seen.mean(axis=0), measured, low, high))
    errors, measured, low, high = np.array(rows).reshape(-1, 4, 2).transpose(1, 0, 2)
    held = (low <= measured) & (measured <= high)
    return LeftOutPosture(one.name, errors, held, np.exp(measured), np.exp(low), np.exp(high))
