"""A sequence made finer and smoother: angles at quarters of a step about it, then angles that bend little."""

from dataclasses import fields, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from millfrf.robot_model import PointPostures, Redundancy, limit_margin, point_postures, reached_near, singular_values

from .certified_search import PathJob, Posture

Real = NDArray[np.float64]

_OFFSETS = np.array([-0.5, -0.25, 0.0, 0.25, 0.5])


def finer_postures(
    job: PathJob, free: Redundancy, chosen: list[Posture]
) -> tuple[list[Redundancy], list[PointPostures]]:
    """Angles at quarters of a step about the sequence, and the postures of its own branch there.

    Parameters
    ----------
    free
        Angles that the sequence was chosen from.
    chosen
        One posture a point.
    """
    steps = [float(np.diff(axis)[0]) if len(axis) > 1 else 0.0 for axis in (free.tool, free.table)]
    reach = max(job.wanted.joint_step, 1.5 * max(steps))
    robot, finer, found = job.cut.robot, [], []
    for place, (q, tool, table) in zip(job.path.places, chosen, strict=True):
        angles = (_in_range(tool + steps[0] * _OFFSETS, free.tool), _in_range(table + steps[1] * _OFFSETS, free.table))
        here = replace(free, tool=np.unique(angles[0]), table=np.unique(angles[1]))
        every = point_postures(robot, place, here, [q[robot.mechanism.active]])
        near = np.abs(every.q - q).max(axis=1) < reach if len(every) else np.zeros(0, dtype=bool)
        finer.append(here)
        found.append(PointPostures(*(getattr(every, field.name)[near] for field in fields(every))))
    return finer, found


def smoothed(job: PathJob, free: Redundancy, chosen: list[Posture]) -> list[Posture] | None:
    """Give the sequence angles that bend little, at most half a step away; None where a step or a margin breaks."""
    angles = []
    for axis, column in ((free.tool, 1), (free.table, 2)):
        half = 0.5 * float(np.diff(axis)[0]) if len(axis) > 1 else 0.0
        given = np.unwrap(np.array([posture[column] for posture in chosen], dtype=float))
        angles.append(_in_range(np.clip(whittaker(given), given - half, given + half), axis))
    found: list[Posture] = []
    robot = job.cut.robot
    for k, place in enumerate(job.path.places):
        tool, table = float(angles[0][k]), float(angles[1][k])
        q = reached_near(robot, free.place(place, tool, table), chosen[k][0])
        if q is None or limit_margin(robot.mechanism, q) < free.limit_margin:
            return None
        if singular_values(robot.mechanism, q)[0] < free.least_singular_value:
            return None
        if k and np.abs(q - found[-1][0]).max() > job.wanted.joint_step:
            return None
        if k and abs(table - found[-1][2]) > job.wanted.table_step:
            return None
        found.append((q, tool, table))
    return found


def _in_range(angles: Real, axis: Real) -> Real:
    """Angles inside the range that was sampled; all of them where the samples close the full circle.

    Examples
    --------
    >>> np.degrees(_in_range(np.radians([-100.0, -70.0]), np.radians([-90.0, -60.0, -30.0]))).round()
    array([-90., -70.])
    """
    step = float(np.diff(axis)[0]) if len(axis) > 1 else 0.0
    if step and np.ptp(axis) + step > 2 * np.pi - 1e-9:
        return angles
    return np.asarray(np.clip(angles, axis.min(), axis.max()))


def whittaker(values: Real, weight: float = 30.0) -> Real:
    """Smooth a sequence: ``min sum (z - y)^2 + weight sum (second difference of z)^2`` (Whittaker 1923; Eilers 2003).

    Examples
    --------
    >>> np.allclose(whittaker(np.arange(6.0)), np.arange(6.0))
    True
    """
    n = len(values)
    if n < 5:
        return np.asarray(values, dtype=float)
    rows = np.zeros((3, n))
    for offset, parts in enumerate(((1.0, 4.0, 1.0), (-2.0, -2.0), (1.0,))):
        for place, part in enumerate(parts):
            rows[offset, place : place + n - 2] += weight * part
    rows[0] += 1.0
    return np.asarray(solveh_banded(rows, values, lower=True))
