"""Seconds of the optimisation of a tool path on the KUKA, and the least that its limits cost.

Run it: `python benchmarks/path_speed.py [NUMBER OF POINTS] [RPM]`. The floor is the number of limits that the result
states, before and after, times the seconds of one of them. What lies above it is the choice. Processor seconds count
all processes: on two free cores the run takes about half of them, on a busy machine it takes longer.
"""

import resource
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from math import pi

import numpy as np

from cutting import MillingProcess, force_harmonics
from millfrf.robot.along_path import Loading, PathCut, PathOptimum, Request, Wanted, optimised, values_of
from robot_model import (
    Payload,
    Redundancy,
    attitudes_along,
    close_loops,
    cut_path,
    named_posture,
    read_spatial_robot,
)

CUT = MillingProcess(2, 0.012, pi / 2, 600e6, 0.3, 0.1, pi / 2, pi, 1e-4)
"""Aluminium, half immersion down: assumed."""


def run(points: int, rpm: float, robot: str = "kuka_kr90_angled") -> tuple[PathOptimum, PathCut]:
    """Optimise a straight path of 0.6 m for depth: 24 turns about the tool, two processes."""
    case = read_spatial_robot(robot)
    line = np.column_stack([np.linspace(1.4, 2.0, points), np.full(points, 0.1), np.full(points, 0.7)])
    path = cut_path(line, attitudes_along(np.tile([0.0, 0, -1], (points, 1))))
    free = Redundancy(np.radians(np.arange(-180.0, 180, 15)), np.zeros(1), limit_margin=np.radians(5))
    wrenches = np.zeros((points, 6))
    wrenches[:, :3] = 2e-3 * force_harmonics(CUT, 0)[0].real
    cut = PathCut(case.robot, CUT, rpm * pi / 30, 0.02, Payload())
    start = close_loops(case.robot.mechanism, named_posture(case, None))
    wanted = Wanted("depth", 0.5, np.radians(15), np.radians(10))
    with ProcessPoolExecutor(2) as pool:
        found = optimised(cut, path, free, Loading(wrenches, "all"), wanted, start, pool)
    return found, replace(cut, highest_frequency=found.kept.highest_frequency)


def processor_seconds() -> float:
    """Seconds of this process and of those that have ended."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def main(points: int = 200, rpm: float = 3000.0) -> float:
    """Print the seconds; returns processor seconds."""
    started, used = time.perf_counter(), processor_seconds()
    found, cut = run(points, rpm)
    taken, used = time.perf_counter() - started, processor_seconds() - used
    state = found.after
    some = range(0, points, max(1, points // 10))
    requests = [Request(state.q[k], state.axes[k], np.zeros(6)) for k in some]
    begun = time.process_time()
    values_of(cut, requests)
    each = (time.process_time() - begun) / len(requests)
    screened, certified = found.evaluated
    print(f"{points} points at {rpm:g} rpm: {taken:.1f} s, {points / taken:.1f} points/s; {used:.1f} processor seconds")
    print(f"{screened} postures screened, {certified} certified, modes up to {found.kept.highest_frequency:.0f} Hz")
    print(
        f"one limit takes {1e3 * each:.0f} ms: {2 * points} limits before and after are {2 * points * each:.1f} s of it"
    )
    print(f"on two free cores about {used / 2:.1f} s; the floor there is {points * each:.1f} s")
    before, after = (one.values.known_depth(0.02).min() for one in (found.before, state))
    print(f"smallest depth limit {1e3 * before:.2f} mm before, {1e3 * after:.2f} mm after")
    return used


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200, float(sys.argv[2]) if len(sys.argv) > 2 else 3000.0)
