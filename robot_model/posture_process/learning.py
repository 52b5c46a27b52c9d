"""`learn_postures`: from modal models measured in some postures to a process over all postures."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from foundation import InputError

from ..spatial import SpatialRobot
from .corrected_modes import corrected_modes, modelled_damping
from .hyperparameters import MEDIANS, Evidence, best_hyperparameters, covariance_of, drawn_hyperparameters
from .modal_basis import ModalBasis, PosturePlace, arc_weights, basis_at
from .mode_pairs import mode_pairs
from .posture_kernels import PostureMetric, SquaredDistances, posture_metric, squared_distances
from .posture_measurement import MeasuredPosture
from .process_covariance import covariance_parts
from .process_rows import Rows, joined, measured_rows, unknown_rows

Real = NDArray[np.float64]
Pairs = tuple[tuple[tuple[int, int], ...], ...]

ROUNDS, STEPS = 3, 4
"""Rounds of hyperparameters and unknowns in turn, and steps of Newton and Gauss in each."""

LARGEST_STEP = 0.25
"""Largest change of a logarithm in one step."""


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
    measured: tuple[MeasuredPosture, ...]
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


@dataclass(frozen=True)
class _Cell:
    """What stays the same while the unknowns are searched."""

    robot: SpatialRobot
    measured: tuple[MeasuredPosture, ...]
    bases: tuple[ModalBasis, ...]
    places: tuple[PosturePlace, ...]
    metric: PostureMetric

    def distances(self) -> SquaredDistances:
        """Squared distances of the measured postures among themselves."""
        return squared_distances(self.metric, list(self.places), list(self.places))


def learn_postures(
    robot: SpatialRobot, measured: Sequence[MeasuredPosture], progress: Callable[[], None] | None = None
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
    cell = _cell(robot, tuple(measured))
    best = np.log(MEDIANS)
    stiffness = np.zeros((len(cell.places), len(cell.bases[0].stiffness)))
    mass = np.zeros(len(cell.bases[0].mass))
    pairs: Pairs | None = None
    for turn in range(ROUNDS):
        for _ in range(STEPS):
            rows, pairs = _linear_rows(cell, stiffness, mass, pairs if turn else None)
            stiffness, mass = _most_probable(cell, rows, best, stiffness, mass)
        rows, pairs = _linear_rows(cell, stiffness, mass, pairs if turn else None)
        best = best_hyperparameters(Evidence(rows, cell.distances()), best)
        if progress is not None:
            progress()
    assert pairs is not None
    draws = drawn_hyperparameters(Evidence(rows, cell.distances()), best)
    return assembled(robot, measured, pairs, (best, draws), (stiffness, mass))


def assembled(
    robot: SpatialRobot,
    measured: Sequence[MeasuredPosture],
    pairs: Pairs,
    hyperparameters: tuple[Real, Real],
    unknown: tuple[Real, Real],
) -> LearnedPostures:
    """The process from measurements, pairs, hyperparameters (best, draws) and unknowns (stiffness, mass) as known.

    It is what :func:`learn_postures` ends with, and what a file holds.
    """
    cell = _cell(robot, tuple(measured))
    rows, pairs = _linear_rows(cell, *unknown, pairs)
    evidence = Evidence(rows, cell.distances())
    return LearnedPostures(robot, cell.measured, pairs, *hyperparameters, *unknown, evidence, cell.metric, cell.places)


def _cell(robot: SpatialRobot, measured: tuple[MeasuredPosture, ...]) -> _Cell:
    prepared = [basis_at(robot, one.driven) for one in measured]
    places = tuple(place for _, place in prepared)
    weights = arc_weights(robot, np.array([one.driven for one in measured]))
    metric = posture_metric(robot, weights, list(places))
    return _Cell(robot, measured, tuple(basis for basis, _ in prepared), places, metric)


def _linear_rows(cell: _Cell, stiffness: Real, mass: Real, pairs: Pairs | None) -> tuple[Rows, Pairs]:
    parts, found = [], []
    for p, (measured, basis) in enumerate(zip(cell.measured, cell.bases, strict=True)):
        modes = corrected_modes(basis, stiffness[p], mass)
        moved = modes.tip @ measured.directions.T
        own = (
            mode_pairs(measured.frequencies, measured.shapes, modes.natural / (2 * np.pi), moved)
            if pairs is None
            else pairs[p]
        )
        if not own:
            raise InputError(
                f"{measured.name}: none of the measured modes ({', '.join(f'{f:.1f}' for f in measured.frequencies)} "
                f"Hz) is near one of the model's ({modes.natural[0] / (2 * np.pi):.1f} Hz and above); check the posture"
            )
        ratios = modelled_damping(cell.robot, modes.natural)
        parts.append(measured_rows(p, measured, own, basis, modes, ratios, (stiffness[p], mass)))
        found.append(own)
    return joined(parts), tuple(found)


def _most_probable(cell: _Cell, rows: Rows, hyper: Real, stiffness: Real, mass: Real) -> tuple[Real, Real]:
    """One step of Newton and Gauss towards the most probable unknowns."""
    distances = cell.distances()
    factor = cho_factor(covariance_of(hyper, Evidence(rows, distances)), lower=True)
    wanted = joined([unknown_rows(p, stiffness.shape[1], len(mass)) for p in range(len(stiffness))])
    across = np.tensordot(
        np.exp(2 * hyper[:-1]), covariance_parts(wanted, rows, distances, float(np.exp(hyper[-1])), False), 1
    )
    found = (across @ cho_solve(factor, rows.value)).reshape(len(stiffness), -1)
    n = stiffness.shape[1]
    new = np.clip(found[:, :n] - stiffness, -LARGEST_STEP, LARGEST_STEP) + stiffness
    return new, np.clip(found[0, n : n + len(mass)] - mass, -LARGEST_STEP, LARGEST_STEP) + mass
