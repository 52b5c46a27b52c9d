"""Cutting force of a tool that moves as it was recorded, teeth that leave the cut among it."""

import math

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess

Real = NDArray[np.float64]

_FEWEST = 96  # angles from tooth to tooth
_IN_THE_CUT = 40  # of them while a tooth is engaged, at least
_MOST = 600
_TURNS = 3  # until the surface repeats


def angles_of(process: MillingProcess) -> int:
    """Angles of a revolution at which the force is computed: fine enough for a short engagement."""
    share = (process.exit_angle - process.start_angle) * process.teeth / (2 * math.pi)
    return process.teeth * int(min(_MOST, max(_FEWEST, math.ceil(_IN_THE_CUT / share))))


def swept_force(process: MillingProcess, motion: Real) -> Real:
    """Give the force on the tool over depth and K_tc, from a motion that repeats with the revolution.

    A tooth takes what stands between its path and the surface that earlier teeth left; a tooth that does not reach the
    surface leaves it, one feed nearer (Insperger & Stepan, Semi-Discretization for Time-Delay Systems, section 5.3).

    Parameters
    ----------
    process
        Cutter with feed and runout; equal pitch, straight edges, edge angle 90 degrees.
    motion : (n_angles, 2), m
        Motion of the tool in X and Y over one revolution that begins when tooth 0 stands at immersion 0.

    Returns
    -------
    (n_angles, 2)
        m.

    Examples
    --------
    Without motion a slot with one tooth has the chip ``feed sin(phi)``; at 90 degrees the force is (-krc, 1) times it.

    >>> slot = MillingProcess(1, 0.01, math.pi / 2, 1e9, 0.3, 0.0, 0.0, math.pi, 1e-4)
    >>> n = angles_of(slot)
    >>> swept_force(slot, np.zeros((n, 2)))[n // 4].round(5)
    array([-3.e-05,  1.e-04])
    """
    n, teeth = len(motion), process.teeth
    pitch = n // teeth
    angles = 2 * np.pi * (np.arange(n) + 0.5) / n
    places = np.flatnonzero((angles >= process.start_angle) & (angles <= process.exit_angle))
    sine, cosine = np.sin(angles[places]), np.cos(angles[places])
    offsets = process.runout * np.cos(2 * np.pi * np.arange(teeth) / teeth)
    fed = process.feed_per_tooth * sine
    edge = np.array([process.kte, process.kre]) / process.ktc
    surface, force = np.zeros(len(places)), np.zeros((n, 2))
    for turn in range(_TURNS):
        for later in range(teeth):
            when = places % pitch + later * pitch
            tooth = ((places - when) // pitch) % teeth
            reach = motion[when, 0] * sine + motion[when, 1] * cosine + offsets[tooth]
            chip = reach - surface + fed
            cuts = chip > 0
            surface = np.where(cuts, reach, surface - fed)
            if turn < _TURNS - 1:
                continue
            tangential = np.where(cuts, chip + edge[0], 0.0)
            radial = np.where(cuts, process.krc * chip + edge[1], 0.0)
            np.add.at(force, when, np.column_stack([-cosine * tangential - sine * radial,
                                                    sine * tangential - cosine * radial]))  # fmt: skip
    return force
