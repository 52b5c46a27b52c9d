"""What a sequence of postures is chosen for: depth, deviation, or both on a front between them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError
from millfrf.robot_model import PostureSequence, best_sequence

Real = NDArray[np.float64]

OBJECTIVES = ("depth", "deviation", "both")

LEVELS = 9
"""Depths of the front between the two single optima."""

_SLACK = 0.02
"""Share of the bottleneck that may be given up for less motion."""

_MOTION = 0.1
"""Weight of squared steps against the cost of a node."""


@dataclass(frozen=True)
class Costs:
    """Depth and deviation (m), joint values over the largest steps, and squared turns of the nodes of each point."""

    depth: Sequence[Real]
    deviation: Sequence[Real]
    nodes: Sequence[Real]
    turned: Sequence[Real]


@dataclass(frozen=True)
class FrontPoint:
    """Smallest depth (m) and largest deviation (m) along one sequence of the front, by the screening's values."""

    depth: float
    deviation: float


def chosen_sequence(costs: Costs, objective: str, balance: float) -> tuple[PostureSequence, tuple[FrontPoint, ...]]:
    """Find the sequence for an objective, and the front where both count.

    ``depth``: the smallest depth limit along the path as large as possible. ``deviation``: the largest deviation as
    small as possible. ``both``: for depths between those of the two, the smallest largest deviation among postures
    that allow the depth (epsilon constraint); of these, with depth and deviation scaled to 0 ... 1 between the single
    optima, the smallest ``balance (1 - depth) + (1 - balance) deviation``.

    Raises
    ------
    InputError
        No continuous sequence exists.
    """
    deepest = _found([-depth for depth in costs.depth], costs)
    if objective == "depth":
        return deepest, ()
    stiffest = _found(costs.deviation, costs)
    if objective == "deviation":
        return stiffest, ()
    top, bottom = -deepest.bottleneck, _along(costs.depth, stiffest).min()
    sequences = [stiffest]
    for level in np.linspace(bottom, top, LEVELS)[1:]:
        limited = [
            np.where(depth >= level * (1 - 1e-9), moved, np.inf)
            for depth, moved in zip(costs.depth, costs.deviation, strict=True)
        ]
        sequences.append(best_sequence(limited, costs.nodes, motion=_MOTION, extra=costs.turned))
    sequences = [one for one in sequences if len(one.chosen)]
    front = tuple(
        FrontPoint(float(_along(costs.depth, one).min()), float(_along(costs.deviation, one).max()))
        for one in sequences
    )
    return sequences[_balanced(front, balance)], tuple(dict.fromkeys(front))


def _balanced(front: Sequence[FrontPoint], balance: float) -> int:
    depth, moved = np.array([one.depth for one in front]), np.array([one.deviation for one in front])
    score = balance * (1 - _scaled(depth)) + (1 - balance) * _scaled(moved)
    return int(np.argmin(score))


def _scaled(values: Real) -> Real:
    width = float(np.ptp(values))
    return np.asarray((values - values.min()) / width) if width > 0 else np.zeros_like(values)


def _along(values: Sequence[Real], sequence: PostureSequence) -> Real:
    return np.array([float(column[i]) for column, i in zip(values, sequence.chosen, strict=True)])


def _found(values: Sequence[Real], costs: Costs) -> PostureSequence:
    """Best sequence for one cost; a little of the bottleneck is given up for less motion of the joints."""
    hard = best_sequence(values, costs.nodes)
    if not len(hard.chosen):
        raise InputError(
            f"no continuous sequence of postures leads past point {hard.reached + 1} of {len(values)}: allow larger "
            "--joint-step, less --limit-margin or more --turns, or move the path"
        )
    return best_sequence(values, costs.nodes, slack=_SLACK * abs(hard.bottleneck), motion=_MOTION, extra=costs.turned)
