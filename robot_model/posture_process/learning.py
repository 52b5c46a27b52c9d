"""`learn_postures`: from modal models measured in some postures to a process over all postures."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from ..spatial import SpatialRobot
from .hyperparameters import MEDIANS, Evidence, best_hyperparameters, drawn_hyperparameters
from .linearising import Pairs, cell_of, first_pairs, linear_rows, most_probable, pairs_by_others
from .modes import MeasuredModes, PosturePlace, basis_at
from .posture_kernels import PostureMetric

Real = NDArray[np.float64]

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
