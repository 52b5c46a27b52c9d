"""Stability on a grid and traced, against a plain semi-discretisation: `python benchmarks/lobe_speed.py`.

The 1-DOF milling benchmark (922 Hz, two teeth), a/D = 1 and 0.05 down-milling, 200 speeds x 100 depths. The baseline is
first-order semi-discretisation in plain numpy (`plain_semi_discretisation.py`), all depths of a speed in one batch,
full eigenvalues. Ours is `stability.stability_grid`, exact to six digits, and `stability.trace_boundary` to 0.1 % of
depth. BLAS threads are pinned to one; ours uses one thread a core for the grid.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import time
from collections.abc import Callable
from math import acos, pi
from typing import Any

import numpy as np
from plain_semi_discretisation import spectral_radii

from cutting import MillingProcess
from modal_fit import ModalModel
from replay_data import table_one_model
from stability import stability_grid, trace_boundary

OMEGA, ZETA, MASS, KT, KN = 2 * pi * 922, 0.011, 0.03993, 6e8, 2e8
SPEEDS = np.linspace(5000, 25000, 200) * pi / 30


def model() -> ModalModel:
    """One mode in X."""
    damped = OMEGA * np.sqrt(1 - ZETA**2)
    pole = np.array([-ZETA * OMEGA + 1j * damped])
    return ModalModel(pole, np.ones((1, 1)) + 0j, np.array([[1 / (2j * MASS * damped)]]), ("TCP:+X",), ("TCP:+X",))


def timed(job: Callable[..., Any], *arguments: Any) -> tuple[float, Any]:
    """Seconds and result."""
    started = time.perf_counter()
    result = job(*arguments)
    return time.perf_counter() - started, result


def main() -> None:
    """Print the ratios."""
    heads = ("200 x 100", "baseline s", "grid s", "ratio", "differ", "traced s", "speeds")
    print("{:>12s} {:>11s} {:>8s} {:>7s} {:>8s} {:>9s} {:>7s}".format(*heads))
    for share, deepest in ((1.0, 5e-3), (0.05, 12e-3)):
        depths = np.linspace(deepest / 100, deepest, 100)
        start = acos(2 * share - 1)
        cut = MillingProcess(2, 0.01, pi / 2, KT, KN / KT, 0.0, start, pi, 1e-4)
        slow, radii = timed(spectral_radii, OMEGA, ZETA, MASS, (KT, KN, 2), (start, pi), SPEEDS, depths)
        fast, grid = timed(stability_grid, model(), cut, SPEEDS, depths)
        traced, boundary = timed(trace_boundary, model(), cut, SPEEDS[0], SPEEDS[-1], deepest)
        differ = 100 * np.mean((grid.unstable_multipliers == 0) != (radii < 1))
        name = f"a/D = {share:g}"
        print(
            f"{name:>12s} {slow:11.2f} {fast:8.2f} {slow / fast:7.1f} {differ:7.2f}% {traced:9.2f} "
            f"{boundary.evaluations:7d}",
            flush=True,
        )
    half = MillingProcess(2, 0.0127, pi / 2, 119e6, 0.17, 0.33, pi / 2, pi, 1.5e-4)
    traced, boundary = timed(trace_boundary, table_one_model(), half, 600 * pi / 30, 2200 * pi / 30, 8e-3)
    print(f"Table 1, two modes in three directions, traced: {traced:.2f} s, {boundary.evaluations} speeds")


if __name__ == "__main__":
    main()
