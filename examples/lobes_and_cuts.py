"""Lobes with cuts that were tried on them: the figure of Mohammadi & Ahmadi, from their Table 1 and the simulated cell.

Run it: `python examples/lobes_and_cuts.py [PICTURE.png]`. Each cut is simulated in time and classified from its
accelerations, as a recorded one would be; the curves know nothing of that.
"""

import sys
from math import pi
from pathlib import Path

import numpy as np

from millfrf.cutting import MillingProcess
from millfrf.figures import TriedCut, lobes_figure
from millfrf.stability import classify_cut, collocation, zero_order
from replay_data import MillingCell, dynamometer, table_one_model, tip_accelerometers

RPM = pi / 30
HALF_DOWN = MillingProcess(2, 12.7e-3, pi / 2, 119e6, 0.17, 0.33, pi / 2, pi, 0.15e-3)
RATE = 2048.0
CUTS = (
    (800, 1.5),
    (800, 2.0),
    (900, 1.5),
    (900, 2.0),
    (1050, 1.2),
    (1050, 1.6),
    (1100, 0.5),
    (1100, 2.5),
    (1200, 1.9),
    (1600, 2.7),
    (1600, 3.2),
    (2000, 3.8),
    (2000, 4.5),
)
"""Spindle speed (rpm) and axial depth (mm)."""


def try_cut(rpm: float, depth_mm: float) -> TriedCut:
    """Mill for 25 s and judge by the tip's accelerations."""
    sensors = dynamometer(0.01) + tip_accelerometers(0.01)
    cell = MillingCell(
        table_one_model(), HALF_DOWN, 1e-3 * depth_mm, rpm * RPM, 25.0, sample_rate=RATE, sensors=sensors
    )
    verdict = classify_cut(cell.samples()[:, 3:], RATE, rpm * RPM, HALF_DOWN.teeth, runout=0.0)
    return TriedCut(rpm, 1e-3 * depth_mm, verdict.kind)


def main(picture: Path) -> None:
    speeds = np.unique(np.concatenate([np.linspace(600, 2200, 161), np.linspace(1030, 1080, 51)])) * RPM
    model = table_one_model()
    curves = {
        "collocation": collocation(model, HALF_DOWN, speeds, 8e-3),
        "zero-order": zero_order(model, HALF_DOWN, speeds, 8e-3),
    }
    cuts = [try_cut(rpm, depth) for rpm, depth in CUTS]
    lobes_figure(curves, cuts).savefig(picture, dpi=150)
    limits = np.interp([cut.spindle_speed_rpm * RPM for cut in cuts], speeds, curves["collocation"].depth_limits)
    agreed = sum((cut.depth < limit) == (cut.kind == "stable") for cut, limit in zip(cuts, limits, strict=True))
    print(f"{agreed} of {len(cuts)} cuts are on the side that collocation says; picture: {picture}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "lobes_and_cuts.png"))
