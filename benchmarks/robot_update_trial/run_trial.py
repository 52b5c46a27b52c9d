"""The one command: ``python -m benchmarks.robot_update_trial.run_trial --out DIR [--cases 60] [--seed 1]``.

Per case: a cell with something wrong is simulated in five postures, its FRFs are estimated from recordings with 2 %
noise, four of them update the robot's file, and the updated file predicts the fifth. Started again, it goes on where it
was. ``DIR/results.md`` tells names, coverage, errors and verdicts by kind of case.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition import Channel
from estimation import BandRecording, Frf, local_polynomial
from millfrf.core import TIP
from millfrf.robot_model import measured_frf, read_spatial_robot, update_robot, updated_document
from millfrf.robot_model.files.robot_files import robot_text
from millfrf.robot_model.spatial.spatial_modes import frf_at

from .cases import Case, draw_case
from .independent_cell import cell_at, read_tables, recorded
from .scoring import table_of

ROBOT = "kuka_kr90_r3100"
SECONDS, RATE, NOISE = 30.0, 320.0, 0.02
BAND = (6.0, 110.0)


def run_case(case: Case, number: int, seed: int, folder: Path) -> dict[str, Any]:
    """Simulate, estimate, update, and predict the posture that was never given."""
    began = time.perf_counter()
    tables, robot = read_tables(robot_text(ROBOT)), read_spatial_robot(ROBOT)
    generator = np.random.default_rng([seed, number, 1])
    frfs = [_estimated(tables, case, q, generator) for q in case.postures]
    measured = [
        measured_frf(frf, f"posture {i + 1}", q, BAND)
        for i, (frf, q) in enumerate(zip(frfs, case.postures, strict=True))
    ]
    result = update_robot(robot.robot, measured[:-1], robot.poses, plan=False)
    file = folder / f"updated_{number:03d}.toml"
    file.write_text(updated_document(robot_text(ROBOT), robot.robot, result), encoding="utf-8")
    last, unseen = measured[-1], {}
    for name, model in (("filed", robot.robot), ("updated", read_spatial_robot(file).robot)):
        error = last.whitened(frf_at(model, last.q, last.frequencies).values - last.values)
        unseen[name] = float(np.sqrt(error @ error / last.count))
    names = [each.name for each in result.parameters]
    expected = np.array([case.expected.get(name, 0.0) for name in names])
    return {
        "number": number,
        "kind": case.kind,
        "foreign": case.foreign,
        "verdict": result.verdict,
        "named": list(result.names),
        "wrong_names": [name for name in result.names if not case.expected.get(name)],
        "expected": case.expected,
        "numbers": [
            {"name": n, "x": float(x), "expected": float(t), "error": float(e), "told": bool(k)}
            for n, x, t, e, k in zip(names, result.x, expected, result.errors, result.determined, strict=True)
        ],
        "held_out": [[each.before, each.after] for each in result.held_out],
        "unseen": unseen,
        "noise": result.noise,
        "modes_off": result.modes_off,
        "open": [each.sentence for each in result.open],
        "seconds": time.perf_counter() - began,
    }


def _estimated(tables: dict[str, Any], case: Case, q: NDArray[np.float64], generator: np.random.Generator) -> Frf:
    force, motion = recorded(cell_at(tables, q, case.truth), SECONDS, RATE, NOISE, generator)
    inputs = tuple(Channel(f"F{d}", "force", "N", "TCP", f"+{d}") for d in "XYZ")
    outputs = tuple(Channel(f"X{d}", "displacement", "m", "TCP", f"+{d}") for d in "XYZ")
    assert tuple(f"TCP:+{d}" for d in "XYZ") == TIP
    # the first seconds are left out: the cell starts at rest
    skip = int(2 * RATE)
    return local_polynomial([BandRecording("cell", RATE, force[skip:], motion[skip:], inputs, outputs)], BAND)


def main() -> None:
    """Run what has not been run, then print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--cases", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--order", type=int, default=1, help="Step through the kinds: coprime to 60, such as 7.")
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    for step in range(asked.cases):
        number = step * asked.order % asked.cases
        place = asked.out / f"case_{number:03d}.json"
        if not place.exists():
            result = run_case(draw_case(number, asked.seed), number, asked.seed, asked.out)
            place.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
            names = ", ".join(result["named"]) or "no name"
            print(
                f"{number:3d} {result['kind']:24s} {result['verdict']:18s} {names}; unseen {result['unseen']}",
                flush=True,
            )
    results = [json.loads(place.read_text()) for place in sorted(asked.out.glob("case_*.json"))]
    text = table_of(results)
    (asked.out / "results.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
