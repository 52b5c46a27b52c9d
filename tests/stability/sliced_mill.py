"""Time simulation of small vibrations of any cutter from discs: no code of `stability` or `cutting`.

The cutter is a stack of discs. A disc at the height z has a radius, an edge angle kappa, and for each tooth an angle
and a radial offset. A tooth on a disc cuts while it stands inside the workpiece, ``low < y < high``. The surface it
meets is the deepest of those that all teeth of a rigid cutter would leave on this disc during the last revolution, and
no force acts where nothing remains. The vibration of the tool, then and now, changes its chip. The growth of a small
vibration decides stability.
"""

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

STEPS = 1440  # in a revolution
TURNS = 60


@dataclass(frozen=True)
class Discs:
    """Discs of a cutter in the cut, ``n`` of them, and its teeth."""

    radius: Real  # (n,), m
    edge_angle: Real  # (n,), rad
    width: Real  # (n,), m: of the edge on each disc
    angle: Real  # (teeth, n), rad: of each tooth against the sense of rotation
    offset: Real  # (teeth, n), m


@dataclass(frozen=True)
class Cut:
    """Coefficients (Pa), feed per revolution (m), and the workpiece between two values of y (m)."""

    tangential: float
    radial: float
    axial: float
    feed: float
    low: float
    high: float
    rubbing: float = 0.0  # N/m: force per edge width and ratio of the speed into the surface to the cutting speed
    powers: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m of the chip for each coefficient
    unit: float = 1e-3  # m: chip at which the coefficients hold
    round_edge: float = 0.0  # m: a thinner chip is as hard to cut as one of this thickness


@dataclass(frozen=True)
class Structure:
    """Modes: ``q' = p q + left F``, motion ``2 Re sum q right``."""

    poles: Complex
    right: Complex
    left: Complex


def cylinder_discs(
    depth: float, diameter: float, angles: Real, helices: Real, *, corner: float = 0.0, count: int = 40
) -> Discs:
    """Return the discs of an end mill with a corner radius (m) whose teeth stand at ``angles`` (rad) at the tip."""
    edges = np.linspace(0.0, depth, count + 1)
    if corner:  # equal steps of the arc, so that the flat bottom of a ball is resolved
        top = min(depth, corner)
        turn = math.acos(1 - top / corner)
        arc = corner * (1 - np.cos(np.linspace(0.0, turn, count + 1)))
        edges = np.concatenate([arc, np.linspace(top, depth, 9)[1:]]) if depth > top else arc
    middle, half = (edges[1:] + edges[:-1]) / 2, diameter / 2
    radius, edge_angle = np.full(len(middle), half), np.full(len(middle), math.pi / 2)
    width = np.diff(edges)
    if corner:
        below = middle < corner
        low, high = (np.arccos(np.clip(1 - side / corner, -1, 1)) for side in (edges[:-1], edges[1:]))
        edge_angle[below] = ((low + high) / 2)[below]
        radius[below] = half - corner + corner * np.sin(edge_angle[below])
        width[below] = (corner * (high - low))[below]
    lag = 2 * middle * np.tan(np.asarray(helices))[:, None] / diameter
    return Discs(radius, edge_angle, width, np.asarray(angles)[:, None] - lag, np.zeros((len(angles), len(middle))))


def grows(discs: Discs, cut: Cut, structure: Structure, speed: float, steps: int = STEPS) -> float:
    """Return the growth (log) of a vibration per revolution of so many steps, at a speed in rad/s."""
    motion = _run(
        discs.radius, discs.edge_angle, discs.width, discs.angle, discs.offset,
        np.array([cut.tangential, cut.radial, cut.axial, cut.feed, cut.low, cut.high, cut.rubbing]),
        np.array([*cut.powers, cut.unit, cut.round_edge]),
        structure.poles, structure.right, structure.left, speed, steps, TURNS,
    )  # fmt: skip
    turns = np.linalg.norm(motion.reshape(TURNS, -1), axis=1)
    later = np.arange(TURNS // 2, TURNS)
    return float(np.polyfit(later, np.log(np.maximum(turns[later], 1e-300)), 1)[0])


@numba.njit(cache=False)
def _pass(angle, offset, feed, tooth, disc, sine):  # type: ignore[no-untyped-def]
    """Angle back to the pass that left the surface, and the rigid chip that remains."""
    least, ahead = 1e9, 0.0
    for other in range(len(angle)):
        turned = (angle[other, disc] - angle[tooth, disc]) % (2 * math.pi)
        if turned < 1e-9:
            turned = 2 * math.pi
        rigid = feed * turned / (2 * math.pi) * sine + offset[tooth, disc] - offset[other, disc]
        if rigid < least:
            least, ahead = rigid, turned
    return ahead, least


@numba.njit(cache=False)
def _force(radius, edge_angle, width, angle, offset, cut, law, speed, steps, turned, motion, here, velocity):  # type: ignore[no-untyped-def]
    """Force of all edges at one instant; ``motion[here]`` is the tool's position now.

    A force ``K h (h / unit)^-m`` changes by ``(1 - m) K (h / unit)^-m`` per chip.
    """
    feed, low, high, rubbing = cut[3:]
    slopes = np.zeros(3)
    total = np.zeros(3)
    for d in range(len(radius)):
        sine_edge, cosine_edge = math.sin(edge_angle[d]), math.cos(edge_angle[d])
        for tooth in range(len(angle)):
            sine, cosine = math.sin(turned + angle[tooth, d]), math.cos(turned + angle[tooth, d])
            if sine <= 0.0 or radius[d] * cosine < low or radius[d] * cosine > high:
                continue
            ahead, rigid = _pass(angle, offset, feed, tooth, d, sine)
            if rigid <= 0.0:
                continue
            chip = max(rigid * sine_edge, law[4]) / law[3]
            for k in range(3):
                slopes[k] = cut[k] * (1 - law[k]) * chip ** -law[k]
            tangential, radial, axial = slopes
            normal = np.array([sine * sine_edge, cosine * sine_edge, -cosine_edge])
            back = here - ahead / (2 * math.pi / steps)
            whole = math.floor(back)
            before = (1 + whole - back) * motion[whole] + (back - whole) * motion[whole + 1]
            area = width[d] * (normal * (motion[here] - before)).sum()
            rub = rubbing * width[d] * (normal * velocity).sum() / (speed * radius[d])
            inplane = (radial * area + rub) * sine_edge + axial * area * cosine_edge
            total[0] += -tangential * area * cosine - inplane * sine
            total[1] += tangential * area * sine - inplane * cosine
            total[2] += (radial * area + rub) * cosine_edge - axial * area * sine_edge
    return total


@numba.njit(cache=False)
def _run(radius, edge_angle, width, angle, offset, cut, law, poles, right, left, speed, steps, turns):  # type: ignore[no-untyped-def]
    step = 2 * math.pi / steps
    decay = np.exp(poles * step / speed)
    push = (decay - 1) / poles
    motion = np.zeros((steps * turns + steps + 2, 3))  # a revolution at rest comes first
    state = np.full(len(poles), 1e-9 / np.abs(right).max() + 0j)
    force = np.zeros(3)
    for i in range(steps * turns):
        here = i + steps + 1
        for half in range(2):  # Heun: once with the force before, once with the mean of both
            pushed = left @ force.astype(np.complex128)
            trial = decay * state + push * pushed
            motion[here] = 2 * np.real(trial @ right)
            velocity = 2 * np.real((poles * trial + pushed) @ right)
            new = _force(
                radius, edge_angle, width, angle, offset, cut, law, speed, steps, (i + 1) * step, motion, here, velocity
            )  # fmt: skip
            force = 0.5 * (force + new) if half == 0 else new
        state = trial
    return motion[steps + 1 : steps * turns + steps + 1]
