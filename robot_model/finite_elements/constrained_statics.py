"""Statics under rigid links by Lagrange multipliers, and the stiffness that is left at the tool."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from .structure import Structure, rigid_rows, stiffness_matrix

Real = NDArray[np.float64]


@dataclass(frozen=True)
class ConstrainedSystem:
    """``[[K, A^T], [A, 0]] (x, lambda) = (F, 0)`` without the clamped node (Belchior et al. 2013, Eqs. 13-15).

    Symmetric and invertible, not positive definite as the paper says: a saddle matrix.

    Parameters
    ----------
    stiffness : (n, n)
        Stiffness K over the free nodes, n = 6 (H - 1).
    constraints : (n_rows, n)
        Constraints A over the free nodes.
    whole : (n + n_rows, n + n_rows)
        The rows of A are scaled by ``scale`` to the size of K, so that the matrix is well conditioned.
    tip : int
        Position of the tool's six degrees of freedom.
    """

    stiffness: Real
    constraints: Real
    whole: Real
    scale: float
    tip: int

    def tip_responses(self) -> Real:
        """Displacement of all free nodes for unit forces and moments at the tool, shape (n, 6).

        Raises
        ------
        InputError
            The structure is not held.
        """
        size = len(self.stiffness)
        loads = np.zeros((len(self.whole), 6))
        loads[self.tip : self.tip + 6] = np.eye(6)
        try:
            solved = np.linalg.solve(self.whole, loads)
        except np.linalg.LinAlgError as error:
            raise InputError("the structure is not held: a joint has no stiffness, or a loop is singular") from error
        return np.asarray(solved[:size])


def constrained_system(structure: Structure) -> ConstrainedSystem:
    """The saddle system of a structure with node 0 clamped."""
    stiffness = stiffness_matrix(structure)[6:, 6:]
    constraints = rigid_rows(structure)[:, 6:]
    scale = float(np.median(np.diag(stiffness)[np.diag(stiffness) > 0])) if stiffness.any() else 1.0
    rows = scale * constraints
    whole = np.block([[stiffness, rows.T], [rows, np.zeros((len(rows), len(rows)))]])
    return ConstrainedSystem(stiffness, constraints, whole, scale, 6 * (structure.tip - 1))


def tip_compliance(structure: Structure) -> Real:
    """Displacement and rotation of the tool over force and moment there, shape (6, 6)."""
    system = constrained_system(structure)
    compliance = system.tip_responses()[system.tip : system.tip + 6]
    return np.asarray((compliance + compliance.T) / 2)


def tip_stiffness(structure: Structure) -> Real:
    """Equivalent stiffness by condensing everything but the tool, shape (6, 6).

    ``K_eq = K_EE - K_ER K_RR^-1 K_RE`` with the multipliers among R (Belchior et al. 2013, Eqs. 16-19 and 24).

    Raises
    ------
    InputError
        The rest cannot be condensed: it is not held when the tool is.
    """
    system = constrained_system(structure)
    tool = np.arange(system.tip, system.tip + 6)
    rest = np.setdiff1d(np.arange(len(system.whole)), tool)
    inner = system.whole[np.ix_(rest, rest)]
    side = system.whole[np.ix_(rest, tool)]
    try:
        condensed = system.whole[np.ix_(tool, tool)] - side.T @ np.linalg.solve(inner, side)
    except np.linalg.LinAlgError as error:
        raise InputError("the structure is not held when its tool is; use tip_compliance") from error
    return np.asarray((condensed + condensed.T) / 2)
