"""Three simulated slots at three feeds, and the force coefficients and runout that their forces hold.

Run it: `python examples/force_coefficients.py FOLDER [PICTURES]`. The cell mills acetal at 3000 rpm with 15 micrometres
of runout; its robot yields, and its dynamometer has noise. PICTURES is a folder for the figure. The same command reads
recordings of real cuts:

    millfrf cut identify CUTTER.toml A.h5 B.h5 C.h5 --depth 0.001 --feeds 60e-6,120e-6,180e-6 --out cut.toml
"""

import math
import sys
from dataclasses import replace
from pathlib import Path

from acquisition import record
from millfrf.command_line import run
from millfrf.cutting import MillingProcess
from replay_data import MillingCell, default_structure, dynamometer

TRUE = MillingProcess(
    2, 12.7e-3, math.pi / 2, 119e6, 0.17, 0.33, 0.0, math.pi, 0.1e-3, kte=1500.0, kre=2000.0, kae=500.0, runout=15e-6
)
"""The coefficients of Mohammadi & Ahmadi, with edge forces."""

CUTTER = '[cutting]\nteeth = 2\ndiameter_m = 0.0127\nimmersion = "slot"\n'
FEEDS = (60e-6, 120e-6, 180e-6)
DEPTH, RPM, DURATION = 1e-3, 3000.0, 4.0
"""m, rpm, s."""


def main(folder: Path, pictures: Path | None) -> int:
    """Mill and identify; the exit code of the command."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "cutter.toml").write_text(CUTTER, encoding="utf-8")
    paths = []
    for seed, feed in enumerate(FEEDS):
        process = replace(TRUE, feed_per_tooth=feed)
        speed = RPM * math.pi / 30
        cell = MillingCell(default_structure(), process, DEPTH, speed, DURATION, seed=seed, sensors=dynamometer())
        paths.append(folder / f"feed_{1e6 * feed:.0f}.h5")
        record(cell, paths[-1])
    feeds = ",".join(str(feed) for feed in FEEDS)
    words = ["cut", "identify", str(folder / "cutter.toml"), *map(str, paths), "--depth", str(DEPTH), "--feeds", feeds]
    words += ["--speed", str(RPM), "--out", str(folder / "cut.toml"), "--force"]
    if pictures is not None:
        pictures.mkdir(parents=True, exist_ok=True)
        words += ["--picture", str(pictures / "force_coefficients.png")]
    return run(words)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit("usage: python examples/force_coefficients.py FOLDER [PICTURES]")
    sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None))
