"""Files as labs have them: what they tell is filled in, what they leave open is asked, and no row is swallowed."""

import re
import tomllib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter
from scipy.io import savemat

from acquisition import Recording, TextOptions, open_arrays
from estimation import read_frf
from millfrf.command_line import run
from millfrf.core import FileFormatError, InputError
from millfrf.new.mapping_file import new_mapping

N = 40
DATA = np.random.default_rng(8).standard_normal((N, 3))
ROWS = [f"{k / 1000:.3f};{a:.5f};{b:.5f}" for k, (a, b, _) in enumerate(DATA)]


def made(path: Path) -> tuple[str, dict[str, Any]]:
    """Text of the mapping, and what it says."""
    text = new_mapping(path).text
    return text, tomllib.loads(text)


def of_lines(folder: Path, lines: list[str], name: str = "rig.csv", encoding: str = "utf-8") -> Path:
    path = folder / name
    path.write_text("\n".join(lines) + "\n", encoding=encoding)
    return path


def converted(path: Path, text: str) -> np.ndarray:
    mapping, out = path.with_suffix(".toml"), path.with_suffix(".out.h5")
    mapping.write_text(text, encoding="utf-8")
    assert run(["convert", str(path), str(out), "--map", str(mapping)]) == 0
    with Recording(out) as recording:
        assert recording.stream().sample_rate == 1000.0
        return np.asarray(recording.stream().read())


def test_decimal_commas_are_seen(tmp_path: Path) -> None:
    path = of_lines(tmp_path, ["t [s];Fx [N];ax [g]", *(row.replace(".", ",") for row in ROWS)])
    text, content = made(path)
    assert "csv" not in content  # the reader sees it too
    np.testing.assert_allclose(converted(path, text), DATA[:, :2] * [1, 9.80665], atol=1e-3)


def test_decimal_commas_without_headings_are_no_headings_nor_units(tmp_path: Path) -> None:
    path = of_lines(tmp_path, [row.replace(".", ",") for row in ROWS])
    assert len(open_arrays(path).fields["table"]) == N
    assert open_arrays(path).headings == ()
    with pytest.raises(FileFormatError, match="holds no rows of numbers"):
        open_arrays(path, TextOptions(decimal="."))


@pytest.mark.parametrize("preamble", [["Rig 4; run 7"], ["Operator;Smith;-", "Date;2 March;2026", "", "x"]])
@pytest.mark.parametrize("units", [[], ["s;N;g"]])
def test_a_preamble_is_passed_over(tmp_path: Path, preamble: list[str], units: list[str]) -> None:
    """The preamble has as many cells as the table in one case, other numbers of them in the other."""
    path = of_lines(tmp_path, [*preamble, "t;Fx;ax", *units, *ROWS])
    text, content = made(path)
    assert f"rows read from lines {len(preamble) + len(units) + 2} to {len(preamble) + len(units) + 1 + N}" in text
    assert [each["name"] for each in content["channels"]] == ["Fx", "ax"]
    assert [each.get("unit") for each in content["channels"]] == (["N", "g"] if units else [None, None])
    assert content["time"] == "t"


def test_an_old_code_page_is_seen(tmp_path: Path) -> None:
    path = of_lines(tmp_path, ["t;Fx;Temp\N{DEGREE SIGN}", *ROWS], encoding="cp1252")
    assert made(path)[1]["channels"][1]["column"] == "Temp\N{DEGREE SIGN}"


@pytest.mark.parametrize(
    ("heading", "asked"),
    [
        ("Fx [g]", "the name says force, g is a unit of acceleration: which is it"),
        ("acc x [N]", "the name says acceleration, N is a unit of force: which is it"),
        ("Fx [V]", "the values are in V: give the unit of the force, and the sensitivity in V per unit"),
        ("n [1/min]", "the file says 1/min, which is no unit that is known here, if it turns so: rpm"),
        ("Fx [counts]", "the file says counts, which is no unit that is known here"),
        ("A1", "what does it measure"),
        ("f1", "what does it measure"),
        ("load", "what does it measure"),
    ],
)
def test_what_contradicts_itself_is_asked(tmp_path: Path, heading: str, asked: str) -> None:
    path = of_lines(tmp_path, [f"t [s];{heading};ay [g]", *ROWS])
    text, content = made(path)
    assert asked in text
    assert "unit" not in content["channels"][0]
    assert content["channels"][1]["unit"] == "g"


@pytest.mark.parametrize("heading", ["n [rpm]", "n [rev/min]", "spindle speed [rpm]"])
def test_a_spindle_speed_is_one(tmp_path: Path, heading: str) -> None:
    channel = made(of_lines(tmp_path, [f"t [s];{heading};ay [g]", *ROWS]))[1]["channels"][0]
    assert channel["quantity"] == "angular_velocity"
    assert "direction" not in channel


@pytest.mark.parametrize(("heading", "sign"), [("Fx_neg [N]", "X"), ("F -z [N]", "Z"), ("acc-y [g]", "Y")])
def test_a_sign_in_doubt_is_asked_and_refused_until_then(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], heading: str, sign: str
) -> None:
    path = of_lines(tmp_path, [f"t [s];{heading};ay [g]", *ROWS])
    text, _ = made(path)
    assert f"does it count positive along +{sign} or -{sign}" in text
    (tmp_path / "map.toml").write_text(text)
    assert run(["convert", str(path), str(tmp_path / "rec.h5"), "--map", str(tmp_path / "map.toml")]) == 2
    assert "channels[1]: degree of freedom" in capsys.readouterr().err


@pytest.mark.parametrize("heading", ["max_force [N]", "box [N]", "Fx_y [N]"])
def test_letters_inside_words_are_no_axes(tmp_path: Path, heading: str) -> None:
    assert "direction" not in made(of_lines(tmp_path, [f"t [s];{heading};ay [g]", *ROWS]))[1]["channels"][0]


def test_two_time_columns_are_asked(tmp_path: Path) -> None:
    path = of_lines(
        tmp_path, ["time;Fx [N];t2", *(f"{row.rpartition(';')[0]};{k / 500}" for k, row in enumerate(ROWS))]
    )
    text, content = made(path)
    assert "time" not in content
    assert "which is the time of the samples, time or t2" in text
    assert len(content["channels"]) == 1


@pytest.mark.parametrize(("step", "asked"), [(0.5, "in steps of 0.5: in which time_unit"), (1.0, "in steps of 1:")])
def test_a_time_that_may_be_milliseconds_is_asked(tmp_path: Path, step: float, asked: str) -> None:
    path = of_lines(tmp_path, ["time;Fx [N]", *(f"{k * step};{a:.4f}" for k, a in enumerate(DATA[:, 0]))])
    text, content = made(path)
    assert asked in text
    assert "time" not in content


@pytest.mark.parametrize("row", ["-;-;-", "NaN;NaN;NaN", "0.000;-;-", "n/a;NaN;-", "09:00:01;-;-"])
@pytest.mark.parametrize("units", [[], ["s;N;g"]])
def test_a_first_row_of_missing_values_is_a_row(tmp_path: Path, row: str, units: list[str]) -> None:
    """Neither the reader nor the template takes it for units; it is refused by its line, or kept as NaN."""
    path = of_lines(tmp_path, ["t;Fx;ax", *units, row, *ROWS])
    if row.startswith("NaN"):
        assert len(open_arrays(path).fields["table"]) == N + 1
        named = {each["name"]: each.get("quantity") for each in made(path)[1]["channels"]}
        assert named == {"t": None, "Fx": "force", "ax": "acceleration"}  # a time that does not rise is asked
        return
    with pytest.raises(FileFormatError, match=rf"line {2 + len(units)}, column \d: .* is not a number"):
        open_arrays(path)
    with pytest.raises(InputError, match=f"line {2 + len(units)}"):
        new_mapping(path)


def test_units_below_headings_are_units_with_dashes_too(tmp_path: Path) -> None:
    path = of_lines(tmp_path, ["t;Fx;ratio", "s;kN;-", *ROWS])
    assert open_arrays(path).units == ("s", "kN", "-")
    assert len(open_arrays(path).fields["table"]) == N


def test_a_square_array_is_asked_and_refused_until_then(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "rig.mat"
    savemat(path, {"F": np.ones((12, 12)), "Fs": 2048.0})
    text, _ = made(path)
    assert "12 x 12" in text
    filled = text.replace("# quantity =", 'quantity = "force" #').replace("# unit =", 'unit = "N" #')
    (tmp_path / "map.toml").write_text(filled)
    assert run(["convert", str(path), str(tmp_path / "rec.h5"), "--map", str(tmp_path / "map.toml")]) == 2
    assert "arrays.F.axes = [] must name each axis once" in capsys.readouterr().err


def test_rows_as_channels_of_an_only_array_are_said(tmp_path: Path) -> None:
    path = tmp_path / "rig.npy"
    np.save(path, DATA.T)
    content = made(path)[1]
    assert content["arrays"]["rig"]["axes"] == ["channel", "sample"]
    assert [each["array"] for each in content["channels"]] == ["rig"] * 3


def test_counts_of_a_converter_ask_for_sensitivity(tmp_path: Path) -> None:
    path = tmp_path / "rig.mat"
    savemat(path, {"Fx": (1000 * DATA[:, 0]).astype(np.int16), "acc_z": DATA[:, 1], "fs": 1000.0})
    text, content = made(path)
    assert text.count("give sensitivity (counts per unit) and offset too") == 1
    assert content["sample_rate"] == "fs"
    assert all("unit" not in each for each in content["channels"])


@pytest.mark.parametrize(("rate", "asked"), [(2.048, "fs = 2.048: how many samples a second"), (0.001, "fs = 0.001")])
def test_a_rate_that_is_no_rate_in_hertz_is_asked(tmp_path: Path, rate: float, asked: str) -> None:
    path = tmp_path / "rig.mat"
    savemat(path, {"Fx": DATA[:, 0], "fs": rate})
    text, content = made(path)
    assert asked in text
    assert "sample_rate" not in content


@pytest.mark.parametrize("values", [[0, 1e308, 0, 1, 2], [1.7e308, -1.7e308, 0, 1], [-1.7e308, 0, 1.7e308, 1.7e308]])
@pytest.mark.parametrize("column", ["fx", "time_of_day [s]"])
def test_steps_beyond_the_largest_number_are_not_uniform(tmp_path: Path, values: list[float], column: str) -> None:
    path = of_lines(tmp_path, [f"{column};ax", *(f"{value:.5g};1.5" for value in values)])
    assert "rises evenly" not in made(path)[0]


def test_a_rate_and_a_time_that_contradict_are_asked(tmp_path: Path) -> None:
    path = tmp_path / "rig.mat"
    savemat(path, {"Fx": DATA[:, 0], "t": np.arange(N) / 500, "fs": 1000.0})
    assert "t says 500 Hz, fs 1000: which is it" in made(path)[0]


def test_mat_7_3_is_read_with_its_axes(tmp_path: Path) -> None:
    path = tmp_path / "rig.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["F"], file["Fs"] = DATA.T, np.array([[1000.0]])  # HDF5 has the axes in reverse
        file["note"] = np.frombuffer("first cut".encode("utf-16le"), dtype=np.uint16)[None, :]
    content = made(path)[1]
    assert [each["name"] for each in content["channels"]] == ["F_x", "F_y", "F_z"]
    assert content["sample_rate"] == "Fs"
    assert "arrays" not in content


@pytest.mark.parametrize(
    ("kind", "remedy"),
    [("table", "writetable(T, 'T.csv')"), ("timetable", "timetable2table(T)"), ("string", "save its numbers")],
)
def test_objects_of_matlab_are_refused_by_name(tmp_path: Path, kind: str, remedy: str) -> None:
    """MATLAB stores of a table a reference into a part of the file that it alone reads."""
    path = tmp_path / "rig.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["T"] = np.array([[0xDD000000, 2, 1, 1, 58, 8]], dtype=np.uint32)
        file["T"].attrs["MATLAB_class"], file["T"].attrs["MATLAB_object_decode"] = np.bytes_(kind), np.int32(3)
    with pytest.raises(FileFormatError, match=rf"T is a {kind} of MATLAB.*{re.escape(remedy)}"):
        new_mapping(path)
    with h5py.File(path, "a") as file:
        file["F"], file["Fs"] = DATA.T, np.array([[1000.0]])
    assert open_arrays(path).unread == (f"T (a {kind} of MATLAB)",)
    assert [each["array"] for each in made(path)[1]["channels"]] == ["F"] * 3


@pytest.mark.parametrize("shape", [(3, 4), (2, 2), (6, 6)])
def test_matrices_are_no_recordings(tmp_path: Path, shape: tuple[int, int]) -> None:
    path = tmp_path / "camera.npz"
    np.savez(path, RT=np.ones(shape), size=np.array([640, 480]))
    with pytest.raises(InputError, match=rf"holds matrices \(RT {shape[0]}x{shape[1]}\)"):
        new_mapping(path)


def test_arrays_of_another_length_are_named(tmp_path: Path) -> None:
    path = tmp_path / "rig.mat"
    savemat(path, {"Fx": DATA[:, 0], "hammer": DATA[:25, 1], "fs": 1000.0})
    assert "Left out, since they are not as long as the longest or have more axes: hammer 1x25." in made(path)[0]


def test_tdms_states_rate_and_units(tmp_path: Path) -> None:
    path = tmp_path / "rig.tdms"
    with TdmsWriter(path) as writer:
        for name, unit, column in (("Fx", "kN", 0), ("ax", "g", 1), ("ai3", "V", 2)):
            properties = {"wf_increment": 1e-3, "wf_samples": 1, "unit_string": unit}
            writer.write_segment([ChannelObject("rig", name, DATA[:, column], properties=properties)])
    text, content = made(path)
    assert [each["unit"] for each in content["channels"]] == ["kN", "g", "V"]
    assert "FILL IN:" not in text
    np.testing.assert_allclose(converted(path, text), DATA * [1000, 9.80665, 1], rtol=1e-6)


def test_headings_that_stand_twice_are_told_apart(tmp_path: Path) -> None:
    path = of_lines(tmp_path, ["t [s];Fx [N];Fx [N]", *ROWS])
    text, content = made(path)
    assert [(each["name"], each["column"]) for each in content["channels"]] == [("Fx 1", 2), ("Fx 2", 3)]
    np.testing.assert_allclose(converted(path, text), DATA[:, :2], atol=1e-4)


@pytest.mark.parametrize("stated", ["structure", "numbers"])
def test_lines_of_an_frf_by_their_start_and_step(tmp_path: Path, stated: str) -> None:
    """Simcenter Testlab states its lines in a structure; other files hold two numbers, whose meaning is asked."""
    path, f = tmp_path / "frf.mat", 10.0 + 0.5 * np.arange(40)
    values = (1 / (1000.0 - f**2 + 3j * f))[:, None]
    axis = {"start_value": 10.0, "increment": 0.5, "number_of_values": 40.0, "quantity": {"label": "Hz"}}
    structure = {"frf": {"x_values": axis, "y_values": {"values": values}}}
    savemat(path, structure if stated == "structure" else {"H": values, "df": 0.5, "f_start": 10.0})
    assert run(["new", "mapping", str(path), "--frf", "--out", str(tmp_path / "map.toml")]) == 0
    text = (tmp_path / "map.toml").read_text()
    for key in ("responses", "excitations"):
        text = text.replace(f"# {key} =", f'{key} = ["TCP:+X"] #')
    text = text.replace("# unit =", 'unit = "m/N" #')
    if stated == "numbers":
        assert "no array lists frequencies; df = 0.5, f_start = 10?" in text
        text = text.replace("# frequency_step_hz =", "frequency_step_hz = 0.5 #")
        text = text.replace("frequency_start_hz = -1", "frequency_start_hz = 10.0")
    (tmp_path / "map.toml").write_text(text)
    assert run(["convert", str(path), str(tmp_path / "frf.h5"), "--map", str(tmp_path / "map.toml")]) == 0
    frf = read_frf(tmp_path / "frf.h5")
    np.testing.assert_allclose(frf.frequencies, f, rtol=1e-12)
    np.testing.assert_allclose(frf.values[:, 0, 0], values[:, 0], rtol=1e-12)


def test_a_spectrum_over_hertz_is_no_recording(tmp_path: Path) -> None:
    axis = {"start_value": 10.0, "increment": 0.5, "number_of_values": 40.0, "quantity": {"label": "Hz"}}
    savemat(tmp_path / "psd.mat", {"psd": {"x_values": axis, "y_values": {"values": np.ones((40, 1))}}})
    with pytest.raises(InputError, match="no samples over time: its columns are over 'Hz'"):
        new_mapping(tmp_path / "psd.mat")


def test_uff_off_its_columns_is_refused_with_what_is_wrong(tmp_path: Path) -> None:
    (tmp_path / "a.unv").write_text("-1\n55\nmodes\n1 2 2\n-1\n")
    with pytest.raises(FileFormatError, match=r"lines -1, .* do not stand in columns 5 and 6"):
        open_arrays(tmp_path / "a.unv")
