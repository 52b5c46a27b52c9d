"""Stability on a grid and traced, against a plain semi-discretisation: `python -m benchmarks.lobe_speed`.

The 1-DOF milling benchmark (922 Hz, two teeth), a/D = 1 and 0.05 down-milling, 200 speeds x 100 depths. The baseline is
first-order semi-discretisation in plain numpy (`plain_semi_discretisation.py`), all depths of a speed in one batch,
full eigenvalues. Ours is `stability.stability_grid`, exact to six digits, and `stability.trace_boundary` to 0.1 % of
depth. BLAS threads are pinned to one, so that the baseline runs on one core; ours is given on one core and on all.
Every figure of
ours is the best of seven, of the baseline of two; compiled code is loaded before, and that time is given apart.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import time
from collections.abc import Callable
from math import acos, pi
from typing import Any

import numpy as np

from benchmarks.plain_semi_discretisation import spectral_radii
from millfrf.cutting import MillingProcess
from millfrf.stability import certified_lobes, collocation
from millfrf.stability.solvers.boundary import stability_grid, trace_boundary
from modal_fit import ModalModel
from replay_data import table_one_model

OMEGA, ZETA, MASS, KT, KN = 2 * pi * 922, 0.011, 0.03993, 6e8, 2e8
SPEEDS = np.linspace(5000, 25000, 200) * pi / 30
TABLE_1 = MillingProcess(2, 0.0127, pi / 2, 119e6, 0.17, 0.33, pi / 2, pi, 1.5e-4)


def model() -> ModalModel:
    """One mode in X."""
    damped = OMEGA * np.sqrt(1 - ZETA**2)
    pole = np.array([-ZETA * OMEGA + 1j * damped])
    return ModalModel(pole, np.ones((1, 1)) + 0j, np.array([[1 / (2j * MASS * damped)]]), ("TCP:+X",), ("TCP:+X",))


def timed(job: Callable[..., Any], *arguments: Any, repeats: int = 7, **options: Any) -> tuple[float, Any]:
    """Seconds, the best of some repeats, and the result."""
    best, result = np.inf, None
    for _ in range(repeats):
        started = time.perf_counter()
        result = job(*arguments, **options)
        best = min(best, time.perf_counter() - started)
    return best, result


def processor(job: Callable[..., Any], *arguments: Any) -> tuple[float, Any]:
    """Seconds of processor time, the better of two repeats after a first that loads compiled code, and the result."""
    best, result = np.inf, job(*arguments)
    for _ in range(2):
        started = time.process_time()
        result = job(*arguments)
        best = min(best, time.process_time() - started)
    return best, result


def main() -> None:
    """Print the ratios."""
    cores = os.cpu_count() or 1
    loading, _ = timed(stability_grid, model(), TABLE_1, SPEEDS[:1], np.array([1e-3]), repeats=1)
    print(f"compiled code loaded (or made, at the very first run) in {loading:.2f} s; {cores} cores\n")
    heads = ("200 x 100", "baseline", "grid", "ratio", f"on {cores} cores", "ratio", "differ", "traced", "speeds")
    print("{:>12s} {:>10s} {:>8s} {:>7s} {:>11s} {:>7s} {:>8s} {:>8s} {:>7s}".format(*heads))
    for share, deepest in ((1.0, 5e-3), (0.05, 12e-3)):
        depths = np.linspace(deepest / 100, deepest, 100)
        start = acos(2 * share - 1)
        cut = MillingProcess(2, 0.01, pi / 2, KT, KN / KT, 0.0, start, pi, 1e-4)
        slow, radii = timed(spectral_radii, OMEGA, ZETA, MASS, (KT, KN, 2), (start, pi), SPEEDS, depths, repeats=2)
        single, grid = timed(stability_grid, model(), cut, SPEEDS, depths, threads=1)
        fast, _ = timed(stability_grid, model(), cut, SPEEDS, depths)
        traced, boundary = timed(trace_boundary, model(), cut, SPEEDS[0], SPEEDS[-1], deepest)
        differ = 100 * np.mean((grid.unstable_multipliers == 0) != (radii < 1))
        print(
            f"{f'a/D = {share:g}':>12s} {slow:8.2f} s {single:6.3f} s {slow / single:7.1f} {fast:9.3f} s "
            f"{slow / fast:7.1f} {differ:7.2f}% {traced:6.2f} s {boundary.evaluations:7d}",
            flush=True,
        )
        plain, _ = processor(collocation, model(), cut, SPEEDS, deepest)
        sure, lobes = processor(certified_lobes, model(), cut, SPEEDS, deepest)
        print(
            f"{'':>12s} lowest limits: {plain:.2f} s, with verification {sure:.2f} s of processor time "
            f"({sure / plain:.1f} times); {lobes.status.count('verified')} of {len(SPEEDS)} verified",
            flush=True,
        )
    traced, boundary = timed(trace_boundary, table_one_model(), TABLE_1, 600 * pi / 30, 2200 * pi / 30, 8e-3)
    print(f"Table 1, two modes in three directions, traced: {traced:.2f} s, {boundary.evaluations} speeds")


if __name__ == "__main__":
    main()
