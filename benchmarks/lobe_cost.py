"""Cost of a lobe diagram over modes, directions and resolution: `python benchmarks/lobe_cost.py`.

Processor time on one core, the best of three. The structures are random: `n` modes between
20 and 200 Hz with 2 to 6 % of damping, equally stiff together whatever n, seen in X, in X and Y, or in all directions.
Writes `docs/pictures/lobe_cost.png`.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import time
from collections.abc import Callable
from math import pi
from pathlib import Path

import matplotlib as mpl

from millfrf.core import TIP

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from millfrf.cutting import MillingProcess
from millfrf.stability import collocation_limits
from millfrf.stability.solvers.boundary import trace_boundary
from modal_fit import ModalModel

CUT = MillingProcess(2, 0.0127, pi / 2, 119e6, 0.17, 0.33, pi / 2, pi, 1.5e-4)
LOWEST, HIGHEST, DEEPEST = 2000 * pi / 30, 8000 * pi / 30, 8e-3
PICTURE = Path(__file__).resolve().parent.parent / "docs" / "pictures" / "lobe_cost.png"


def structure(modes: int, directions: int, seed: int = 3) -> ModalModel:
    """Random modes with a static flexibility of 2e-5 m/N together."""
    rng = np.random.default_rng(seed)
    natural = 2 * pi * np.geomspace(200, 20, modes)
    zeta = rng.uniform(0.02, 0.06, modes)
    poles = natural * (-zeta + 1j * np.sqrt(1 - zeta**2))
    shapes = rng.normal(size=(modes, directions))
    shapes /= np.linalg.norm(shapes, axis=1)[:, None]
    flexibility = 2e-5 / modes
    right = shapes * (flexibility * natural**2 / (2j * poles.imag))[:, None]
    return ModalModel(poles, right, shapes + 0j, TIP[:directions], TIP[:directions])


def seconds(job: Callable[[], object]) -> float:
    """Processor time, the best of three."""
    best = np.inf
    for _ in range(3):
        started = time.process_time()
        job()
        best = min(best, time.process_time() - started)
    return best


def over_modes(counts: list[int], directions: int) -> list[float]:
    """Milliseconds a speed."""
    speeds = np.linspace(LOWEST, HIGHEST, 48)
    result = []
    for count in counts:
        model = structure(count, directions)
        result.append(1e3 / len(speeds) * seconds(lambda m=model: collocation_limits(m, CUT, speeds, DEEPEST)))  # type: ignore[misc]
        print(f"{count:3d} modes, {directions} directions: {result[-1]:8.3f} ms a speed", flush=True)
    return result


def over_resolution(counts: list[int], modes: int) -> list[float]:
    """Seconds for a diagram of so many speeds."""
    result = []
    for count in counts:
        speeds = np.linspace(LOWEST, HIGHEST, count)
        model = structure(modes, 3)
        result.append(seconds(lambda m=model, s=speeds: collocation_limits(m, CUT, s, DEEPEST)))  # type: ignore[misc]
        print(f"{count:5d} speeds, {modes} modes: {result[-1]:8.3f} s", flush=True)
    return result


def over_tolerance(tolerances: list[float], modes: int) -> list[float]:
    """Seconds for a traced boundary."""
    result = []
    for tolerance in tolerances:
        model = structure(modes, 3)
        result.append(
            seconds(
                lambda m=model, t=tolerance: trace_boundary(m, CUT, LOWEST, HIGHEST, DEEPEST, tolerance=t, threads=1)  # type: ignore[misc]
            )
        )
        print(f"to {tolerance:g} of depth, {modes} modes: {result[-1]:8.3f} s", flush=True)
    return result


def main() -> None:
    """Measure and draw."""
    over_modes([2], 3)
    styles = (("o", "-"), ("s", "--"), ("^", ":"))
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(12, 3.8), layout="constrained")
    counts = [1, 2, 4, 8, 12, 24]
    for directions, (mark, line), shade in zip((1, 2, 3), styles, ("0.0", "0.35", "0.6"), strict=True):
        label = ("X", "X and Y", "X, Y and Z")[directions - 1]
        left.loglog(counts, over_modes(counts, directions), line, marker=mark, color=shade, label=label)
    left.set(xlabel="modes", ylabel="time for one speed, all limits [ms]", title="modes and directions")
    left.set_xticks(counts, [str(count) for count in counts])
    left.minorticks_off()
    resolutions, tolerances = [25, 50, 100, 200, 400], [1e-2, 3e-3, 1e-3, 3e-4]
    for modes, (mark, line), shade in zip((1, 2, 6), styles, ("0.0", "0.35", "0.6"), strict=True):
        label = "1 mode" if modes == 1 else f"{modes} modes"
        middle.loglog(resolutions, over_resolution(resolutions, modes), line, marker=mark, color=shade, label=label)
        traced = over_tolerance(tolerances, modes)
        right.loglog(np.array(tolerances) * 100, traced, line, marker=mark, color=shade, label=label)
    middle.set(xlabel="spindle speeds", ylabel="time for all speeds and limits [s]", title="resolution, X, Y and Z")
    middle.set_xticks(resolutions, [str(count) for count in resolutions])
    middle.minorticks_off()
    right.set(xlabel="tolerance [% of depth]", ylabel="time for the traced boundary [s]", title="tolerance, X, Y and Z")
    right.invert_xaxis()
    right.set_xticks(np.array(tolerances) * 100, [f"{100 * tolerance:g}" for tolerance in tolerances])
    right.minorticks_off()
    for axes in (left, middle, right):
        axes.grid(True, which="major", color="0.9")
        axes.legend(frameon=False)
    figure.savefig(PICTURE, dpi=110)
    print(PICTURE)


if __name__ == "__main__":
    main()
