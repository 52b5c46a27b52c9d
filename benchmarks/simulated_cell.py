"""How much faster than real time the simulated cell is: 10240 Hz, six channels, noise and all.

Run ``python benchmarks/simulated_cell.py [seconds]``. The first run compiles (not counted).
"""

import sys
import time
from dataclasses import replace
from math import pi

from millfrf.cutting import MillingProcess
from replay_data import HammerCell, LinearSweep, MillingCell, default_structure

RPM = pi / 30


def run_through(cell: MillingCell | HammerCell) -> float:
    """Seconds it takes to read every block of the cell."""
    begin = time.perf_counter()
    cell.open()
    while cell.read() is not None:
        pass
    cell.close()
    return time.perf_counter() - begin


def main(duration: float) -> None:
    """Print the ratio of recorded to elapsed time per kind of test."""
    structure = default_structure()
    down = MillingProcess(2, 12.7e-3, pi / 2, 119e6, 0.17, 0.33, 0.77 * pi, pi, 0.15e-3, runout=10e-6)
    slot = replace(down, start_angle=0.0)
    sweep = LinearSweep(450 * RPM, 690 * RPM, duration)
    cells: dict[str, MillingCell | HammerCell] = {
        "speed sweep, down-milling, 2 mm": MillingCell(structure, down, 2e-3, sweep, duration),
        "porous, full immersion, 2 mm": MillingCell(structure, slot, 2e-3, 820 * RPM, duration, material="porous"),
        "sweep, 4 steps per sample": MillingCell(structure, down, 2e-3, sweep, duration, oversampling=4),
        "hammer, nine channels": HammerCell(structure, taps=max(round(duration / 12), 1)),
    }
    for cell in (
        MillingCell(structure, down, 2e-3, sweep, 0.1),
        MillingCell(structure, slot, 2e-3, 820 * RPM, 0.1, material="porous"),
        HammerCell(structure, taps=1, spacing=0.2),
    ):
        run_through(cell)
    for name, cell in cells.items():
        recorded = cell.n_samples / cell.sample_rate
        elapsed = run_through(cell)
        print(f"{name:34s} {recorded:6.1f} s recorded in {elapsed:6.2f} s: {recorded / elapsed:6.1f} x real time")


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 60.0)
