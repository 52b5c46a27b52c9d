"""Two simulated cuts with a runout that the cutting file does not state; forces then say what the file leaves out.

Run it: `python examples/cutting_diagnosis.py FOLDER [PICTURES]`. The cell has 15 micrometres of runout, its cutting
coefficient is a tenth above the stated one, and its chips regenerate; it records forces and accelerations at the tip
with 1 % noise. PICTURES is a folder for the two figures of the report. The same command reads recordings of a real
cut:

    millfrf cut diagnose CUT.toml A.h5 B.h5 --depth 0.001 --out DIR
"""

import math
import sys
from dataclasses import replace
from pathlib import Path

from acquisition import record
from millfrf.command_line import run
from millfrf.cutting import MillingProcess, write_cutting_process
from millfrf.figures import cut_orders_figure, cut_turn_figure, house_style, save_figure
from millfrf.mismatch import diagnose_cut, read_cut_recording
from replay_data import MillingCell, default_structure, dynamometer, tip_accelerometers

STATED = MillingProcess(2, 12.7e-3, math.pi / 2, 119e6, 0.17, 0.33, math.pi / 2, math.pi, 0.15e-3)
"""Down milling of acetal, the coefficients of Mohammadi & Ahmadi."""

TRUE = replace(STATED, runout=15e-6, ktc=1.1 * STATED.ktc)
DEPTH, DURATION = 1e-3, 8.0
"""m, s."""


def mill(folder: Path) -> list[Path]:
    """Record two speeds."""
    paths = []
    for name, speed, seed in (("slow", 760.0, 1), ("fast", 900.0, 2)):
        sensors = dynamometer() + tip_accelerometers()
        cell = MillingCell(default_structure(), TRUE, DEPTH, speed * math.pi / 30, DURATION, seed=seed, sensors=sensors)
        paths.append(folder / f"{name}.h5")
        record(cell, paths[-1])
    return paths


def draw(paths: list[Path], pictures: Path) -> None:
    """The figures of the report as pictures."""
    diagnosis = diagnose_cut(STATED, DEPTH, [read_cut_recording(path, STATED) for path in paths])
    pictures.mkdir(parents=True, exist_ok=True)
    with house_style():
        save_figure(cut_turn_figure(diagnosis), pictures / "cutting_diagnosis_turn.png")
        save_figure(cut_orders_figure(diagnosis), pictures / "cutting_diagnosis_orders.png")


def main(folder: Path, pictures: Path | None) -> int:
    """Mill, diagnose, draw; the exit code of the command."""
    folder.mkdir(parents=True, exist_ok=True)
    cutting = folder / "stated.toml"
    write_cutting_process(cutting, STATED)
    paths = mill(folder)
    asked = ["cut", "diagnose", str(cutting), *map(str, paths), "--depth", str(DEPTH)]
    code = run([*asked, "--out", str(folder / "cut_diagnosis"), "--force"])
    if code == 0 and pictures is not None:
        draw(paths, pictures)
    return code


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit("usage: python examples/cutting_diagnosis.py FOLDER [PICTURES]")
    sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) == 3 else None))
