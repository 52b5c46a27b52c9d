"""Depths that need no search, and the stages in which the others are searched, whatever the largest depth is."""

import numpy as np
from numpy.typing import NDArray

from ..milling_loop import DelaySystem

Real = NDArray[np.float64]

STAGE = 4.0
"""Ratio of the depths at the end and at the beginning of a stage."""

ROW = 1.3
"""Largest ratio of the depths above and below a row of cells."""

GROWTH = 0.9
"""By how much the exponent of a period's growth rises at most in a row of cells."""


def safe_depth(system: DelaySystem) -> float:
    """Depth below which every cut is stable at every speed, by the small-gain theorem, m.

    ``2 a sup_t |D(t)| sup_w |H(i w)| < 1``: the loop of cutting force and structure gains less than it loses. Both
    suprema are looked up on fine grids, and half of the depth is taken.

    Parameters
    ----------
    system
        Structure and process; helix, pitch and process damping are not taken into account.
    """
    angles = np.linspace(0, 2 * np.pi / system.process.teeth, 241)
    force = np.linalg.norm(system.cutting_stiffness(angles), 2, axis=(1, 2)).max()
    natural, width = system.poles.imag, -system.poles.real
    near = natural[:, None] + width[:, None] * np.sinh(np.linspace(-4, 4, 33))
    omega = np.abs(np.concatenate([near.ravel(), np.linspace(0, 1.5 * np.abs(system.poles).max(), 129)]))
    motion = 0.5 / float(force * receptance_size(system, omega).max())
    return float(motion / 2)


def receptance_size(system: DelaySystem, omega: Real) -> Real:
    """Largest singular value of the tool's receptance at frequencies (n,) in rad/s, m/N."""
    direct = 1 / (1j * omega[:, None] - system.poles)
    mirrored = 1 / (1j * omega[:, None] - system.poles.conj())
    values = np.einsum("wr,rp,rq->wpq", direct, system.right, system.left)
    values += np.einsum("wr,rp,rq->wpq", mirrored, system.right.conj(), system.left.conj())
    return np.asarray(np.linalg.norm(values + system.upper, 2, axis=(1, 2)))


def stages(first: float, max_depth: float) -> list[tuple[float, float]]:
    """Bottom and top of each stage, m; they are the same for every largest depth, which ends the last of them.

    Examples
    --------
    >>> stages(1e-4, 1e-3)
    [(0.0001, 0.0004), (0.0004, 0.001)]
    """
    bottoms = first * STAGE ** np.arange(max(1, int(np.ceil(np.log(max_depth / first) / np.log(STAGE)))))
    return [(float(bottom), float(max(min(bottom * STAGE, max_depth), 1.01 * bottom))) for bottom in bottoms]


def row_edges(bottom: float, top: float, growth: float) -> Real:
    """Give edges of the rows of cells between two depths (m): geometric, and finer where solutions grow fast.

    Parameters
    ----------
    bottom, top : m
        Depths between which the rows lie.
    growth
        Exponent by which solutions grow over a period at ``top``, at most; it rises with the root of depth.

    Returns
    -------
    (n_rows + 1,), m
    """
    depths = np.geomspace(bottom, top, 200)
    measure = np.log(depths / bottom) / np.log(ROW) + growth * (np.sqrt(depths / top) - np.sqrt(bottom / top)) / GROWTH
    count = max(1, int(np.ceil(measure[-1])))
    edges = np.interp(np.linspace(0, measure[-1], count + 1), measure, depths)
    edges[0], edges[-1] = bottom, top
    return np.asarray(edges)
