"""The cell while it is learned: measured rows about the unknowns of the moment, and the most probable unknowns."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from foundation import InputError

from ..spatial import SpatialRobot
from .hyperparameters import Evidence, covariance_of
from .modes import (
    AT_FIRST,
    KNOWN,
    CorrectedModes,
    MeasuredModes,
    ModalBasis,
    PosturePlace,
    arc_weights,
    basis_at,
    corrected_modes,
    mode_pairs,
    modelled_damping,
)
from .posture_kernels import PostureMetric, SquaredDistances, posture_metric, squared_distances
from .process_covariance import covariance_parts
from .process_rows import Rows, joined, measured_rows, picked, unknown_rows

Real = NDArray[np.float64]
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
    factor = cho_factor(covariance_of(hyper, Evidence(rows, distances)), lower=True)
    wanted = joined([unknown_rows(p, len(cell.bases[0].stiffness), len(cell.bases[0].mass)) for p in postures])
    parts = covariance_parts(wanted, rows, distances, float(np.exp(hyper[-1])), False)
    across = np.tensordot(np.exp(2 * hyper[:-1]), parts, 1)
    return np.asarray((across @ cho_solve(factor, rows.value)).reshape(len(postures), -1))


def _pairs(one: MeasuredModes, modes: CorrectedModes, scales: tuple[float, float]) -> tuple[tuple[int, int], ...]:
    moved = modes.tip @ one.directions.T
    found = mode_pairs(one.frequencies, one.shapes, modes.natural / (2 * np.pi), moved, scales)
    if not found:
        raise InputError(
            f"{one.name}: none of the measured modes ({', '.join(f'{f:.1f}' for f in one.frequencies)} Hz) is near one "
            f"of the model's ({modes.natural[0] / (2 * np.pi):.1f} Hz and above); check the posture"
        )
    return found
