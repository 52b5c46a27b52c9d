"""Both redundancies of a milling robot, one by one and along a whole path.

Run it: `python examples/robot_path.py [NUMBER OF POINTS] [PICTURE.png]`. The questions are those of Mousavi et al.:
what do the first redundancy (the robot turns about the tool's axis) and the second (tool and work turn together about
the feed) do to the depth limit, and what do both do along a path? A spindle in line with the last joint makes the
first one worthless: joint 6 turns, and nothing else. Across the flange it moves the whole arm.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from math import pi
from pathlib import Path

import numpy as np

from millfrf.cutting import MillingProcess, force_harmonics
from millfrf.figures import save_figure
from millfrf.robot_model import (
    CutPath,
    Payload,
    Redundancy,
    RotaryTable,
    attitudes_along,
    close_loops,
    cut_path,
    named_posture,
    read_spatial_robot,
    tool_down,
    turned_place,
)
from millfrf.steps.robot.along_path.optimum import PathOptimum, optimise_postures
from millfrf.steps.robot.along_path.results import path_figure
from millfrf.steps.robot.along_path.search import PathGoal
from millfrf.steps.robot.along_path.state import Loading
from millfrf.steps.robot.along_path.values import PathCut
from millfrf.steps.robot.maps import certified_over_places, first_postures

CUT = MillingProcess(2, 0.012, pi / 2, 600e6, 0.3, 0.1, pi / 2, pi, 1e-4)
"""Aluminium, half immersion down: assumed, Table 4 of the paper is missing."""

SPEED = 6000 * pi / 30
MAX_DEPTH = 0.02
ANGLES = np.radians(np.arange(-90.0, 91, 30))


def over_angles(robot: str, redundancy: str) -> np.ndarray:
    """Depth limits of a cut at (1.6, 0.1, 0.7) m over seven angles, m; NaN where the place is not reached."""
    case = read_spatial_robot(robot)
    places = [turned_place(tool_down([1.6, 0.1, 0.7]), float(angle), redundancy) for angle in ANGLES]
    cut = PathCut(case.robot, CUT, SPEED, MAX_DEPTH, Payload())
    values, _ = certified_over_places(cut, places, first_postures(case.robot, places))
    return np.minimum(values.depth, MAX_DEPTH)


def straight(points: int) -> CutPath:
    """A path of 0.3 m along the base's x, tool down."""
    line = np.column_stack([np.linspace(1.5, 1.8, points), np.full(points, 0.1), np.full(points, 0.7)])
    return cut_path(line, attitudes_along(np.tile([0.0, 0, -1], (points, 1))))


def along(path: CutPath, turns: np.ndarray, table: np.ndarray) -> PathOptimum:
    """The best postures of a path over turns about the tool and of a table about the feed, degrees."""
    case = read_spatial_robot("kuka_kr90_angled")
    axis = RotaryTable(path.positions[0], np.array([1.0, 0.0, 0.0]))
    free = Redundancy(np.radians(turns), np.radians(table), axis, np.radians(5))
    wrenches = np.zeros((len(path.places), 6))
    wrenches[:, :3] = 2e-3 * force_harmonics(CUT, 0)[0].real
    start = close_loops(case.robot.mechanism, named_posture(case, None))
    cut = PathCut(case.robot, CUT, SPEED, MAX_DEPTH, Payload())
    wanted = PathGoal("depth", 0.5, np.radians(15), np.radians(10))
    with ProcessPoolExecutor(2) as pool:
        return optimise_postures(cut, path, free, Loading(wrenches, "all"), wanted, start, pool)


def main(points: int = 6, picture: Path | None = None) -> dict[str, float]:
    """Print the tables; returns the smallest depth limit along the path for each use of the redundancies, m."""
    print("depth limit (mm) over", ", ".join(f"{angle:.0f}" for angle in np.degrees(ANGLES)), "degrees")
    for robot in ("kuka_kr90_r3100", "kuka_kr90_angled"):
        for redundancy, words in (("tool", "about the tool"), ("table", "table about the feed")):
            limits = 1e3 * over_angles(robot, redundancy)
            print(f"{robot:18s} {words:22s}", " ".join("  --  " if np.isnan(v) else f"{v:6.2f}" for v in limits))
    path, outcome = straight(points), {}
    for name, turns, table in (
        ("tool", np.arange(-150.0, 31, 30), np.zeros(1)),
        ("table", np.zeros(1), np.arange(-40.0, 41, 20)),
        ("both", np.arange(-150.0, 31, 30), np.arange(-40.0, 41, 20)),
    ):
        result = along(path, turns, table)
        limits = result.after.values.known_depth(MAX_DEPTH)
        outcome["none"] = float(result.before.values.known_depth(MAX_DEPTH).min())
        outcome[name] = float(limits.min())
        print(
            f"along {points} points, {name}: at least {1e3 * outcome[name]:.2f} mm, "
            f"unturned {1e3 * outcome['none']:.2f} mm"
        )
        if picture is not None and name == "both":
            save_figure(path_figure(path, result.before, result.after, MAX_DEPTH, None), picture)
    return outcome


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 6, Path(sys.argv[2]) if len(sys.argv) > 2 else None)
