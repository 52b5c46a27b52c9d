"""Learning from modal models measured in some postures: the most probable unknowns."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import InputError, Real

from ..spatial.spatial_robot import SpatialRobot
from .measured_modes import AT_FIRST, KNOWN, MeasuredModes, mode_pairs
from .modal_basis import (
    CorrectedModes,
    ModalBasis,
    PosturePlace,
    arc_weights,
    basis_at,
    corrected_modes,
    modelled_damping,
)
from .process import (
    MEDIANS,
    Evidence,
    PostureMetric,
    SquaredDistances,
    best_hyperparameters,
    covariance_of,
    covariance_parts,
    drawn_hyperparameters,
    posture_metric,
    squared_distances,
)
from .process_rows import Rows, joined, measured_rows, picked, unknown_rows

Pairs = tuple[tuple[tuple[int, int], ...], ...]

LARGEST_STEP = 0.25
"""Largest change of a logarithm in one step."""


@dataclass(frozen=True)
class MeasuredCell:
    """What stays the same while the unknowns are searched.

    Parameters
    ----------
    robot
        Robot as modelled.
    measured, bases, places
        Measured modes, modelled modes and place of each posture.
    metric
        Distances of postures.
    """

    robot: SpatialRobot
    measured: tuple[MeasuredModes, ...]
    bases: tuple[ModalBasis, ...]
    places: tuple[PosturePlace, ...]
    metric: PostureMetric

    def distances(self) -> SquaredDistances:
        """Squared distances of the measured postures among themselves."""
        return squared_distances(self.metric, list(self.places), list(self.places))


def cell_of(robot: SpatialRobot, measured: tuple[MeasuredModes, ...]) -> MeasuredCell:
    """Modes as modelled in each measured posture, and the distances of the postures."""
    prepared = [basis_at(robot, one.driven) for one in measured]
    places = tuple(place for _, place in prepared)
    weights = arc_weights(robot, np.array([one.driven for one in measured]))
    metric = posture_metric(robot, weights, list(places))
    return MeasuredCell(robot, measured, tuple(basis for basis, _ in prepared), places, metric)


def first_pairs(cell: MeasuredCell) -> Pairs:
    """Modes that are the same, by the model as it is.

    Raises
    ------
    InputError
        A posture in which no measured mode is the model's.
    """
    return tuple(
        _pairs(one, corrected_modes(basis, np.zeros(len(basis.stiffness)), np.zeros(len(basis.mass))), AT_FIRST)
        for one, basis in zip(cell.measured, cell.bases, strict=True)
    )


def pairs_by_others(cell: MeasuredCell, rows: Rows, hyper: Real) -> Pairs:
    """Modes that are the same, in each posture by what the other postures say of it.

    A wrong pair bends the unknowns of its own posture until it looks right; what the others say does not bend.
    """
    found = []
    for p, (one, basis) in enumerate(zip(cell.measured, cell.bases, strict=True)):
        others = picked(rows, rows.posture != p)
        unknown = _expected(cell, others, hyper, [p])[0]
        n, m = len(basis.stiffness), len(basis.mass)
        found.append(_pairs(one, corrected_modes(basis, unknown[:n], unknown[n : n + m]), KNOWN))
    return tuple(found)


def linear_rows(cell: MeasuredCell, stiffness: Real, mass: Real, pairs: Pairs) -> Rows:
    """Rows of all measured modes, linear about the unknowns."""
    parts = []
    for p, (measured, basis) in enumerate(zip(cell.measured, cell.bases, strict=True)):
        modes = corrected_modes(basis, stiffness[p], mass)
        ratios = modelled_damping(cell.robot, modes.natural)
        parts.append(measured_rows(p, measured, pairs[p], basis, modes, ratios, (stiffness[p], mass)))
    return joined(parts)


def most_probable(cell: MeasuredCell, rows: Rows, hyper: Real, stiffness: Real, mass: Real) -> tuple[Real, Real]:
    """One step of Newton and Gauss towards the most probable unknowns."""
    found = _expected(cell, rows, hyper, list(range(len(stiffness))))
    n = stiffness.shape[1]
    new = np.clip(found[:, :n] - stiffness, -LARGEST_STEP, LARGEST_STEP) + stiffness
    return new, np.clip(found[0, n : n + len(mass)] - mass, -LARGEST_STEP, LARGEST_STEP) + mass


def _expected(cell: MeasuredCell, rows: Rows, hyper: Real, postures: list[int]) -> Real:
    """Mean of the unknowns in some of the measured postures, given rows, (n_postures, n_unknowns)."""
    distances = cell.distances()
    factor = scipy.linalg.cho_factor(covariance_of(hyper, Evidence(rows, distances)), lower=True)
    wanted = joined([unknown_rows(p, len(cell.bases[0].stiffness), len(cell.bases[0].mass)) for p in postures])
    parts = covariance_parts(wanted, rows, distances, float(np.exp(hyper[-1])), False)
    across = np.tensordot(np.exp(2 * hyper[:-1]), parts, 1)
    return np.asarray((across @ scipy.linalg.cho_solve(factor, rows.value)).reshape(len(postures), -1))


def _pairs(one: MeasuredModes, modes: CorrectedModes, scales: tuple[float, float]) -> tuple[tuple[int, int], ...]:
    moved = modes.tip @ one.directions.T
    found = mode_pairs(one.frequencies, one.shapes, modes.natural / (2 * np.pi), moved, scales)
    if not found:
        raise InputError(
            f"{one.name}: none of the measured modes ({', '.join(f'{f:.1f}' for f in one.frequencies)} Hz) is near one "
            f"of the model's ({modes.natural[0] / (2 * np.pi):.1f} Hz and above); check the posture"
        )
    return found


ROUNDS, STEPS = 3, 4
"""Rounds of hyperparameters and unknowns in turn, and steps of Newton and Gauss in each."""


@dataclass(frozen=True)
class LearnedPostures:
    """A robot's model with what measurements in some postures say of its modes in all.

    Parameters
    ----------
    robot
        Robot whose model is the mean.
    measured
        Modes measured in the postures.
    pairs
        For each posture, numbers of measured and computed modes that are the same.
    best : (n_hyperparameters,)
        Logarithms of the hyperparameters at the largest posterior.
    draws : (n_draws, n_hyperparameters)
        Draws of them.
    stiffness : (n_postures, n_stiffnesses)
        Logarithms of the stiffness factors in each posture, about which the modes are linear.
    mass : (n_masses,)
        Logarithms of the mass factors.
    evidence
        Measured rows and the distances of their postures.
    metric, places
        Distances of postures, and where the measured ones lie.
    """

    robot: SpatialRobot
    measured: tuple[MeasuredModes, ...]
    pairs: Pairs
    best: Real
    draws: Real
    stiffness: Real
    mass: Real
    evidence: Evidence
    metric: PostureMetric
    places: tuple[PosturePlace, ...]

    def frequency_ratios(self) -> tuple[Real, ...]:
        """Measured over modelled frequencies of the paired modes in each posture, before anything was learned."""
        found = []
        for one, pairs in zip(self.measured, self.pairs, strict=True):
            natural = np.sqrt(basis_at(self.robot, one.driven)[0].squares) / (2 * np.pi)
            found.append(np.array([one.frequencies[i] / natural[r] for i, r in pairs]))
        return tuple(found)

    @property
    def unpaired(self) -> tuple[tuple[str, float], ...]:
        """Measured modes that no computed mode stands for: posture and frequency, Hz."""
        return tuple(
            (one.name, float(one.frequencies[i]))
            for one, pairs in zip(self.measured, self.pairs, strict=True)
            for i in range(len(one.frequencies))
            if i not in {pair[0] for pair in pairs}
        )


def learn_postures(
    robot: SpatialRobot, measured: Sequence[MeasuredModes], progress: Callable[[], None] | None = None
) -> LearnedPostures:
    """Learn how a robot's measured modes differ from its model, over postures.

    ``log f = log f_r(s(q), m) + e``: factors ``s(q)`` of the joints' stiffness vary over postures as Gaussian
    processes, masses' factors do not, and ``e`` is a process of its own for what no factor explains; damping and the
    motion of the tip likewise. The modes are linearised about the most probable factors.

    Parameters
    ----------
    robot
        Robot as modelled, best after its constants were updated.
    measured
        Modes measured in two postures or more.
    progress
        Function that is called after each round.

    Raises
    ------
    InputError
        Fewer than two postures, a robot without masses, or a posture in which no mode is the model's.
    """
    if len(measured) < 2:
        raise InputError(f"{len(measured)} measured posture: give two or more, best eight")
    cell = cell_of(robot, tuple(measured))
    best = np.log(MEDIANS)
    stiffness = np.zeros((len(cell.places), len(cell.bases[0].stiffness)))
    mass = np.zeros(len(cell.bases[0].mass))
    pairs = first_pairs(cell)
    for turn in range(ROUNDS):
        for _ in range(STEPS):
            rows = linear_rows(cell, stiffness, mass, pairs)
            stiffness, mass = most_probable(cell, rows, best, stiffness, mass)
            pairs = pairs_by_others(cell, rows, best) if turn < ROUNDS - 1 else pairs
        rows = linear_rows(cell, stiffness, mass, pairs)
        best = best_hyperparameters(Evidence(rows, cell.distances()), best)
        if progress is not None:
            progress()
    draws = drawn_hyperparameters(Evidence(rows, cell.distances()), best)
    return assembled(robot, measured, pairs, (best, draws), (stiffness, mass))


def assembled(
    robot: SpatialRobot,
    measured: Sequence[MeasuredModes],
    pairs: Pairs,
    hyperparameters: tuple[Real, Real],
    unknown: tuple[Real, Real],
) -> LearnedPostures:
    """The process from measurements, pairs, hyperparameters (best, draws) and unknowns (stiffness, mass) as known.

    It is what :func:`learn_postures` ends with, and what a file holds.
    """
    cell = cell_of(robot, tuple(measured))
    evidence = Evidence(linear_rows(cell, *unknown, pairs), cell.distances())
    return LearnedPostures(robot, cell.measured, pairs, *hyperparameters, *unknown, evidence, cell.metric, cell.places)
