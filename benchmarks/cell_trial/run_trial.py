"""The one command: ``python -m benchmarks.cell_trial.run_trial --out DIR [--cells 100] [--seed 1] [--workers 1]``.

Per cell: recordings and taps of a random robot are simulated, the public commands make lobes and a report of them, and
the recommended cut is judged. Started again, it goes on where it was. ``DIR/results.md`` has the table.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse
import json
import shutil
import tempfile
import time
import traceback
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from .chain import Outcome, run_chain
from .judge import lowest_limit, radius, rpm, simulated
from .recordings import write_cell
from .robot_cell import Cell, draw_cell
from .scoring import table_of


def run_cell(number: int, seed: int, kept: Path | None = None) -> dict[str, Any]:
    """Simulate, run the chain, judge; ``kept`` is a folder that keeps the files."""
    began = time.process_time()
    cell = draw_cell(number, seed)
    folder = kept or Path(tempfile.mkdtemp(prefix="cell_"))
    folder.mkdir(parents=True, exist_ok=True)
    try:
        depth = write_cell(cell, folder, seed + 1000 * number)
        simulated_in = time.process_time() - began
        outcome = run_chain(cell, folder)
    finally:
        if kept is None:
            shutil.rmtree(folder)
    result = {
        "number": number,
        **cell.about,
        "cut": vars(cell.cut),
        "speeds_rpm": cell.speeds_rpm,
        "max_depth": cell.max_depth,
        "swept_depth": depth,
        **vars(outcome),
        **judged(cell, outcome),
    }
    return result | {"simulation_seconds": simulated_in, "all_seconds": time.process_time() - began}


def judged(cell: Cell, outcome: Outcome) -> dict[str, Any]:
    """Compare limits and advice with the truth.

    Limits are compared for the coefficients of the cutting file; the advice with the true ones.
    """
    speeds = np.linspace(*cell.speeds_rpm, 24)
    deepest = cell.max_depth
    true = [lowest_limit(cell.in_cut, cell.cut, float(rpm(speed)), deepest) for speed in speeds]
    best = max(min(limit, deepest) * speed for limit, speed in zip(true, speeds, strict=True))
    compared = [
        (*row, lowest_limit(cell.in_cut, cell.stated, float(rpm(row[0])), 2 * deepest)) for row in outcome.limits
    ]
    result: dict[str, Any] = {"true_limits": true, "best_removal": best, "compared": compared}
    if outcome.advice is not None:
        speed, depth = outcome.advice
        at = float(rpm(speed))
        result |= {
            "radius": radius(cell.in_cut, cell.cut, at, depth),
            "radius_finer": radius(cell.in_cut, cell.cut, at, depth, finer=2),
            "true_limit": lowest_limit(cell.in_cut, cell.cut, at, max(2 * depth, deepest)),
            "drifted": [radius(cell.in_cut, cell.cut, at * share, depth) for share in (0.98, 1.02)],
            "in_time": vars(run := simulated(cell.in_cut, cell.cut, at, depth)) | {"stable": run.stable},
            "share_of_best": depth * speed / best,
        }
    return result


def _kept(number: int, seed: int, out: Path, keep: bool) -> str:
    place = out / f"cell_{number:03d}.json"
    if place.exists():
        return ""
    try:
        result = run_cell(number, seed, out / f"cell_{number:03d}" if keep else None)
    except Exception:
        result = {"number": number, "crashed": traceback.format_exc()}
    place.write_text(json.dumps(result, indent=1, default=float) + "\n", encoding="utf-8")
    return f"{number:3d} {result.get('advice')} {result.get('share_of_best', result.get('reason', ''))}"


def main() -> None:
    """Run what has not been run, then print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--cells", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--keep", action="store_true", help="Keep recordings and results of each cell.")
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    task = partial(_kept, seed=asked.seed, out=asked.out, keep=asked.keep)
    numbers = range(asked.first, asked.first + asked.cells)
    with ProcessPoolExecutor(asked.workers) as pool:
        for line in pool.map(task, numbers):
            print(line, flush=True)
    results = [json.loads(place.read_text(encoding="utf-8")) for place in sorted(asked.out.glob("cell_*.json"))]
    text = table_of(results)
    (asked.out / "results.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
