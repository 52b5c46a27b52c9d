"""Leave-one-posture-out checks, and the postures that are most informative to measure next."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import InputError, Real

from ..settings import POSTURES
from .learning import LearnedPostures, assembled
from .modal_basis import MeasuredModes, PosturePlace, basis_at, corrected_modes, mode_pairs
from .predicting import PredictedPosture, conditioned, distances_to, predict_posture
from .process import (
    DAMPING,
    FREQUENCY,
    SHAPE,
    Rows,
    covariance,
    joined,
    linear_mode_rows,
    squared_distances,
    unknown_rows,
)


@dataclass(frozen=True)
class ChosenPosture:
    """A posture to measure, with the errors that are expected before and after its measurement.

    An error is the expected error of the logarithm of the lowest modes' peak receptance, root mean square over the
    target postures, without scatter. ``after`` assumes that this posture is measured in addition to all postures that
    were chosen earlier.
    """

    driven: Real  # (n_active,), rad or m: driven joint values
    before: float  # standard error
    after: float  # standard error


@dataclass(frozen=True)
class _PosedRows:
    rows: Rows
    place: PosturePlace


def choose_postures(
    learned: LearnedPostures, candidates: Real, targets: Real, count: int = 1
) -> tuple[ChosenPosture, ...]:
    """Choose postures one after the other so that the targets' variance falls most (Krause et al., JMLR 9, 2008).

    The peak receptance of a lightly damped mode is ``|phi|^2 / (2 zeta w^2)``, and the smallest depth limit over
    spindle speeds is proportional to its inverse. Its logarithm is a linear form of the process, so that the variance
    after a measurement does not depend on the measured values: ``C_tt - C_tc (C_cc + N)^-1 C_ct`` given the
    measurements so far.

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
    target_rows = [_posed_rows(learned, q, POSTURES.n_lowest) for q in targets]
    options = [_posed_rows(learned, q, POSTURES.n_measurable, noise=True) for q in candidates]
    rows, places = learned.evidence.rows, list(learned.places)
    chosen: list[ChosenPosture] = []
    remaining = list(range(len(options)))
    while len(chosen) < count:
        before, gains = _gains(learned, rows, places, target_rows, [options[i] for i in remaining])
        best = remaining.pop(int(np.argmax(gains)))
        after = float(np.sqrt(max(before - float(np.max(gains)), 0.0)))
        chosen.append(ChosenPosture(np.asarray(candidates[best]), float(np.sqrt(before)), after))
        rows, places = joined([rows, _in_posture(options[best].rows, len(places))]), [*places, options[best].place]
    return tuple(chosen)


def _posed_rows(learned: LearnedPostures, driven: Real, most: int, noise: bool = False) -> _PosedRows:
    """Build rows for up to ``most`` lowest modes of a posture, linearised at the expected unknowns.

    With ``noise``, the rows have the median errors of the measurements; otherwise they have none.
    """
    basis, place = basis_at(learned.robot, driven)
    n, m = len(basis.stiffness), len(basis.mass)
    process = conditioned(learned.evidence, learned.best)
    mean = process.predict(unknown_rows(0, n, m), *distances_to(learned, place))[0]
    unknowns = mean[:n], mean[n : n + m]
    modes = corrected_modes(basis, *unknowns)
    highest = 2 * np.pi * 1.05 * max(float(case.frequencies.max()) for case in learned.measured)
    count = max(1, min(most, int(np.sum(modes.natural < highest))))
    rows = joined([linear_mode_rows(0, basis, modes, r, np.eye(3), unknowns) for r in range(count)])
    median = np.median(np.vstack([case.errors for case in learned.measured]), axis=0)
    kinds = {FREQUENCY: median[0], DAMPING: median[1], SHAPE: median[2]}
    errors = np.array([kinds[int(kind)] for kind in rows.kind]) if noise else np.zeros(len(rows))
    return _PosedRows(replace(rows, noise=errors), place)


def _peak_forms(rows: Rows) -> Real:
    """Return the matrix from rows to the logarithm of each mode's peak receptance, (n_modes, n_rows).

    The change of that logarithm is ``2 d|phi| / |phi| - d log zeta - 2 d log w``.
    """
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
    targets: Sequence[_PosedRows],
    candidates: Sequence[_PosedRows],
) -> tuple[float, Real]:
    """Compute the mean variance of the targets' peaks given ``rows``, and its reduction by each candidate."""

    def between(
        first: Rows, at: list[PosturePlace], second: Rows, other: list[PosturePlace], same: bool = False
    ) -> Real:
        return covariance(learned.best, first, second, squared_distances(learned.metric, at, other), same=same)

    measured = between(rows, places, rows, places, same=True) + np.diag(rows.noise**2)
    factor = scipy.linalg.cho_factor(measured, lower=True)
    target_rows = joined([_in_posture(target.rows, i) for i, target in enumerate(targets)])
    target_places = [target.place for target in targets]
    forms = scipy.linalg.block_diag(*(_peak_forms(target.rows) for target in targets))
    cross = forms @ between(target_rows, target_places, rows, places)
    weights = scipy.linalg.cho_solve(factor, cross.T)
    prior = forms @ between(target_rows, target_places, target_rows, target_places) @ forms.T
    before = float(np.mean(np.diag(prior) - np.sum(cross * weights.T, axis=1)))
    gains = []
    for candidate in candidates:
        # covariances of the candidate and of the targets with it, conditioned on the measurements so far
        place, new = [candidate.place], candidate.rows
        to_measured = between(new, place, rows, places)
        spread = between(new, place, new, place, same=True) + np.diag(new.noise**2)
        spread = spread - to_measured @ scipy.linalg.cho_solve(factor, to_measured.T)
        to_targets = forms @ between(target_rows, target_places, new, place) - weights.T @ to_measured.T
        gains.append(float(np.sum(to_targets * np.linalg.solve(spread, to_targets.T).T)) / len(forms))
    return before, np.array(gains)


def _in_posture(rows: Rows, posture: int) -> Rows:
    return replace(rows, posture=np.full(len(rows), posture))


@dataclass(frozen=True)
class LeftOutPosture:
    """Modes measured in one posture compared with their prediction from all other postures.

    Parameters
    ----------
    name
        Name of the measurement.
    errors : (n_modes, 2)
        Logarithms of measured over predicted frequency and damping ratio.
    held : (n_modes, 2), bool
        Whether the measured values lie in the predicted 95 % band, which includes the error of the measurement.
    measured : (n_modes, 2)
        Measured natural frequency (Hz) and damping ratio of the modes that have a predicted partner.
    low, high : (n_modes, 2)
        Lower and upper end of the predicted 95 % band.
    """

    name: str
    errors: Real
    held: NDArray[np.bool_]
    measured: Real
    low: Real
    high: Real


def left_out_postures(learned: LearnedPostures) -> tuple[LeftOutPosture, ...]:
    """Predict every measured posture from all other postures; return an empty tuple for fewer than three postures.

    All measurements of one posture are left out together, because a repeated measurement does not test the prediction.
    Hyperparameters and the point of linearisation are not determined again without them.

    Parameters
    ----------
    learned
        Process over postures.
    """
    groups = _same_postures(learned)
    if len(groups) < POSTURES.fewest_left_out:
        return ()
    results = {p: result for group in groups for p, result in zip(group, _left_out(learned, group), strict=True)}
    return tuple(results[p] for p in sorted(results))


def _same_postures(learned: LearnedPostures) -> list[list[int]]:
    """Group the indices of measurements that were made in the same posture."""
    groups: list[list[int]] = []
    for p, case in enumerate(learned.measured):
        for group in groups:
            if np.abs(learned.measured[group[0]].driven - case.driven).max() <= POSTURES.same_posture:
                group.append(p)
                break
        else:
            groups.append([p])
    return groups


def _left_out(learned: LearnedPostures, group: list[int]) -> list[LeftOutPosture]:
    used = [p for p in range(len(learned.measured)) if p not in group]
    others = assembled(
        learned.robot,
        [learned.measured[p] for p in used],
        tuple(learned.pairs[p] for p in used),
        (learned.best, learned.draws),
        (learned.stiffness[used], learned.mass),
    )
    predicted = predict_posture(others, learned.measured[group[0]].driven, samples=120)
    return [_compared(learned.measured[p], predicted, np.random.default_rng(p)) for p in group]


def _compared(measured: MeasuredModes, predicted: PredictedPosture, rng: np.random.Generator) -> LeftOutPosture:
    model = predicted.model
    shapes = model.right.real @ measured.directions.T
    pairs = mode_pairs(
        measured.frequencies, measured.shapes, model.natural_frequencies, shapes, POSTURES.learned_pairing_scales
    )
    drawn = np.array([[draw.natural_frequencies, draw.damping_ratios] for draw in predicted.draws])
    rows = []
    for i, r in pairs:
        values = np.log([measured.frequencies[i], measured.damping[i]])
        expected = np.log(drawn[:, :, r]) + measured.errors[i, :2] * rng.normal(size=(len(drawn), 2))
        low, high = np.quantile(expected, [0.025, 0.975], axis=0)
        rows.append((values - expected.mean(axis=0), values, low, high))
    # the reshape keeps the columns of a measurement without pairs
    errors, logarithms, low, high = np.array(rows).reshape(-1, 4, 2).transpose(1, 0, 2)
    covered = (low <= logarithms) & (logarithms <= high)
    return LeftOutPosture(measured.name, errors, covered, np.exp(logarithms), np.exp(low), np.exp(high))
