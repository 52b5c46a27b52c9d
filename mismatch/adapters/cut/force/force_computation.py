"""The cutting force that a process and a set of causes give along a recording."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess, specific_forces

from ..physics import CutPhysics, ToothView
from .tooth_views import CutView

Real = NDArray[np.float64]

Acting = Sequence[tuple[CutPhysics, Real]]


def computed_force(process: MillingProcess, depth: float, view: CutView, acting: Acting) -> Real:
    """Force on the tool at every instant, (n_instants, 3), N.

    ``Ft = a (Ktc h + Kte / sin(gamma))`` and alike radial and axial (Mohammadi & Ahmadi, Eqs. 1 to 3), with
    ``h = min_k (k f sin(phi) sin(gamma) + e_0 - e_k)``, not below zero, where ``e_k`` is how far the edges that causes
    displace stood out ``k`` tooth passings ago; turned into X, Y, Z as :func:`cutting.one_tooth.tooth_force` does.

    Parameters
    ----------
    process
        Coefficients, cutter and feed; runout and process damping are causes, and are not read here.
    depth
        Axial depth a, m.
    view
        Where the teeth stand at every instant, and how the tip moves.
    acting
        Causes, each with its numbers (n_numbers,) in SI.
    """
    total = np.zeros((view.count, 3))
    cutting, edge = specific_forces(process)
    for tooth in view.teeth:
        chip = chip_thickness(process, tooth, view.earlier, acting)
        cuts = chip > 0
        local = (depth * tooth.share * cuts)[:, None] * (chip[:, None] * cutting + edge / tooth.sine_edge)
        outward = local[:, 1] * tooth.sine_edge + local[:, 2] * tooth.cosine_edge
        there = np.empty((len(chip), 3))
        there[:, 0] = -local[:, 0] * tooth.cosine - outward * tooth.sine
        there[:, 1] = local[:, 0] * tooth.sine - outward * tooth.cosine
        there[:, 2] = local[:, 1] * tooth.cosine_edge - local[:, 2] * tooth.sine_edge
        for cause, values in acting:
            there += (depth * tooth.share * cuts)[:, None] * cause.force(values, tooth)
        total[tooth.index] += there
    return total


def chip_thickness(process: MillingProcess, tooth: ToothView, earlier: int, acting: Acting) -> Real:
    """Chip thickness at the instants of one tooth, (m,), m.

    Parameters
    ----------
    process
        Process that gives the feed per tooth.
    tooth
        The tooth that cuts.
    earlier
        Number of tooth passings that are looked back.
    acting
        Causes, each with its numbers (n_numbers,) in SI.
    """
    feed = process.feed_per_tooth * tooth.sine * tooth.sine_edge
    own = sum(cause.advance(values, tooth, 0) for cause, values in acting)
    thinnest = np.full(len(feed), np.inf)
    for k in range(1, earlier + 1):
        left = sum(cause.advance(values, tooth, k) for cause, values in acting)
        thinnest = np.minimum(thinnest, k * feed + own - left)
    return np.asarray(np.maximum(thinnest, 0.0))
