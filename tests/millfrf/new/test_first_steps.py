"""First steps with files of other programs: messages name the next command, and no time of recording is made up."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from acquisition import Recording
from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.new.mapping_file import new_mapping
from millfrf.stability import StabilityLobes, write_lobes
from millfrf.steps.inspect import inspect_file

ROWS = [f"{k / 500:.3f},{a:.5f},{b:.5f}" for k, (a, b) in enumerate(np.random.default_rng(1).standard_normal((400, 2)))]


def csv(folder: Path) -> Path:
    path = folder / "cut.csv"
    path.write_text("\n".join(["t [s],Fx [N],ax [g]", *ROWS]) + "\n")
    return path


def said(words: list[object], capsys: pytest.CaptureFixture[str]) -> str:
    """The one line that ends a command in vain."""
    capsys.readouterr()
    assert run([str(word) for word in words]) == 2
    return capsys.readouterr().err


@pytest.mark.parametrize("suffix", ["csv", "mat"])
def test_a_file_of_another_program_is_told_the_way_in(
    suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = csv(tmp_path)
    if suffix == "mat":
        path = tmp_path / "cut.mat"
        savemat(path, {"F": np.ones((400, 3))})
    way = f"millfrf new mapping {path} --out map.toml, then millfrf convert {path} cut.h5 --map map.toml"
    assert way in said(["inspect", path], capsys)
    assert way in said(["estimate", path, "--out", tmp_path / "frf.h5"], capsys)
    assert way in said(["fit", path, "--band", "5", "50", "--out", tmp_path / "model.json"], capsys)
    if suffix == "mat":  # headings with units say what the channels are, arrays without a name or a rate do not
        assert "millfrf new mapping" in said(["convert", path, tmp_path / "rec.h5"], capsys)
    else:
        assert run(["convert", str(path), str(tmp_path / "rec.h5")]) == 0


@pytest.mark.parametrize(
    ("words", "command"),
    [
        (["fit", "x.h5"], "millfrf fit"),
        (["lobes", "m.json"], "millfrf lobes"),
        (["robot", "modes"], "millfrf robot modes"),
        (["new", "cut"], "millfrf new cut"),
        (["unknown"], "millfrf"),
    ],
)
def test_a_wrong_command_line_names_the_help_of_its_command(
    words: list[str], command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert f"Try '{command} --help'." in said(words, capsys)


def converted(folder: Path, recorded_at: str) -> Path:
    path, mapping, out = csv(folder), folder / "map.toml", folder / "rec.h5"
    line = f'recorded_at = "{recorded_at}"\n' if recorded_at else ""
    mapping.write_text(line + new_mapping(path).text)
    assert run(["convert", str(path), str(out), "--map", str(mapping)]) == 0
    return out


def test_a_time_of_recording_that_nobody_states_stays_unknown(tmp_path: Path) -> None:
    out = converted(tmp_path, "")
    with Recording(out) as recording:
        assert recording.recorded_at == ""
        assert "time of recording not known" in repr(recording)
        assert json.loads(recording.provenance)["options"]["at"].startswith("20")
    assert "time of recording not known" in inspect_file(out).summary
    again = tmp_path / "again.npz"
    assert run(["convert", str(out), str(again)]) == 0
    assert run(["convert", str(again), str(tmp_path / "back.h5")]) == 0
    with Recording(tmp_path / "back.h5") as recording:
        assert recording.recorded_at == ""


@pytest.mark.parametrize("stated", ["2026-03-11", "2026-03-02T09:30:00Z", "2026-03-02T09:30:00+01:00"])
def test_a_date_and_a_time_with_its_zone_are_kept(tmp_path: Path, stated: str) -> None:
    with Recording(converted(tmp_path, stated)) as recording:
        assert recording.recorded_at == stated


@pytest.mark.parametrize(("stated", "why"), [("2026-03-02T09:30:00", "has no zone"), ("11.03.2026", "is no time")])
def test_other_times_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], stated: str, why: str) -> None:
    path, mapping = csv(tmp_path), tmp_path / "map.toml"
    mapping.write_text(f'recorded_at = "{stated}"\n' + new_mapping(path).text)
    assert why in said(["convert", path, tmp_path / "rec.h5", "--map", mapping], capsys)


def test_the_time_is_asked_with_the_date_that_the_file_says(tmp_path: Path) -> None:
    path = tmp_path / "cut.mat"
    savemat(path, {"F": np.ones((400, 3)), "Hdr": {"date": "2026-03-11", "fs": 1000.0}})
    assert "# recorded_at =    # when was it recorded? The file says Hdr.date = 2026-03-11." in new_mapping(path).text


def test_a_look_at_lobes_shows_the_warnings_in_the_file(tmp_path: Path) -> None:
    speeds = np.array([100.0, 110.0])
    doubt = "at 1 of 2 speeds the limit rests on noise"
    made = StabilityLobes(speeds, np.full(2, 1e-3), np.full(2, 18.0), ("hopf", "hopf"), "zero-order", (doubt,))
    write_lobes(tmp_path / "lobes.csv", made)
    assert doubt in inspect_file(tmp_path / "lobes.csv").concerns


def test_a_mapping_of_a_tap_test_asks_where_the_sensors_are(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = "\n".join(f"{k / 1000};{k % 7};{k % 5}" for k in range(400))
    table, mapping = tmp_path / "tap.csv", tmp_path / "map.toml"
    table.write_text(f"time [s];hammer [N];acc_x [g]\n{rows}\n", encoding="utf-8")
    assert run(["new", "mapping", str(table), "--out", str(mapping)]) == DONE
    text = mapping.read_text(encoding="utf-8")
    assert text.count("FILL IN: at which point") == 2
    assert 'HOUSING"' not in text
    command = ["convert", str(table), str(tmp_path / "tap.h5"), "--map", str(mapping)]
    capsys.readouterr()
    assert run(command) == BAD_INPUT
    assert "direction +X without a node" in capsys.readouterr().err
    mapping.write_text(text.replace('direction = "+X"', ""), encoding="utf-8")
    assert run(command) == DONE
    assert "tap.h5: node and direction of hammer, acc_x are not stated" in capsys.readouterr().err
