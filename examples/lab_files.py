"""MAT files as a lab leaves them, for the tutorial: three cuts of a simulated robot and three hammer tests.

    python examples/lab_files.py [FOLDER]

`cut_central.mat`, `cut_down.mat`, `cut_up.mat` hold `Fs` (Hz), `F` (forces at the tool, kN, n x 3) and `acc`
(accelerations of the spindle's housing, g, n x 3); `hit_x.mat`, `hit_y.mat`, `hit_z.mat` hold `Fs`, `hammer` (kN),
`tip` and `housing` (g, n x 3).
"""

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.io import savemat

from replay_data import ACETAL_CUTTER, SWEEP_IMMERSIONS, HammerCell, LinearSweep, MillingCell, default_structure

RPM = math.pi / 30
G, KILO = 9.80665, 1e3


def write_lab_files(folder: Path, seconds: float = 60.0) -> None:
    """Write the six files; each sweep of the spindle speed takes ``seconds``."""
    structure, sweep = default_structure(), LinearSweep(450 * RPM, 690 * RPM, seconds)
    for seed, (name, (start, leave)) in enumerate(SWEEP_IMMERSIONS.items()):
        process = replace(ACETAL_CUTTER, start_angle=start * math.pi, exit_angle=leave * math.pi)
        cell = MillingCell(structure, process, 2e-3, sweep, seconds, sample_rate=2048.0, oversampling=10, seed=seed)
        samples = cell.samples().astype(np.float32)
        fields = {"Fs": cell.sample_rate, "F": samples[:, :3] / KILO, "acc": samples[:, 3:] / G}
        savemat(folder / f"cut_{name}.mat", fields)
    for seed, axis in enumerate("xyz", 10):
        cell = HammerCell(structure, directions=(f"TCP:+{axis.upper()}",), seed=seed)
        samples = cell.samples().astype(np.float32)
        named = dict(zip((channel.name for channel in cell.streams[0].channels), samples.T, strict=True))
        fields = {
            "Fs": cell.sample_rate,
            "hammer": named[f"f{axis}"] / KILO,
            "tip": np.column_stack([named[f"tip_a{a}"] for a in "xyz"]) / G,
            "housing": np.column_stack([named[f"a{a}"] for a in "xyz"]) / G,
        }
        savemat(folder / f"hit_{axis}.mat", fields)


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "lab-files")
    target.mkdir(parents=True, exist_ok=True)
    write_lab_files(target)
