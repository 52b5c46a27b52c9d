"""Names, units and rates that a MAT file states in cells and structures beside its samples are used, and shown."""

import tomllib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from acquisition import Recording, open_arrays
from millfrf.command_line import run
from millfrf.new.mapping_file import new_mapping

DATA = np.random.default_rng(5).standard_normal((60, 4))
NAMES, UNITS = ["Kraft_X", "Kraft_Y", "Acc_TCP_x", "Acc_TCP_y"], ["kN", "kN", "g", "g"]


def cell(texts: list[str]) -> np.ndarray:
    return np.array(texts, dtype=object)


def saved(folder: Path, **fields: Any) -> Path:
    path = folder / "cut.mat"
    savemat(path, {"Daten": DATA, **fields})
    return path


def made(path: Path) -> tuple[str, dict[str, Any]]:
    text = new_mapping(path).text
    return text, tomllib.loads(text)


@pytest.mark.parametrize("as_characters", [False, True])
def test_a_header_of_its_own_is_converted_without_a_change(tmp_path: Path, as_characters: bool) -> None:
    texts = (NAMES, UNITS) if as_characters else (cell(NAMES), cell(UNITS))
    header = {"machine": "ABB IRB6660", "spindle_rpm": 1180.0, "SampleFrequency": 1000.0}
    path = saved(tmp_path, Kanal=texts[0], Einheit=texts[1], Hdr=header)
    text, _ = made(path)
    for line in ("Hdr.machine: ABB IRB6660", "Hdr.spindle_rpm: 1180", "names from Kanal and units from Einheit"):
        assert line in text
    mapping, out = tmp_path / "map.toml", tmp_path / "rec.h5"
    mapping.write_text(text)
    assert run(["convert", str(path), str(out), "--map", str(mapping)]) == 0
    with Recording(out) as recording:
        stream = recording.stream()
        assert stream.sample_rate == 1000.0
        assert [channel.name for channel in stream.channels] == NAMES
        assert [str(each.degree_of_freedom) for each in stream.channels] == ["TCP:+X", "TCP:+Y", "TCP:+X", "TCP:+Y"]
        np.testing.assert_allclose(stream.read(), DATA * [1e3, 1e3, 9.80665, 9.80665], rtol=1e-9)


def test_a_cell_of_version_7_3_is_read(tmp_path: Path) -> None:
    """Such files are HDF5, whose cells are references to arrays of characters."""
    path = tmp_path / "cut.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["Daten"], file["fs"] = DATA.T, np.array([[1000.0]])
        for name, texts in (("Kanal", NAMES), ("Einheit", UNITS)):
            members = [file.create_dataset(f"#refs#/{name}{k}", data=_characters(each)) for k, each in enumerate(texts)]
            for member in members:
                member.attrs["MATLAB_class"] = np.bytes_("char")
            references = np.array([[each.ref for each in members]], dtype=h5py.ref_dtype).T
            file.create_dataset(name, data=references, dtype=h5py.ref_dtype).attrs["MATLAB_class"] = np.bytes_("cell")
    assert list(open_arrays(path).fields["Kanal"]) == NAMES
    content = made(path)[1]
    assert [each["name"] for each in content["channels"]] == NAMES
    assert [each["unit"] for each in content["channels"]] == UNITS


def _characters(text: str) -> np.ndarray:
    return np.array([[ord(sign)] for sign in text], dtype=np.uint16)


def test_lists_that_cannot_be_told_apart_are_shown_and_not_used(tmp_path: Path) -> None:
    path = saved(tmp_path, first=cell(["a", "b", "c", "d"]), second=cell(["p", "q", "r", "s"]), fs=1000.0)
    text, content = made(path)
    assert [each["name"] for each in content["channels"]] == [f"Daten {k}" for k in range(1, 5)]
    assert "second: p, q, r, s" in text


def test_a_list_of_another_length_is_not_used(tmp_path: Path) -> None:
    content = made(saved(tmp_path, Kanal=cell(NAMES[:3]), Einheit=cell(UNITS), fs=1000.0))[1]
    assert [each["name"] for each in content["channels"]] == [f"Daten {k}" for k in range(1, 5)]
    assert [each["unit"] for each in content["channels"]] == UNITS


@pytest.mark.parametrize(
    ("fields", "asked"),
    [
        (
            {"Hdr": {"frq_sampling": 1000.0, "spindle_rpm": 1180.0}},
            "how many samples a second; Hdr.frq_sampling = 1000?",
        ),
        ({"dt": 0.001}, "how many samples a second; 1/dt = 1000?"),
    ],
)
def test_numbers_that_may_be_the_rate_are_named(tmp_path: Path, fields: dict[str, Any], asked: str) -> None:
    text, content = made(saved(tmp_path, **fields))
    assert asked in text
    assert "sample_rate" not in content


def test_the_count_of_open_places_is_that_of_the_marks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = saved(tmp_path, remark="FILL IN later"), tmp_path / "map.toml"
    assert run(["new", "mapping", str(path), "--out", str(out)]) == 0
    lines = [line for line in out.read_text().splitlines() if "# FILL IN" in line]
    assert len(lines) == 2 * DATA.shape[1] + 1  # quantity and unit of each, and the rate
    assert f"{len(lines)} places are open" in capsys.readouterr().out


def test_a_direction_that_no_name_tells_is_asked(tmp_path: Path) -> None:
    text, content = made(
        saved(tmp_path, Kanal=cell(["force", "Acc 1", "n", "Acc_x"]), Einheit=cell(["N", "g", "rpm", "g"]))
    )
    assert text.count("along which axis does it count positive") == 2
    assert ["direction" in each for each in content["channels"]] == [False, False, False, True]


def test_the_engagement_of_a_cut_is_asked(tmp_path: Path) -> None:
    cut = tmp_path / "cut.toml"
    assert run(["new", "cut", "--out", str(cut), "--teeth", "2", "--diameter", "0.012"]) == 0
    text = cut.read_text()
    assert "half immersion, up or down: 0.006" in text
    asked = [line.split()[1] for line in text.splitlines() if line.startswith("# ") and "# FILL IN" in line]
    assert asked == ["immersion", "radial_depth_m"]


def dspace_file(folder: Path, name: str, seed: int) -> tuple[Path, np.ndarray]:
    """Recording of a dSPACE ControlDesk: a structure named as the file, with one structure a signal in ``Y``."""
    signals = np.random.default_rng(seed).standard_normal((4, 500))
    paths = ["Model Root/Fx", "Model Root/Fy", "Model Root/TCP/Acc_TCP_x", "Model Root/TCP/Acc_TCP_y"]
    members = np.zeros((1, 4), dtype=[("Name", "O"), ("Path", "O"), ("Unit", "O"), ("Data", "O")])
    for k, unit in enumerate(["N", "N", "m/s^2", "m/s^2"]):
        members[0, k] = ("", paths[k], unit, signals[k : k + 1])
    time = np.zeros((1, 1), dtype=[("Name", "O"), ("Data", "O")])
    time[0, 0] = ("time", np.arange(500)[None] / 1e4)
    savemat(folder / f"{name}.mat", {name: {"X": time, "Y": members, "Description": {"General": {"DateTime": ""}}}})
    return folder / f"{name}.mat", signals


def test_one_mapping_serves_all_dspace_files_though_their_variables_have_other_names(tmp_path: Path) -> None:
    first, _ = dspace_file(tmp_path, "Down_Set_3_1_mm", 1)
    second, signals = dspace_file(tmp_path, "Up_Set_4_1_mm", 2)
    text, made_mapping = made(first)
    assert made_mapping["time"] == "X.Data"
    mapping, out = tmp_path / "map.toml", tmp_path / "rec.h5"
    mapping.write_text(text.replace("# time_unit", "time_unit"))
    assert run(["convert", str(second), str(out), "--map", str(mapping)]) == 0
    with Recording(out) as recording:
        stream = recording.stream()
        assert stream.sample_rate == pytest.approx(1e4)
        assert [channel.name for channel in stream.channels] == ["Fx", "Fy", "Acc_TCP_x", "Acc_TCP_y"]
        assert [channel.quantity for channel in stream.channels] == ["force"] * 2 + ["acceleration"] * 2
        assert [str(sensor.degree_of_freedom) for sensor in stream.channels] == ["TCP:+X", "TCP:+Y"] * 2
        np.testing.assert_allclose(stream.read(), signals.T, rtol=1e-12)
    assert "Unit 0" not in text
    # an array of structures beside other variables keeps its own name
    other = tmp_path / "two.mat"
    savemat(other, {"signal": {"Y": np.array([(DATA[:, 0],), (DATA[:, 1],)], dtype=[("d", "O")])}, "fs": 1000.0})
    np.testing.assert_array_equal(open_arrays(other).array("signal.Y(2).d").reshape(-1), DATA[:, 1])
