"""Rows of the process: each measured number, and each quantity wanted, as a linear form of the unknowns."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Index, Real

from .measured_modes import MeasuredModes
from .modal_basis import CorrectedModes, ModalBasis, shape_slopes

FREQUENCY, DAMPING, SHAPE, UNKNOWN = range(4)
"""Kinds of rows: logarithm of a frequency, of a damping ratio, a component of a shape, an unknown itself."""


@dataclass(frozen=True)
class Rows:
    """Linear forms, one a row.

    Parameters
    ----------
    posture : (n,)
        Number of the row's posture in its list.
    kind : (n,)
        ``FREQUENCY``, ``DAMPING``, ``SHAPE`` or ``UNKNOWN``.
    stiffness : (n, n_stiffnesses)
        Derivative by the logarithms of the stiffness factors at the posture.
    mass : (n, n_masses)
        The same by the mass factors, which are those of every posture.
    damping : (n, 1 + n_stiffnesses)
        The same by the logarithms of damping: of the whole robot, then of each elastic part.
    energy : (n, n_stiffnesses)
        Roots of the shares of energy of the row's mode: modes alike in this have like discrepancies.
    motion, direction : (n, 3)
        Unit vector of the mode's motion of the tip, and of the row's component; zero where the row is no shape.
    value : (n,)
        Measured number less the part that the linear form leaves out.
    noise : (n,)
        Its standard error.
    """

    posture: Index
    kind: Index
    stiffness: Real
    mass: Real
    damping: Real
    energy: Real
    motion: Real
    direction: Real
    value: Real
    noise: Real

    def __len__(self) -> int:
        return len(self.value)


def joined(parts: list[Rows]) -> Rows:
    """Rows one after the other."""
    return Rows(**{one.name: np.concatenate([getattr(part, one.name) for part in parts]) for one in fields(Rows)})


def picked(rows: Rows, chosen: NDArray[np.bool_]) -> Rows:
    """Rows that are chosen, (n,) bool."""
    return Rows(**{one.name: getattr(rows, one.name)[chosen] for one in fields(Rows)})


def measured_rows(
    posture: int,
    measured: MeasuredModes,
    pairs: tuple[tuple[int, int], ...],
    basis: ModalBasis,
    modes: CorrectedModes,
    ratios: Real,
    unknown: tuple[Real, Real],
) -> Rows:
    """Rows of one measured posture, linear about the unknowns ``(stiffness, mass)`` whose modes are given.

    Parameters
    ----------
    pairs
        Numbers of measured and computed modes that are the same.
    ratios : (n_modes,)
        Damping ratios as modelled.
    """
    directions = measured.directions
    parts = []
    for i, r in pairs:
        rows = linear_mode_rows(posture, basis, modes, r, directions, unknown)
        computed = directions @ modes.tip[r]
        size = max(float(np.linalg.norm(computed)), 1e-12)
        seen = measured.shapes[i] * (1.0 if measured.shapes[i] @ computed >= 0 else -1.0)
        left = [
            np.log(measured.frequencies[i] * 2 * np.pi / modes.natural[r]),
            np.log(measured.damping[i] / ratios[r]),
            *((seen - computed) / size),
        ]
        noise = np.append(measured.errors[i, :2], np.full(len(directions), measured.errors[i, 2]))
        value = np.array(left) + rows.stiffness @ unknown[0] + rows.mass @ unknown[1]
        parts.append(replace(rows, value=value, noise=noise))
    return joined(parts)


def linear_mode_rows(
    posture: int, basis: ModalBasis, modes: CorrectedModes, mode: int, directions: Real, unknown: tuple[Real, Real]
) -> Rows:
    """Frequency, damping and shape of one mode over the unknowns, with their discrepancies; nothing measured.

    ``d log w = shares . ds / 2 - mass shares . dm / 2``; a shape's components are shares of its size.
    """
    slopes = shape_slopes(basis, modes, *unknown, mode)
    size = max(float(np.linalg.norm(directions @ modes.tip[mode])), 1e-12)
    shares, masses = modes.shares[mode], modes.masses[mode]
    rows = mode_rows(posture, modes, mode, directions)
    damping = np.zeros_like(rows.damping)
    damping[1] = np.append(1.0, shares)
    return replace(
        rows,
        stiffness=np.vstack([shares / 2, np.zeros_like(shares), directions @ slopes[0] / size]),
        mass=np.vstack([-masses / 2, np.zeros_like(masses), directions @ slopes[1] / size]),
        damping=damping,
    )


def mode_rows(posture: int, modes: CorrectedModes, mode: int, directions: Real) -> Rows:
    """Frequency, damping and shape of one mode beside what the unknowns explain: their discrepancies alone."""
    count = 2 + len(directions)
    n_stiffnesses, n_masses = modes.shares.shape[1], modes.masses.shape[1]
    moved = modes.tip[mode]
    motion, direction = np.zeros((count, 3)), np.zeros((count, 3))
    motion[2:] = moved / max(float(np.linalg.norm(moved)), 1e-30)
    direction[2:] = directions
    energy = np.sqrt(np.maximum(modes.shares[mode], 0.0))
    return Rows(
        np.full(count, posture),
        np.array([FREQUENCY, DAMPING, *[SHAPE] * len(directions)]),
        np.zeros((count, n_stiffnesses)),
        np.zeros((count, n_masses)),
        np.zeros((count, 1 + n_stiffnesses)),
        np.tile(energy / max(float(np.linalg.norm(energy)), 1e-12), (count, 1)),
        motion,
        direction,
        np.zeros(count),
        np.zeros(count),
    )


def unknown_rows(posture: int, n_stiffnesses: int, n_masses: int) -> Rows:
    """The unknowns themselves at a posture: stiffnesses, masses, damping of the whole and of each elastic part."""
    count = 2 * n_stiffnesses + n_masses + 1
    whole = np.eye(count)
    first, second = n_stiffnesses, n_stiffnesses + n_masses
    empty = np.zeros((count, 3))
    return Rows(
        np.full(count, posture),
        np.full(count, UNKNOWN),
        whole[:, :first],
        whole[:, first:second],
        whole[:, second:],
        np.zeros((count, n_stiffnesses)),
        empty,
        empty,
        np.zeros(count),
        np.zeros(count),
    )
