"""`millfrf chatter` on recorded cuts of the simulated cell, speed and teeth as the files state them."""

from math import pi
from pathlib import Path

import pytest

from acquisition import record
from cutting import MillingProcess
from millfrf.__main__ import run
from replay_data import MillingCell, dynamometer, table_one_model, tip_accelerometers

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
