"""`millfrf robot learn --next`: the postures that are most worth measuring next."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from millfrf.core import InputError
from millfrf.robot_model import LearnedPostures, SpatialCase, choose_postures, named_posture, shown_values, tool_down

from ...progress import bar
from ...tables import Table, show
from ...terminal import say
from ..asked_loads import check_axis, check_places
from ..postures import solve_place

Real = NDArray[np.float64]

CANDIDATES, TARGETS = 40, 20
"""Postures that are offered, and postures whose predictions count."""

BEYOND = 0.1
"""Share of the measured joints' range that is added at either end where no area is asked for."""


@dataclass(frozen=True)
class WorkArea:
    """Area of a vertical tool as typed: ``LO HI N`` along x and y, and its height, m."""

    x: tuple[float, float, int]
    y: tuple[float, float, int]
    z: float


def show_next_postures(case: SpatialCase, learned: LearnedPostures, count: int, area: WorkArea | None) -> None:
    """Print the postures to measure next, and what each is expected to be worth.

    Raises
    ------
    InputError
        A number of postures that cannot be, or an area of which the robot reaches nothing.
    """
    if not 1 <= count <= 12:
        raise InputError(f"--next {count}: give 1 to 12 postures")
    offered = _in_joint_range(learned) if area is None else _in_area(case, area)
    with bar("choosing postures"):
        chosen = choose_postures(learned, offered[:CANDIDATES], offered[-TARGETS:], min(count, len(offered)))
    mechanism = case.robot.mechanism
    rows = tuple(
        (str(i), shown_values(mechanism, one.driven), f"{100 * one.before:.2g}", f"{100 * one.after:.2g}")
        for i, one in enumerate(chosen, 1)
    )
    columns = ("", "posture", "error before (%)", "error after (%)")
    show(Table("Measure next: standard error of the lowest modes' peaks over the area", columns, rows))
    if area is None:
        say("area: the measured joints' range and a tenth beyond it; --x, --y and --z ask for another")


def _in_joint_range(learned: LearnedPostures) -> Real:
    """Postures over the range of the measured ones, evenly (Sobol), (n, n_active)."""
    driven = np.array([one.driven for one in learned.measured])
    low, high = driven.min(axis=0), driven.max(axis=0)
    beyond = BEYOND * (high - low)
    frames = [learned.robot.mechanism.frames[i] for i in learned.robot.mechanism.moving]
    limits = np.array([(frame.lower, frame.upper) for frame in frames if frame.active])
    low, high = np.maximum(low - beyond, limits[:, 0]), np.minimum(high + beyond, limits[:, 1])
    even = qmc.Sobol(len(low), seed=0).random(64)[: CANDIDATES + TARGETS]
    return np.asarray(low + even * (high - low))


def _in_area(case: SpatialCase, area: WorkArea) -> Real:
    """Postures of the places that the robot reaches, in an order that mixes them, (n, n_active)."""
    check_axis("x", area.x)
    check_axis("y", area.y)
    check_places(z=area.z)
    found = []
    start = named_posture(case, None)
    for x in np.linspace(*area.x):
        for y in np.linspace(*area.y):
            try:
                found.append(solve_place(case.robot, tool_down([x, y, area.z]), start))
            except InputError:
                continue
    if not found:
        raise InputError("no place of the area is reached; move --x, --y or --z")
    return np.array(found)[np.random.default_rng(0).permutation(len(found))]
