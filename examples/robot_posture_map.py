"""Depth limits over postures: the redundancy of a six-joint robot, and a map of 400 places on two processes.

Run it: `python examples/robot_posture_map.py [NUMBER OF PLACES] [PICTURE.png]`. The first table is what Mousavi et al.
show in Fig. 11: at one speed and depth, turning tool and table together decides whether the cut chatters. In the paper
X_0 is vertical and the table turns about Y_0, along which the robot reaches out: about the feed, here. Limits are the
certified ones; the map says at how many places averaged coefficients (zero-order) would promise more.
"""

import sys
import time
from math import pi
from pathlib import Path

import numpy as np

from millfrf.cutting import MillingProcess
from millfrf.figures import save_figure
from millfrf.robot_model import (
    CutPlace,
    PostureMap,
    SpatialRobot,
    modal_model_at,
    read_spatial_robot,
    target_of,
    tool_down,
    wrist_solutions,
)
from millfrf.stability import zero_order
from millfrf.steps.robot.maps import depth_over_places, depth_over_redundancy
from millfrf.steps.robot.pictures import posture_figure

HALF_DOWN = MillingProcess(2, 0.02, pi / 2, 700e6, 0.3, 0.1, pi / 2, pi, 1e-4)
"""Aluminium, assumed: Table 4 of the paper is missing."""

SPEED = 3000 * pi / 30
MAX_DEPTH = 0.02
DEPTH = 4e-3


def redundancy(robot: SpatialRobot, angles_deg: np.ndarray) -> PostureMap:
    """Depth limits of a cut at (1.1, 0, 0.85) m that feeds towards the robot, at 6000 rpm."""
    place = tool_down([1.1, 0.0, 0.85], pi)
    return depth_over_redundancy(robot, place, np.radians(angles_deg), HALF_DOWN, 2 * SPEED, MAX_DEPTH, "table")


def over_redundancy(robot: SpatialRobot, angles_deg: np.ndarray) -> np.ndarray:
    """The same as depth limits alone, m."""
    return redundancy(robot, angles_deg).values


def work_area(count: int) -> list[CutPlace]:
    """About ``count`` places of a vertical tool in front of the robot."""
    side = max(2, round(np.sqrt(count)))
    return [tool_down([x, y, 0.8]) for x in np.linspace(0.5, 1.4, side) for y in np.linspace(-0.7, 0.7, side)]


def averaged(robot: SpatialRobot, places: list[CutPlace]) -> np.ndarray:
    """What the zero-order solution says at the same places, m."""
    limits = np.full(len(places), np.nan)
    for i, place in enumerate(places):
        solutions = wrist_solutions(robot.mechanism, target_of(place))
        if len(solutions):
            model = modal_model_at(robot, solutions[0], axes=place.axes)
            limits[i] = min(MAX_DEPTH, zero_order(model, HALF_DOWN, np.array([SPEED]), MAX_DEPTH).depth_limits[0])
    return limits


def main(count: int = 400, picture: Path | None = None) -> float:
    """Print both; returns the share of places at which averaged coefficients promise a tenth more or above."""
    robot = read_spatial_robot("staubli_rx170").robot
    print("angle (deg)   depth limit (mm)")
    angles = np.arange(-90.0, 91.0, 15.0)
    for angle, limit in zip(angles, over_redundancy(robot, angles), strict=True):
        print(f"{angle:8.0f}      {1e3 * limit:8.2f}   {'4 mm is stable' if limit > DEPTH else '4 mm chatters'}")
    if picture is not None:
        fine = redundancy(robot, np.linspace(-105.0, 105.0, 85))
        save_figure(posture_figure(fine, MAX_DEPTH, DEPTH, "tool and table about the feed"), picture)
    places = work_area(count)
    started = time.perf_counter()
    limits, lowest = depth_over_places(robot, places, HALF_DOWN, SPEED, MAX_DEPTH, workers=2)
    taken = time.perf_counter() - started
    print(f"{len(places)} places, {np.isfinite(limits).sum()} reached: {taken:.1f} s on two processes")
    print(f"lowest frequency {np.nanmin(lowest):.2f} to {np.nanmax(lowest):.2f} Hz")
    ratio = averaged(robot, places) / limits
    ratio = ratio[np.isfinite(ratio)]
    share = float(np.mean(ratio > 1.1))
    print(f"zero-order promises over a tenth more at {100 * share:.0f} % of them, up to {ratio.max():.1f} times")
    return share


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 400, Path(sys.argv[2]) if len(sys.argv) > 2 else None)
