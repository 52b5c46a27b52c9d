"""The strongest line of a chattering tool: the Floquet mode's spectrum at a crossing."""

import numpy as np
from numpy.typing import NDArray

from ..floquet import PeriodOperator, period_operator
from ..milling_loop import DelaySystem
from .crossings import Crossings

Real = NDArray[np.float64]


def strongest_lines(system: DelaySystem, operator: PeriodOperator, found: Crossings) -> Real:
    """Frequency (Hz) of the strongest line of the tool's motion at each crossing.

    The chip of the critical mode is ``h = (I - b G)^-1 E z`` with z in the null space of ``M(b) - mu``; its force has
    lines at ``(theta + 2 pi k) / tau``, and each moves the tool by the structure's receptance there.

    Parameters
    ----------
    system, operator
        Structure and its discretised tooth period.
    found
        Crossings at the operator's speeds.
    """
    if not len(found.depth):
        return np.zeros(0)
    multiplier = np.exp(1j * found.theta)
    b = (found.depth * (1 - 1 / multiplier))[:, None, None]
    size, n_nodes = operator.free.shape[-1], operator.within.shape[-1]
    chips = np.linalg.solve(np.eye(n_nodes) - b * operator.within[found.speed], operator.motion[found.speed] + 0j)
    transition = operator.free[found.speed] + b * operator.impulse[found.speed] @ chips
    state = np.linalg.svd(transition - multiplier[:, None, None] * np.eye(size))[2][:, -1].conj()
    nodes = (chips @ state[:, :, None])[:, :, 0]
    periods = operator.periods[found.speed]
    top = int(np.ceil(1.5 * np.abs(system.poles).max() * periods.max() / (2 * np.pi))) + 1
    turns = found.theta[:, None] + 2 * np.pi * np.arange(-top, top + 1)
    wave = np.exp(-1j * turns[:, :, None] * operator.times)
    force = np.einsum("ckn,cn,nd->ckd", wave, nodes * operator.weights, operator.forces, optimize=True)
    line = turns / periods[:, None]
    motion = np.zeros_like(force)
    for pole, right, left in zip(system.poles, system.right, system.left, strict=True):
        motion += (force @ left / (1j * line - pole))[:, :, None] * right
        motion += (force @ left.conj() / (1j * line - pole.conj()))[:, :, None] * right.conj()
    strongest = np.argmax(np.linalg.norm(motion, axis=2), axis=1)
    return np.asarray(np.abs(line[np.arange(len(line)), strongest]) / (2 * np.pi))


def strongest_line(system: DelaySystem, speed: float, depth: float, multiplier: complex) -> float:
    """Give the frequency (Hz) of the strongest line of one motion whose multiplier lies on the circle, or near it.

    Parameters
    ----------
    system
        Structure and process.
    speed : rad/s
        Spindle speed of the cut.
    depth : m
        Axial depth of cut.
    multiplier
        Floquet multiplier of the motion.
    """
    operator = period_operator(system, np.array([2 * np.pi / (system.process.teeth * speed)]))
    theta = np.array([abs(float(np.angle(multiplier)))])
    here = Crossings(np.zeros(1, dtype=np.int64), np.array([depth]), theta, np.ones(1, dtype=bool))
    return float(strongest_lines(system, operator, here)[0])
