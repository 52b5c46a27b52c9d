"""The commands and mappings of docs/importing.md, run on files of the layouts that it describes."""

import gzip
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import pyuff
from scipy.io import savemat

from estimation import read_frf, read_geometry
from millfrf.command_line import run
from modal_fit import ModalModel, read_modal_model

PAGE = (Path(__file__).parents[2] / "docs" / "importing.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w+)\n(.*?)```", PAGE, re.DOTALL)
AXIS = np.arange(1.0, 201.0, 0.5)
G = 9.80665
SETUP = "xHammer,0,0\nyHammer,0,0\nzHammer,0.1,0.25\nFxHammer,1,1\nxAccel,0,\nyAccel,0,\nzAccel,0.5,\n"


def commands() -> Iterator[list[str]]:
    """Command lines of the page, in its order."""
    for kind, text in BLOCKS:
        if kind == "sh":
            yield from (shlex.split(line.partition("#")[0])[1:] for line in text.splitlines())


def accelerance(points: int = 6, driven: int = 2) -> np.ndarray:
    """(n_frequencies, points, driven), m/s^2/N: reciprocal, three modes."""
    omega = 2 * np.pi * np.array([31.0, 74.0, 128.0])
    poles = (-0.01 + 1j) * omega
    shapes = np.random.default_rng(3).uniform(-1, 1, (3, points)) + 0j
    labels = tuple(f"{k}:+Z" for k in range(points))
    model = ModalModel(poles, shapes, shapes[:, :driven] / (40j * poles.imag[:, None]), labels, labels[:driven])
    return np.asarray(model.receptance(AXIS) * (2j * np.pi * AXIS[:, None, None]) ** 2)


def texts() -> None:
    h = accelerance()
    heads = ",".join(["f (Hz)", *(f"H{k} {part}" for k in (1, 2, 3) for part in ("re", "im"))])
    columns = [AXIS, *(part for k in range(3) for part in (h[:, k, 0].real / G, h[:, k, 0].imag / G))]
    np.savetxt("plate.csv", np.column_stack(columns), delimiter=",", header=heads, comments="")
    header = "Units: Ratio\nRef Chan:Resp Chan\t0-Z:0-Z\n\nFrequency\t Real\t Imaginary\n\nUnits:\nHz\t(m/s²)(N)\t \n"
    for q in range(2):
        rows = "\n".join(f"{f:.6e}\t{x.real:.9e}\t{x.imag:.9e}" for f, x in zip(AXIS, h[:, 3, q], strict=True))
        Path(f"H{q + 1}.txt.gz").write_bytes(gzip.compress((header + rows + "\n").encode("latin-1")))
    Path("setup.csv").write_text(SETUP)


def arrays() -> None:
    h = accelerance()
    savemat("plate.mat", {"f": AXIS, "H": h.transpose(1, 2, 0), "coh": np.full(h.shape, 0.95).transpose(1, 2, 0)})
    for q in range(2):
        pairs = {f"H1_{p + 2}": np.column_stack([AXIS, h[:, p, q] / G]) for p in range(2)}
        pairs |= {f"C1_{p + 2}": np.column_stack([AXIS, np.full(len(AXIS), 0.9)]) for p in range(2)}
        savemat(f"point{q + 1}.mat", pairs)
    plane = accelerance(74, 3).transpose(0, 2, 1)
    np.savez("plane.npz", frequency_hz=AXIS, accelerance=plane, coherence=np.full(plane.shape, 0.95))


def uffs() -> None:
    h = accelerance()
    nodes = {"type": 15, "node_nums": [1, 2], "def_cs": [0, 0], "disp_cs": [0, 0], "color": [1, 1]}
    sets = [nodes | {"x": [0.0, 0.1], "y": [0.0, 0.0], "z": [0.0, 0.0]}]
    for k in range(2):
        ends = {"rsp_node": k + 1, "rsp_dir": 3, "ref_node": 1, "ref_dir": 3}
        axis = {"abscissa_spacing": 1, "abscissa_min": 1.0, "abscissa_inc": 0.5, "x": AXIS}
        units = {"ordinate_axis_units_lab": "g", "orddenom_axis_units_lab": "N"}
        kinds = {"ordinate_spec_data_type": 12, "orddenom_spec_data_type": 13, "binary": 0, "func_type": 4}
        names = {f"id{n}": "NONE" for n in range(1, 6)} | {"rsp_ent_name": "NONE", "ref_ent_name": "NONE"}
        sets.append({"type": 58, **ends, **axis, **units, **kinds, **names, "data": h[:, k, 0] / G})
    pyuff.UFF("test.unv").write_sets(sets, "overwrite")
    mode = {"type": 55, "model_type": 1, "data_ch": 2, "spec_data_type": 8, "load_case": 0, "analysis_type": 2}
    mode |= {"freq": 31.0, "modal_m": 20.0, "modal_damp_vis": 0.01, "mode_n": 1, "node_nums": np.array([1, 2])}
    pyuff.UFF("modes.unv").write_sets([mode | {row: np.array([1.0, 0.5]) for row in ("r1", "r2", "r3")}], "overwrite")


@pytest.mark.long
def test_every_command_of_the_page_does_what_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for make in (texts, arrays, uffs):
        make()
    for kind, text in BLOCKS:
        if kind == "toml":
            Path(text.splitlines()[0].removeprefix("# ")).write_text(text, encoding="utf-8")
    h = accelerance()
    result: dict[str, np.ndarray] = {}
    for line in commands():
        again = [] if line[0] == "inspect" else ["--force"]  # the page's examples stand apart, here in one folder
        assert run([*line, *again]) == 0, (line, capsys.readouterr().err)
        if line[0] == "convert" and "frf.h5" in line:
            frf = read_frf("frf.h5")
            assert (frf.quantity, frf.unit) == ("accelerance", "m/s^2/N")
            result[line[1]] = frf.values
    np.testing.assert_allclose(result["test.unv"], h[:, :2, :1], rtol=1e-9)
    np.testing.assert_allclose(result["plate.csv"], h[:, :3, :1], rtol=1e-9)
    np.testing.assert_array_equal(result["plate.mat"], h)
    np.testing.assert_allclose(result["point1.mat"], h[:, :2], rtol=1e-12)
    np.testing.assert_allclose(result["H1.txt.gz"], h[:, 3:4], rtol=1e-8)
    assert result["plane.npz"].shape == (len(AXIS), 3, 74)
    np.testing.assert_allclose(read_modal_model("model.json").natural_frequencies, [31, 74, 128], rtol=1e-3)
    assert read_geometry("geometry.toml").nodes == ("Hammer1", "Hammer2", "Accel")
    np.testing.assert_allclose(read_geometry("by_hand.toml").direction("TIP:+X"), [0, 1, 0])
    assert Path("report.html").stat().st_size > 10_000
