"""`millfrf convert` of other programs' FRFs: from their files to a report, and what is refused."""

import gzip
import json
from pathlib import Path

import h5py
import numpy as np
import pytest
import pyuff
from scipy.io import savemat

from estimation import read_frf
from millfrf.command_line import run
from modal_fit import ModalModel, read_modal_model

AXIS = np.arange(1.0, 201.0, 0.25)
NATURAL, DAMPING = np.array([31.0, 74.0, 128.0]), np.array([0.01, 0.008, 0.012])


def accelerance() -> np.ndarray:
    """Six points at one reference, m/s^2/N, with 0.3 % noise: a reciprocal structure of three modes."""
    omega = 2 * np.pi * NATURAL
    poles = omega * (-DAMPING + 1j * np.sqrt(1 - DAMPING**2))
    rng = np.random.default_rng(3)
    shapes = rng.uniform(-1, 1, (3, 6)) + 0j
    model = ModalModel(poles, shapes, shapes[:, :1] / (40j * poles.imag[:, None]), tuple("abcdef"), ("a",))
    h = model.receptance(AXIS)[:, :, 0] * (2j * np.pi * AXIS[:, None]) ** 2
    noise = rng.standard_normal((2, *h.shape)) @ np.eye(6)
    return np.asarray(h + 0.003 * np.sqrt(np.mean(np.abs(h) ** 2)) * (noise[0] + 1j * noise[1]) / np.sqrt(2))


def text_files(folder: Path) -> list[str]:
    """Exports of an analyser in g/N, packed, and the mapping that says which is which."""
    lines = ['[frf]\nunit = "g/N"\naverages = 5\n']
    header = "Analyser\n\nFrequency\tReal\tImaginary\tCoherence\nHz\tg/N\tg/N\t\n"
    for k, h in enumerate(accelerance().T / 9.80665, 1):
        rows = "\n".join(f"{f:.6f}\t{x.real:.9e}\t{x.imag:.9e}\t0.99" for f, x in zip(AXIS, h, strict=True))
        (folder / f"run{k}.txt.gz").write_bytes(gzip.compress((header + rows + "\n").encode()))
        lines.append(f'[[entries]]\nfile = "run{k}.txt.gz"\nresponse = "{k}:+Z"\nexcitation = "1:+Z"\n')
    (folder / "map.toml").write_text("".join(lines))
    return [f"run{k}.txt.gz" for k in range(1, 7)]


def csv_file(folder: Path) -> list[str]:
    """One table with a real and an imaginary column for each point."""
    h = accelerance()
    names = ",".join(f"H{k} re,H{k} im" for k in range(1, 7))
    numbers = np.column_stack([AXIS, np.stack([h.real, h.imag], 2).reshape(len(AXIS), 12)])
    np.savetxt(folder / "frf.csv", numbers, delimiter=",", header="Frequency (Hz)," + names, comments="")
    entries = (
        f'[[entries]]\nresponse = "{k}:+Z"\nexcitation = "1:+Z"\nreal = "H{k} re"\nimaginary = "H{k} im"\n'
        for k in range(1, 7)
    )
    (folder / "map.toml").write_text('[frf]\nunit = "m/s^2/N"\n' + "".join(entries))
    return ["frf.csv"]


def mat_file(folder: Path) -> list[str]:
    """A matrix with its axes in another order, in mm/s^2/N."""
    savemat(folder / "frf.mat", {"f": AXIS, "H": accelerance().T[None] * 1e3})
    (folder / "map.toml").write_text('[frf]\nunit = "mm/s^2/N"\nresponses = ["1..6:+Z"]\nexcitations = ["1:+Z"]\n')
    return ["frf.mat"]


def uff_file(folder: Path) -> list[str]:
    """Data sets 58 with coherence; no mapping."""
    sets = []
    for k, h in enumerate(accelerance().T, 1):
        ends = {
            "rsp_node": k,
            "rsp_dir": 3,
            "ref_node": 1,
            "ref_dir": 3,
            "rsp_ent_name": "NONE",
            "ref_ent_name": "NONE",
        }
        axis = {
            "abscissa_spacing": 1,
            "abscissa_min": 1.0,
            "abscissa_inc": 0.25,
            "x": AXIS,
            "abscissa_spec_data_type": 18,
        }
        names = {f"id{n}": "NONE" for n in range(1, 6)} | {"type": 58, "binary": 0}
        units = {"ordinate_axis_units_lab": "m/s^2", "orddenom_axis_units_lab": "N"}
        kinds = {"ordinate_spec_data_type": 12, "orddenom_spec_data_type": 13}
        sets.append({**ends, **axis, **names, **units, **kinds, "func_type": 4, "data": h})
        nothing = {"ordinate_spec_data_type": 0, "orddenom_spec_data_type": 0}
        sets.append({**ends, **axis, **names, **nothing, "func_type": 6, "data": np.full(len(AXIS), 0.99)})
    pyuff.UFF(str(folder / "frf.unv")).write_sets(sets, "overwrite")
    return ["frf.unv"]


@pytest.mark.long
@pytest.mark.parametrize("make", [text_files, csv_file, mat_file, uff_file])
def test_from_file_to_report_in_three_commands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, make: object, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert callable(make)
    files = make(tmp_path)
    mapping = ["--map", "map.toml"] if Path("map.toml").exists() else []
    assert run(["convert", *files, "frf.h5", *mapping]) == 0, capsys.readouterr().err
    result = read_frf("frf.h5")
    assert (result.responses, result.excitations) == (tuple(f"{k}:+Z" for k in range(1, 7)), ("1:+Z",))
    assert (result.quantity, result.unit) == ("accelerance", "m/s^2/N")
    np.testing.assert_allclose(result.frequencies, AXIS, rtol=1e-5)
    np.testing.assert_allclose(result.values[:, :, 0], accelerance(), rtol=1e-7, atol=1e-9)
    assert (result.coherence is not None) == (make in (text_files, uff_file))
    assert run(["inspect", "frf.h5"]) == 0
    assert run(["fit", "frf.h5", "--band", "10", "180", "--out", "model.json"]) == 0
    np.testing.assert_allclose(read_modal_model("model.json").natural_frequencies, NATURAL, rtol=1e-3)
    assert run(["report", "frf.h5", "model.json", "--out", "report.html"]) == 0


def test_sources_notes_and_doubts_are_stored_with_the_frf(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    files = mat_file(tmp_path)
    assert run(["convert", *files, "frf.h5", "--map", "map.toml"]) == 0
    assert "note: frf.mat: axes of the FRF taken as excitation, response, frequency" in capsys.readouterr().out
    with h5py.File("frf.h5") as file:
        made = json.loads(file.attrs["provenance"])
    assert made["step"] == "convert"
    assert made["sources"][0]["file"] == "frf.mat"
    assert any("axes of the FRF" in text for text in made["inferred"])


def test_the_gate_refuses_conjugated_values_and_nothing_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    np.savez("frf.npz", f=AXIS, H=accelerance().conj())
    labels = 'responses = ["1..6:+Z"]\nexcitations = ["1:+Z"]\n'
    Path("map.toml").write_text('[frf]\nunit = "m/s^2/N"\n' + labels)
    before = sorted(tmp_path.iterdir())
    assert run(["convert", "frf.npz", "frf.h5", "--map", "map.toml"]) == 2
    assert "conjugate the values" in capsys.readouterr().err
    assert sorted(tmp_path.iterdir()) == before
    Path("map.toml").write_text('[frf]\nunit = "m/s^2/N"\nconjugate = true\n' + labels)
    assert run(["convert", "frf.npz", "frf.h5", "--map", "map.toml"]) == 0
    np.testing.assert_allclose(read_frf("frf.h5").values[:, :, 0], accelerance())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["frf.h5"], "give files to read and a file to write: millfrf convert IN... OUT"),
        (["frf.csv", "frf.h5"], "--frf --out map.toml"),
        (["frf.mat", "frf.h5"], "the FRF is in no stated unit: write unit"),
        (["run1.txt.gz", "run2.txt.gz", "frf.h5"], 'Write for each in a mapping: [[entries]] file = "run1.txt.gz"'),
        (["run1.txt.gz", "frf.h5", "--map", "map.toml"], "entry of file run2.txt.gz has no such input"),
        (["frf.mat", "frf.csv", "out.json"], "this command writes .h5"),
        (["frf.unv", "frf.unv"], "is the input itself"),
        (["frf.unv", "run1.txt.gz", "frf.h5"], "convert them separately"),
    ],
)
def test_what_is_missing_is_one_line_with_what_to_write(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    for make in (csv_file, mat_file, uff_file, text_files):
        make(tmp_path)
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    assert run(["convert", *arguments]) == 2
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_uff_files_of_a_roving_hammer_merge_and_go_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    uff_file(tmp_path)
    sets = pyuff.UFF("frf.unv").read_sets()
    for k in range(6):
        pyuff.UFF(f"part{k}.uff").write_sets(sets[2 * k : 2 * k + 2], "overwrite")
    assert run(["convert", *(f"part{k}.uff" for k in range(6)), "frf.h5"]) == 0
    result = read_frf("frf.h5")
    np.testing.assert_allclose(result.values[:, :, 0], accelerance(), rtol=1e-7)
    assert result.coherence is not None
    assert run(["convert", "frf.h5", "again.unv"]) == 0
    assert run(["convert", "again.unv", "again.h5"]) == 0
    again = read_frf("again.h5")
    np.testing.assert_allclose(again.values, result.values, rtol=1e-12)
    np.testing.assert_allclose(again.coherence, result.coherence, rtol=1e-12)
