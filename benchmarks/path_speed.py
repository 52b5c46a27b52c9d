"""Seconds of `millfrf robot path` on the KUKA, and the least that its limits cost.

Run it: `python benchmarks/path_speed.py [NUMBER OF POINTS] [RPM]`. The floor is the number of limits that the table
states, before and after, times the seconds of one of them; what lies above it is the choice. Processor seconds count
all processes: on two free cores the run takes about half of them, on a busy machine it takes longer.
"""

import re
import resource
import subprocess
import sys
import tempfile
import time
from math import pi
from pathlib import Path

import numpy as np

from millfrf.cutting import MillingProcess, write_cutting_process
from millfrf.robot_model import modal_model_at, read_spatial_robot, target_of, tool_down, turned_place, wrist_solutions
from millfrf.stability import certified_lobes

CUT = MillingProcess(2, 0.012, pi / 2, 600e6, 0.3, 0.1, pi / 2, pi, 1e-4)
"""Aluminium, half immersion down: assumed."""

ROBOT = "kuka_kr90_angled"


def command(folder: Path, points: int, rpm: float) -> tuple[str, float, float]:
    """Optimise a straight path of 0.6 m for depth over 24 turns: what was printed, seconds, processor seconds."""
    rows = "".join(f"{x:.6f},0.1,0.7,0,0,1\n" for x in np.linspace(1.4, 2.0, points))
    (folder / "path.csv").write_text("x_m,y_m,z_m,i,j,k\n" + rows, encoding="utf-8")
    write_cutting_process(folder / "cut.toml", CUT)
    words = f"robot path {ROBOT} path.csv --cutting cut.toml --speed {rpm:g} --depth 0.002 --out out --force"
    started, used = time.perf_counter(), processor_seconds()
    run = subprocess.run(
        [sys.executable, "-m", "millfrf", *words.split()], cwd=folder, capture_output=True, text=True, check=True
    )
    return run.stdout + run.stderr, time.perf_counter() - started, processor_seconds() - used


def processor_seconds() -> float:
    """Seconds of all processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def seconds_of_a_limit(rpm: float, highest_frequency: float, count: int = 10) -> float:
    """Mean processor seconds of one certified limit with the modes that were kept."""
    robot, begun = read_spatial_robot(ROBOT).robot, 0.0
    for k, x in enumerate([1.4, *np.linspace(1.4, 2.0, count)]):
        if k == 1:  # the first one compiles
            begun = time.process_time()
        place = turned_place(tool_down([x, 0.1, 0.7]), -pi / 2, "tool")
        q = wrist_solutions(robot.mechanism, target_of(place))[0]
        model = modal_model_at(robot, q, axes=place.axes, highest_frequency=highest_frequency)
        certified_lobes(model, CUT, np.array([rpm * pi / 30]), 0.02)
    return (time.process_time() - begun) / count


def main(points: int = 200, rpm: float = 3000.0) -> float:
    """Print the seconds; returns processor seconds."""
    with tempfile.TemporaryDirectory() as folder:
        stated, taken, used = command(Path(folder), points, rpm)
    print(stated.strip())
    kept = re.search(r"modes above (\d+) Hz", stated)
    single = seconds_of_a_limit(rpm, float(kept.group(1)) if kept else np.inf)
    print(f"{points} points at {rpm:g} rpm: {taken:.1f} s, {points / taken:.1f} points/s; {used:.1f} processor seconds")
    print(f"one limit takes {1e3 * single:.0f} ms; {2 * points} before and after {2 * points * single:.1f} s of it")
    print(f"on two free cores: about {used / 2:.1f} s, of which the floor is {points * single:.1f} s")
    return used


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200, float(sys.argv[2]) if len(sys.argv) > 2 else 3000.0)
