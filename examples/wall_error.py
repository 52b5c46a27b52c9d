"""Where stable cuts leave a wall, and two cuts over time: one stable, one that chatters.

Run it: `python examples/wall_error.py FOLDER`. The tool has one mode along X and one along Y; the same commands read a
model of your own:

    millfrf cut wall TIP.json --cutting CUT.toml --speeds 5000 20000 400 --depth 0.0004 --out wall.csv
    millfrf cut simulate TIP.json --cutting CUT.toml --speed 12500 --depth 0.0006 --out cut.h5 --sound cut.wav
"""

import sys
from pathlib import Path

import numpy as np

from millfrf.command_line import run
from modal_fit import ModalModel, write_modal_model

CUT = """[cutting]
teeth = 3
diameter_m = 0.0127
helix_angle_deg = 30
immersion = "down"
radial_depth_m = 0.003
feed_per_tooth_m = 1e-4
ktc_pa = 6e8
krc = 0.33
kac = 0.1
kte_n_per_m = 5000
kre_n_per_m = 3000
"""
"""Down milling of an aluminium alloy; coefficients of the usual size, not of one alloy."""

WALL_DEPTH, DEPTH = "0.0004", "0.0006"  # m


def tool() -> ModalModel:
    """A mode along X at 922 Hz, 1.34 MN/m, and one along Y at 800 Hz, 2 MN/m."""
    natural, damping, stiffness = 2 * np.pi * np.array([922.0, 800.0]), np.array([0.011, 0.02]), np.array([1.34e6, 2e6])
    damped, shapes = natural * np.sqrt(1 - damping**2), np.eye(2, dtype=complex)
    mass, points = stiffness / natural**2, ("TCP:+X", "TCP:+Y")
    poles = -damping * natural + 1j * damped
    return ModalModel(poles, shapes / (2j * mass * damped)[:, None], shapes, points, points, band=(100.0, 3000.0))


def main(folder: Path) -> int:
    """Write model, cut, table and pictures; the exit code of the last command."""
    folder.mkdir(parents=True, exist_ok=True)
    model, cut = folder / "tip.json", folder / "cut.toml"
    write_modal_model(model, tool())
    cut.write_text(CUT, encoding="utf-8")
    given = [str(model), "--cutting", str(cut), "--force"]
    wall = ["cut", "wall", *given, "--speeds", "5000", "20000", "400", "--depth", WALL_DEPTH]
    codes = [run([*wall, "--out", str(folder / "wall.csv"), "--picture", str(folder / "wall_error.png")])]
    for speed, name in (("17250", "stable"), ("12500", "chatter")):
        outputs = ["--out", str(folder / f"{name}.h5"), "--picture", str(folder / f"simulated_{name}.png")]
        codes.append(run(["cut", "simulate", *given, "--speed", speed, "--depth", DEPTH, *outputs]))
    return max(codes)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit("usage: python examples/wall_error.py FOLDER")
    sys.exit(main(Path(sys.argv[1])))
