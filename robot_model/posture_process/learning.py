"""`learn_postures`: from modal models measured in some postures to a process over all postures."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from foundation import InputError

from ..spatial import SpatialRobot
from .corrected_modes import corrected_modes, modelled_damping
from .hyperparameters import MEDIANS, Evidence, best_hyperparameters, covariance_of, drawn_hyperparameters
from .measured_posture import MeasuredPosture
from .modal_basis import ModalBasis, PosturePlace, arc_weights, basis_at
from .mode_pairs import mode_pairs
from .posture_kernels import PostureMetric, posture_metric, squared_distances
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
        Measured rows.
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


def learn_postures(
    robot: SpatialRobot, measured: Sequence[MeasuredPosture], *, hyperparameters: tuple[Real, Real] | None = None
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
    hyperparameters
        Logarithms at the largest posterior and draws of them, where they are known; None: found here.

    Raises
    ------
    InputError
        Fewer than two postures, a robot without masses, or a posture in which no mode is the model's.
    """
    if len(measured) < 2:
        raise InputError(f"{len(measured)} measured posture: give two or more, best eight")
    prepared = [basis_at(robot, one.driven) for one in measured]
    places = tuple(place for _, place in prepared)
    weights = arc_weights(robot, np.array([one.driven for one in measured]))
    cell = _Cell(
        robot,
        tuple(measured),
        tuple(basis for basis, _ in prepared),
        places,
        posture_metric(robot, weights, list(places)),
    )
    best = np.log(MEDIANS) if hyperparameters is None else hyperparameters[0]
    stiffness = np.zeros((len(places), len(cell.bases[0].stiffness)))
    mass = np.zeros(len(cell.bases[0].mass))
    pairs: Pairs | None = None
    for turn in range(ROUNDS):
        for _ in range(STEPS):
            rows, pairs = _linear_rows(cell, stiffness, mass, None if turn == 0 else pairs)
            stiffness, mass = _most_probable(cell, rows, best, stiffness, mass)
        rows, pairs = _linear_rows(cell, stiffness, mass, pairs if turn else None)
        evidence = Evidence(rows, squared_distances(cell.metric, list(places), list(places)))
        if hyperparameters is None:
            best = best_hyperparameters(evidence, best)
    assert pairs is not None
    draws = drawn_hyperparameters(evidence, best) if hyperparameters is None else hyperparameters[1]
    return LearnedPostures(
        robot, cell.measured, pairs, best, draws, stiffness, mass, evidence, cell.metric, cell.places
    )


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
    places = list(cell.places)
    distances = squared_distances(cell.metric, places, places)
    factor = cho_factor(covariance_of(hyper, Evidence(rows, distances)), lower=True)
    wanted = joined([unknown_rows(p, stiffness.shape[1], len(mass)) for p in range(len(places))])
    across = np.tensordot(
        np.exp(2 * hyper[:-1]), covariance_parts(wanted, rows, distances, float(np.exp(hyper[-1])), False), 1
    )
    found = (across @ cho_solve(factor, rows.value)).reshape(len(places), -1)
    n = stiffness.shape[1]
    new = np.clip(found[:, :n] - stiffness, -LARGEST_STEP, LARGEST_STEP) + stiffness
    return new, np.clip(found[0, n : n + len(mass)] - mass, -LARGEST_STEP, LARGEST_STEP) + mass
