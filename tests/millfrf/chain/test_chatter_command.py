"""`millfrf chatter` on recorded cuts of the simulated cell, speed and teeth as the files state them."""

import html
from math import pi
from pathlib import Path

import h5py
import numpy as np
import pytest

from acquisition import record
from millfrf.command_line import run
from millfrf.cutting import MillingProcess
from millfrf.stability import cut_spectrum, gather_evidence, read_cuts
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
    (tmp_path / "cut.toml").write_text(CUT + "runout_m = 0.0\n", encoding="utf-8")
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
            file.attrs["format_version"] = 1  # as another program writes it: without checksums
    files = [str(tmp_path / "loud.h5"), str(tmp_path / "idle.h5")]
    options = ["--cutting", str(tmp_path / "cut.toml"), "--model", str(tmp_path / "model.json")]
    kept = tmp_path / "chatter.json"
    assert run(["chatter", *files, *options, "--out", str(kept)]) == 0
    shown = capsys.readouterr()
    assert "hopf" in shown.out
    assert "17.2" in shown.out
    assert "mains (1 x 50 Hz)" in shown.out
    assert "warning: idle.h5: inconclusive: no order of the spindle" in shown.err
    assert_report_shows(kept, tmp_path / "report.html", shown.err)
    assert run(["inspect", str(kept)]) == 0
    assert "verdicts on 2 cuts" in capsys.readouterr().out


def assert_report_shows(kept: Path, page: Path, warned: str) -> None:
    """Every warning, the verdicts in brief, tones, reasons and a spectrum, also without the recordings."""
    assert run(["report", str(kept), "--out", str(page)]) == 0
    text = html.unescape(page.read_text(encoding="utf-8"))
    for line in warned.splitlines():
        assert line.removeprefix("warning: ") in text
    assert "loud.h5 hopf at 17.2" in text
    assert "mains (1 x 50 Hz)" in text
    assert text.count("Spectra of classified cuts") == 1
    [first, _] = read_cuts(kept)
    seen = first.spectrum
    strongest = np.nanargmax(seen.amplitude)
    near = np.abs(seen.frequencies - first.cut.verdict.frequency) < 0.3
    assert np.nanmax(seen.amplitude[near]) > 30 * seen.floor[near].max()
    assert seen.amplitude[strongest] > seen.floor[strongest]
    assert first.channel.startswith("tip_a")
    assert first.unit == "m/s^2"


def test_the_spectrum_is_in_the_unit_of_its_channel() -> None:
    """A tone of 0.3 m/s^2 (rms) at 47.3 Hz beside an order of 2 m/s^2: both stand in the spectrum as they are."""
    rate, spindle, rng = 1024.0, 10.0, np.random.default_rng(1)
    time = np.arange(int(30 * rate)) / rate
    order = 2 * np.sqrt(2) * np.cos(2 * pi * 2 * spindle * time)
    tone = 0.3 * np.sqrt(2) * np.cos(2 * pi * 47.3 * time)
    samples = (order + tone + 0.01 * rng.normal(size=len(time)))[:, None]
    seen = cut_spectrum(gather_evidence(samples, rate, 2 * pi * spindle, 2), 100.0)
    assert seen.order_amplitudes[np.argmin(np.abs(seen.order_frequencies - 20))] == pytest.approx(2.0, rel=1e-3)
    near = np.abs(seen.frequencies - 47.3) < 0.4
    assert np.sqrt(np.nansum(seen.amplitude[near] ** 2)) == pytest.approx(0.3, rel=0.03)
    assert seen.frequencies[-1] <= 100.0


def test_a_file_of_verdicts_that_is_damaged_is_refused_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "chatter.json").write_text('{"format": "millfrf.chatter", "format_version": 1}', encoding="utf-8")
    assert run(["report", str(tmp_path / "chatter.json"), "--out", str(tmp_path / "page.html")]) == 2
    assert "holds no verdicts on cuts" in capsys.readouterr().err
    assert not (tmp_path / "page.html").exists()
