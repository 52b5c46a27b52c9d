"""Files of three other programs, for the tutorials on CSV, TDMS and UFF: a cut and a hammer test of a simulated robot.

    python examples/lab_formats.py [FOLDER]

`cut.csv` has a line of headings, a line of units and then numbers; `cut.tdms` the same samples as a National
Instruments program writes them, with `wf_increment` and `unit_string`; `hammer.unv` nine FRFs of a hammer test, in g/N,
as an analyser exports them (UFF 58).
"""

import math
import sys
from pathlib import Path

import numpy as np
import pyuff
from nptdms import ChannelObject, TdmsWriter

from millfrf.cutting import MillingProcess
from replay_data import LinearSweep, MillingCell, default_structure, tip_model

RPM, G, KILO = math.pi / 30, 9.80665, 1e3
CUTTER = MillingProcess(2, 12.7e-3, math.pi / 2, 119e6, 0.17, 0.33, 0.77 * math.pi, math.pi, 0.15e-3, runout=10e-6)
NAMES = ("Fx", "Fy", "Fz", "ax", "ay", "az")
AXES = "XYZ"


def samples_of_a_cut(seconds: float) -> tuple[float, np.ndarray]:
    """Rate (Hz) and samples in kN and g, (n, 6)."""
    sweep = LinearSweep(450 * RPM, 690 * RPM, seconds)
    cell = MillingCell(default_structure(), CUTTER, 2e-3, sweep, seconds, sample_rate=1024.0, seed=1)
    return cell.sample_rate, cell.samples() / np.array(3 * [KILO] + 3 * [G])


def write_csv(path: Path, rate: float, samples: np.ndarray) -> None:
    """A line of headings, a line of units, then a row an instant."""
    with path.open("w", encoding="utf-8") as file:
        file.write("time;" + ";".join(NAMES) + "\n" + "s;kN;kN;kN;g;g;g\n")
        np.savetxt(file, np.column_stack([np.arange(len(samples)) / rate, samples]), "%.9g", ";")


def write_tdms(path: Path, rate: float, samples: np.ndarray) -> None:
    """A group with a channel each, whose properties tell unit and step in time."""
    units = 3 * ("kN",) + 3 * ("g",)
    with TdmsWriter(path) as writer:
        channels = [
            ChannelObject("cut", name, column.copy(), {"unit_string": unit, "wf_increment": 1 / rate})
            for name, unit, column in zip(NAMES, units, samples.T, strict=True)
        ]
        writer.write_segment(channels)


def write_uff(path: Path) -> None:
    """FRFs of the tip (node 1), in g/N, with noise of 0.2 % of the largest."""
    frf = tip_model(default_structure()).frf(np.arange(5.0, 65.0, 0.125))
    values = frf.values * (2j * np.pi * frf.frequencies[:, None, None]) ** 2 / G
    rng = np.random.default_rng(2)
    values = values + 2e-3 * abs(values).max() * (rng.normal(size=values.shape) + 1j * rng.normal(size=values.shape))
    sets = []
    for p in range(3):
        for q in range(3):
            ends = {"rsp_node": 1, "rsp_dir": p + 1, "ref_node": 1, "ref_dir": q + 1}
            axis = {"abscissa_spacing": 1, "abscissa_min": 5.0, "abscissa_inc": 0.125, "x": frf.frequencies}
            units = {"ordinate_axis_units_lab": "g", "orddenom_axis_units_lab": "N"}
            kinds = {"ordinate_spec_data_type": 12, "orddenom_spec_data_type": 13, "binary": 0, "func_type": 4}
            names = {f"id{n}": "NONE" for n in range(1, 6)} | {"rsp_ent_name": "NONE", "ref_ent_name": "NONE"}
            sets.append({"type": 58, **ends, **axis, **units, **kinds, **names, "data": values[:, p, q]})
    pyuff.UFF(str(path)).write_sets(sets, "overwrite")


def main(folder: Path, seconds: float = 30.0) -> None:
    """Write the three files."""
    folder.mkdir(parents=True, exist_ok=True)
    rate, samples = samples_of_a_cut(seconds)
    write_csv(folder / "cut.csv", rate, samples)
    write_tdms(folder / "cut.tdms", rate, samples)
    write_uff(folder / "hammer.unv")
    print(*(path.name for path in (folder / "cut.csv", folder / "cut.tdms", folder / "hammer.unv")), "in", folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("lab-files"))
