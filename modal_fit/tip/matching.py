"""Residues of one structure at the sensor, seen in the cut and by hammer: which mode is which."""

from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import Complex, DegreeOfFreedom, Index, InputError, Real

from ..models.modal_model import ModalModel
from ..settings import SETTINGS
from ..shapes import modal_assurance

SHIFTS = np.linspace(-SETTINGS.matched_frequency, SETTINGS.matched_frequency, 51)


@dataclass(frozen=True)
class SharedForces:
    """Directions of force that two models have in common.

    Parameters
    ----------
    names
        Degrees of freedom, as the first model writes them.
    first, second : (n_shared,), int
        Columns of the left vectors in the two models.
    signs : (n_shared,)
        -1 where the two models have opposite directions, else 1.
    """

    names: tuple[str, ...]
    first: Index
    second: Index
    signs: Real


def shared_forces(first: tuple[str, ...], second: tuple[str, ...]) -> SharedForces:
    """Find the directions in which both tests excite, by their axes; each test excites one point.

    Raises
    ------
    InputError
        There is none.

    Examples
    --------
    >>> shared = shared_forces(("TCP:+X", "TCP:+Y"), ("TIP:-Y",))
    >>> shared.names, shared.first.tolist(), shared.second.tolist(), shared.signs.tolist()
    (('TCP:+Y',), [1], [0], [-1.0])
    """
    forces = [[DegreeOfFreedom.parse(name) for name in names] for names in (first, second)]
    pairs = [
        (p, q, a.sign * b.sign)
        for p, a in enumerate(forces[0])
        for q, b in enumerate(forces[1])
        if a.axis == b.axis and (a.node == b.node or _one_node(first) == _one_node(second) == 1)
    ]
    if not pairs:
        raise InputError(
            f"the model is excited at {', '.join(first)}, the hammer FRFs at {', '.join(second)}: no direction in "
            "common, so that their modes cannot be compared; tap along a direction of the cutting force"
        )
    rows, columns, signs = zip(*pairs, strict=True)
    return SharedForces(tuple(first[p] for p in rows), np.array(rows), np.array(columns), np.array(signs))


def _one_node(names: tuple[str, ...]) -> int:
    return len({DegreeOfFreedom.parse(name).node for name in names})


def scaled_residues(model: ModalModel, rows: Index, columns: Index, signs: Real | float = 1.0) -> Complex:
    """Return residues times damped frequencies, 1/kg, (n_modes, n_rows, n_columns).

    A residue ``phi_p phi_q / (2 i w_d)`` of a mode with mass-normalised shape phi changes with the stiffness of the
    structure; this product does not.
    """
    left = model.left[:, columns] * signs
    return np.asarray(model.poles.imag[:, None, None] * model.right[:, rows, None] * left[:, None, :])


def assign(frequencies: tuple[Real, Real], residues: tuple[Complex, Complex]) -> tuple[Index, Index]:
    """Assign hammer modes to in-process modes, one to one; return the indices of both, as many as the fewer modes.

    The cost of a pair is ``(ln(f_cut / f_rest) - m)^2 / 0.2^2 + 1 - MAC``, with the MAC of the whole residue matrices.
    The common shift m of all modes is the one with the least sum; it costs ``(m / 0.2)^2`` itself. Modes too far apart
    to be one cost all the same, so that a mode without a partner does not push the others from theirs.

    Parameters
    ----------
    frequencies
        Natural frequencies in the cut (n_modes,) and of the hammer modes (n_hammer,).
    residues
        Residues of both at the sensor, (n_modes, n_rows, n_columns) and (n_hammer, n_rows, n_columns).

    Examples
    --------
    A structure that is 8 % stiffer at rest; the nearest hammer mode to 20 Hz is the wrong one:

    >>> shapes = np.array([[1.0, 0, 0.2], [0, 1, 0.1]])
    >>> residues = np.einsum("rp,rq->rpq", shapes, shapes) + 0j
    >>> assign((np.array([18.5, 20.0]), np.array([19.98, 21.6])), (residues, residues))[1].tolist()
    [0, 1]
    """
    f, hammer_f = frequencies
    shift = np.log(f[:, None] / hammer_f[None, :])
    assurance = modal_assurance(*(array.reshape(len(array), -1) for array in residues))
    best: tuple[float, Index, Index] | None = None
    for common in SHIFTS:
        apart = np.minimum(np.abs(shift - common), SETTINGS.matched_frequency)
        cost = (apart / SETTINGS.usual_shift) ** 2 + 1 - assurance
        rows, columns = scipy.optimize.linear_sum_assignment(cost)
        total = float(cost[rows, columns].sum() + (common / SETTINGS.usual_shift) ** 2)
        if best is None or total < best[0]:
            best = (total, rows.astype(np.int64), columns.astype(np.int64))
    assert best is not None
    return best[1:]
