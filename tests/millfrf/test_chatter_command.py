"""`millfrf chatter` on recorded cuts of the simulated cell, speed and teeth as the files state them."""

from math import pi
from pathlib import Path

import h5py
import numpy as np
import pytest

from acquisition import record
from cutting import MillingProcess
from millfrf.__main__ import run
from modal_fit import write_modal_model
from replay_data import MillingCell, dynamometer, table_one_model, tip_accelerometers

SENSORS = dynamometer(0.0) + tip_accelerometers(0.0)
CUT = """[cutting]
teeth = 2
diameter_m = 0.0127
ktc_pa = 119e6
krc = 0.17
kac = 0.33
start_angle_deg = 90.0
exit_angle_deg = 180.0
feed_per_tooth_m = 0.00015
"""


def test_verdicts_of_recorded_cuts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    process = MillingProcess(2, 0.0127, pi / 2, 119e6, 0.17, 0.33, pi / 2, pi, 0.15e-3)
    (tmp_path / "cut.toml").write_text(CUT, encoding="utf-8")
    sensors = dynamometer(0.01) + tip_accelerometers(0.01)
    for name, rpm, depth in (("quiet", 800, 1.4e-3), ("loud", 800, 2.0e-3), ("doubled", 1050, 1.6e-3)):
        cell = MillingCell(
            table_one_model(), process, depth, rpm * pi / 30, 25.0, sample_rate=2048.0, sensors=sensors, seed=3
        )
        record(cell, tmp_path / f"{name}.h5")
    files = [str(tmp_path / f"{name}.h5") for name in ("quiet", "loud", "doubled")]
    assert run(["chatter", *files, "--cutting", str(tmp_path / "cut.toml")]) == 0
    said = capsys.readouterr().out
    rows = {name: next(line for line in said.splitlines() if f"{name}.h5" in line) for name in ("quiet", "loud")}
    assert "stable" in rows["quiet"]
    assert "hopf" in rows["loud"]
    assert "period-doubling" in next(line for line in said.splitlines() if "doubled.h5" in line)
    assert "1050.0" in said


def test_frequency_near_a_mode_foreign_tone_and_doubt(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    process = MillingProcess(2, 0.0127, pi / 2, 119e6, 0.17, 0.33, pi / 2, pi, 0.15e-3)
    (tmp_path / "cut.toml").write_text(CUT + "runout_m = 2e-5\n", encoding="utf-8")
    write_modal_model(tmp_path / "model.json", table_one_model())
    for name, depth in (("loud", 2.0e-3), ("idle", 0.0)):
        cell = MillingCell(
            table_one_model(), process, depth, 800 * pi / 30, 20.0, sample_rate=1024.0, sensors=SENSORS, seed=3
        )
        path = tmp_path / f"{name}.h5"
        record(cell, path)
        with h5py.File(path, "r+") as file:
            samples = next(iter(file["signals"].values()))["samples"]
            time = np.arange(len(samples)) / 1024.0
            noise = np.random.default_rng(4).standard_normal(samples.shape) * (1e-3 + 0.1 * samples[...].std(axis=0))
            hum = 0.1 * samples[...].std(axis=0) * np.cos(2 * pi * 50 * time)[:, None]
            samples[...] = samples[...] + noise + hum
    files = [str(tmp_path / "loud.h5"), str(tmp_path / "idle.h5")]
    options = ["--cutting", str(tmp_path / "cut.toml"), "--model", str(tmp_path / "model.json")]
    assert run(["chatter", *files, *options]) == 0
    shown = capsys.readouterr()
    assert "hopf" in shown.out
    assert "17.2" in shown.out
    assert "mains (1 x 50 Hz)" in shown.out
    assert "warning: idle.h5: inconclusive: no order of the spindle" in shown.err
