"""Peak memory and time of every command on a 2 GB recording: `python benchmarks/memory.py [MEGABYTES [WORD]]`.

A cut of the simulated robot at 2048 Hz with twelve channels is repeated, with noise of its own each time, until the
recording has the asked size (2000). Each command runs in a process of its own; the table has its largest resident
memory. With WORD only commands that contain it are run. `--folder DIR` keeps the recordings there for a next run.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse
import math
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from acquisition import Recording, RecordingWriter, record
from millfrf.cutting import MillingProcess, write_cutting_process
from modal_fit import write_modal_model
from replay_data import MillingCell, default_structure, dynamometer, housing_accelerometers, tip_accelerometers
from replay_data import table_one_model as tip_structure

RPM = math.pi / 30
RATE, SPEED, SECONDS = 2048.0, 800 * RPM, 60.0
LIMIT = 1000.0
"""MB that no command may reach."""

PROCESS = MillingProcess(2, 12.7e-3, math.pi / 2, 119e6, 0.17, 0.33, math.pi / 2, math.pi, 0.15e-3)
COMMANDS = (
    "inspect big.h5",
    "recover killed.h5 --out out.h5",
    "convert big.h5 out.h5",
    "convert big.h5 out.npz",
    "convert big.h5 part.h5 --span 100 500",
    "convert big.h5 out.mat",
    "estimate big.h5 --excitation fx --segment 4 --out out.h5",
    "estimate big.h5 --excitation fx --segment 4 --estimator local-polynomial --band 13 60 --out out.h5",
    "tap big.h5 --excitation fx --out out.h5",
    "fit big.h5 --excitation fx --band 13 60 --out out.json",
    "chatter big.h5 --cutting cut.toml --speed 800 --out out.json",
    "predict model.json big.h5 --out out.h5",
    "diagnose model.json big.h5 --out out",
    "cut diagnose cut.toml big.h5 --depth 0.001 --speed 800 --out out",
    "chatter part.h5 --cutting cut.toml --speed 800 --out out.json",
    "predict model.json part.h5 --out out.h5",
    "report big.h5 cut.toml --out out.html",
    "convert big.h5 out.csv",
)


def make(folder: Path, megabytes: float) -> None:
    """Write the recording, a killed one of the same size, and what the commands need beside."""
    write_cutting_process(folder / "cut.toml", PROCESS)
    tip = tip_structure()
    write_modal_model(folder / "model.json", replace(tip, band=(12.0, 60.0)))
    sensors = dynamometer(0.01) + tip_accelerometers(0.01) + housing_accelerometers(0.01)
    structure = default_structure()
    cell = MillingCell(structure, PROCESS, 1e-3, SPEED, SECONDS, sample_rate=RATE, sensors=sensors, seed=1)
    (folder / "piece.h5").unlink(missing_ok=True)
    record(cell, folder / "piece.h5")
    with Recording(folder / "piece.h5") as recording:
        described, samples = recording.stream().description, recording.stream().read()
    rng = np.random.default_rng(2)
    writer = RecordingWriter(folder / "big.h5", [described], title="a long cut", overwrite=True)
    written, scale = 0.0, 1e-3 * samples.std(axis=0)
    while written < 1e6 * megabytes:
        for part in np.array_split(samples, 8):
            writer.append(described.name, part + scale * rng.standard_normal(part.shape))
            written += 4 * part.size
    writer.append_clock_pair(described.name, 0, 0.0)
    subprocess.run(["cp", "--sparse=never", folder / "big.h5", folder / "killed.h5"], check=True)
    writer.close()


def measured(folder: Path, words: list[str]) -> tuple[int, float, float, str]:
    """Exit code, largest resident memory (MB), time (s) and last line of a command."""
    began = time.monotonic()
    with (folder / "said.txt").open("w+", encoding="utf-8") as said:
        command = [sys.executable, "-m", "millfrf", *words]
        process = subprocess.Popen(command, cwd=folder, stdout=said, stderr=subprocess.STDOUT)
        _, status, usage = os.wait4(process.pid, 0)
        said.seek(0)
        lines = said.read().splitlines()
    return os.waitstatus_to_exitcode(status), usage.ru_maxrss / 1e3, time.monotonic() - began, (lines or [""])[-1]


def main() -> int:
    """Print the table; exit code 1 where a command took more than the limit or crashed."""
    parser = argparse.ArgumentParser()
    parser.add_argument("megabytes", nargs="?", type=float, default=2000.0)
    parser.add_argument("word", nargs="?", default="")
    parser.add_argument("--folder", type=Path)
    asked = parser.parse_args()
    failed = False
    with tempfile.TemporaryDirectory() as name:
        folder = asked.folder or Path(name)
        folder.mkdir(exist_ok=True)
        if not (folder / "killed.h5").exists():
            make(folder, asked.megabytes)
        print(f"| command, {(folder / 'big.h5').stat().st_size / 1e9:.2f} GB | memory, MB | time, s | ends with |")
        print("|---|---|---|---|")
        for line in (each for each in COMMANDS if asked.word in each):
            code, memory, seconds, last = measured(folder, line.split())
            failed |= memory > LIMIT or code not in (0, 2)
            print(f"| `{line}` | {memory:.0f} | {seconds:.0f} | {code}: {last[:150]} |", flush=True)
            subprocess.run(["rm", "-rf", *folder.glob("out*")], check=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
