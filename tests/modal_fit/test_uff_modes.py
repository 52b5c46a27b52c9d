"""Modal models in UFF 55: round trips of any number of points, and files of other programs."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyuff

from estimation import Frf
from millfrf.core import FileFormatError, InputError
from modal_fit import ModalModel, import_modes_uff, write_modes_uff
from replay_data import default_structure, table_one_model


def model_of(responses: list[str], excitations: list[str], n_modes: int = 4) -> ModalModel:
    rng = np.random.default_rng(len(responses))
    omega = 2 * np.pi * np.sort(rng.uniform(10, 500, n_modes))

    def draw(n: int) -> np.ndarray:
        return rng.standard_normal((n_modes, n)) + 1j * rng.standard_normal((n_modes, n))

    right, left = draw(len(responses)), 1e-6 * draw(len(excitations))
    return ModalModel((-0.02 + 1j) * omega, right, left, tuple(responses), tuple(excitations))


def assert_same(found: ModalModel, truth: ModalModel) -> None:
    assert (found.responses, found.excitations) == (truth.responses, truth.excitations)
    assert (found.quantity, found.unit) == (truth.quantity, truth.unit)
    np.testing.assert_allclose(found.poles, truth.poles, rtol=1e-5)
    np.testing.assert_allclose(found.right, truth.right, rtol=1e-5, atol=1e-5 * np.abs(truth.right).max())
    np.testing.assert_allclose(found.left, truth.left, rtol=1e-5, atol=1e-5 * np.abs(truth.left).max())


def test_round_trip_keeps_sides_signs_and_nodes(tmp_path: Path) -> None:
    structure = default_structure()
    turned = replace(structure, responses=tuple(label.replace("TCP:+Y", "TCP:-Y") for label in structure.responses))
    write_modes_uff(tmp_path / "modes.uff", turned)
    assert_same(import_modes_uff(tmp_path / "modes.uff")[0], turned)
    assert [path.name for path in tmp_path.iterdir()] == ["modes.uff"]


@pytest.mark.parametrize("n_points", [1, 19, 20, 300])
def test_any_number_of_points_and_names(tmp_path: Path, n_points: int) -> None:
    numbered = [f"{k}:+{axis}" for k in range(5, 5 + n_points) for axis in "XYZ"]
    named = [
        f"Stiel {k}:{sign}{axis}" for k, sign in zip(range(n_points), "+-" * n_points, strict=False) for axis in "ZX"
    ]
    rotations = [f"ARM{k}:+{axis}" for k in range(n_points) for axis in ("RZ", "Y")]
    for responses, excitations in ((numbered, ["7:+Z"]), (named, numbered), (rotations, ["TCP:-X"])):
        truth = model_of(responses, excitations)
        write_modes_uff(tmp_path / "a.unv", truth)
        assert_same(import_modes_uff(tmp_path / "a.unv")[0], truth)


def test_numbered_points_need_no_groups_and_another_reader_sees_them(tmp_path: Path) -> None:
    truth = model_of([f"{k}:+{axis}" for k in (12, 7, 300) for axis in "XYZ"], ["12:+X", "12:+Z"])
    truth = replace(truth, quantity="transfer", unit="m/V")
    write_modes_uff(tmp_path / "a.unv", truth)
    assert_same(import_modes_uff(tmp_path / "a.unv")[0], truth)
    sets = pyuff.UFF(str(tmp_path / "a.unv")).read_sets()
    assert [each["type"] for each in sets] == [55] * 8
    assert list(sets[0]["node_nums"]) == [12, 7, 300]
    np.testing.assert_allclose(sets[0]["r3"][1], truth.right[0, 5], rtol=1e-5)


def test_another_reader_sees_complex_modes(tmp_path: Path) -> None:
    model = table_one_model()
    write_modes_uff(tmp_path / "modes.unv", model)
    sets = [each for each in pyuff.UFF(str(tmp_path / "modes.unv")).read_sets() if each["type"] == 55]
    assert [s["analysis_type"] for s in sets] == [3] * 4
    np.testing.assert_allclose(sets[2]["eig"], model.poles[1], rtol=1e-5)
    np.testing.assert_allclose(np.ravel(sets[2]["r2"])[0], model.right[1, 1], rtol=1e-5)


FREQUENCIES, ZETA, MASSES = np.array([12.0, 40.0]), np.array([0.01, 0.03]), np.array([2.0, 5.0])
SHAPES = np.array([[1.0, 0.5, 0.0, -0.3], [-0.2, 1.0, 0.7, 0.1]])  # points 3 and 8, along X and Z
LABELS = ("3:+X", "3:+Z", "8:+X", "8:+Z")


def receptance(f: np.ndarray) -> np.ndarray:
    """Analytic: sum of ``phi phi^T / m / (w_r^2 - w^2 + 2 i zeta w_r w)``."""
    w, w_r = 2 * np.pi * f[:, None], 2 * np.pi * FREQUENCIES
    gain = 1 / (MASSES * (w_r**2 - w**2 + 2j * ZETA * w_r * w))
    return np.einsum("kr,rp,rq->kpq", gain, SHAPES, SHAPES)


def mode_set(number: int, **changed: Any) -> dict[str, Any]:
    """A normal mode as another program writes it, through pyuff."""
    x, z = SHAPES[number, [0, 2]], SHAPES[number, [1, 3]]
    common = {"type": 55, "model_type": 1, "data_ch": 2, "spec_data_type": 8, "load_case": 0, "mode_n": number + 1}
    normal = {"analysis_type": 2, "freq": FREQUENCIES[number], "modal_m": MASSES[number]}
    values = {"node_nums": np.array([3, 8]), "r1": x, "r2": 0 * x, "r3": z, "modal_damp_vis": ZETA[number]}
    return {**common, **normal, **values, **changed}


def complex_set(number: int, order: int = 0, **changed: Any) -> dict[str, Any]:
    """The same mode as a complex one, its shape differentiated ``order`` times."""
    omega = 2 * np.pi * FREQUENCIES[number]
    pole = omega * complex(-ZETA[number], np.sqrt(1 - ZETA[number] ** 2))
    turn = np.exp(0.4j)  # any complex scale; modal A takes it out
    single = mode_set(number)
    rows = {row: single[row] * turn * pole**order for row in ("r1", "r2", "r3")}
    scale = {"modal_a": 2j * pole.imag * MASSES[number] * turn**2 * pole**order, "modal_b": 0j, "eig": pole}
    return single | rows | scale | {"analysis_type": 3, "spec_data_type": (8, 11, 12)[order], **changed}


def write(path: Path, *sets: dict[str, Any]) -> Path:
    pyuff.UFF(str(path)).write_sets(list(sets), "overwrite")
    return path


def frf_error(model: ModalModel) -> float:
    f = np.linspace(5, 60, 200)
    frf: Frf = model.frf(f)
    assert (frf.responses, frf.excitations) == (LABELS, LABELS)
    return float(np.abs(frf.values - receptance(f)).max() / np.abs(receptance(f)).max())


def test_normal_modes_with_masses_give_the_receptance(tmp_path: Path) -> None:
    model, notes = import_modes_uff(write(tmp_path / "a.uff", mode_set(0), mode_set(1)))
    assert model.quantity == "receptance"
    assert frf_error(model) < 1e-4
    assert len(notes) == 1
    assert "reciprocal" in notes[0]


@pytest.mark.parametrize("order", [0, 1, 2])
def test_complex_modes_of_any_motion_give_the_same_receptance(tmp_path: Path, order: int) -> None:
    path = write(tmp_path / "a.uff", complex_set(0, order), complex_set(1, order))
    # modal A of the file refers to its own motion: an accelerance has s^2 times the residues
    assert frf_error(import_modes_uff(path)[0]) < 1e-4


def test_units_of_the_file_scale_the_model(tmp_path: Path) -> None:
    units = {"type": 164, "units_code": 5, "units_description": "mm", "temp_mode": 1, "length": 1e3, "force": 1.0}
    path = write(tmp_path / "a.uff", units | {"temp": 1.0, "temp_offset": 273.15}, mode_set(0), mode_set(1))
    model, notes = import_modes_uff(path)
    np.testing.assert_allclose(model.receptance(FREQUENCIES), 1e-3 * receptance(FREQUENCIES), rtol=1e-4)
    assert "set 164" in notes[-1]


def test_modes_without_masses_are_a_transfer_with_a_word_of_it(tmp_path: Path) -> None:
    path = write(tmp_path / "a.uff", mode_set(0, modal_m=0.0), mode_set(1, modal_m=0.0, modal_damp_vis=0.0))
    model, notes = import_modes_uff(path)
    assert (model.quantity, model.unit) == ("transfer", "1")
    np.testing.assert_allclose(model.natural_frequencies, FREQUENCIES, rtol=1e-5)
    np.testing.assert_allclose(model.right, SHAPES)
    assert ["no damping" in note for note in notes] == [True, False, False]
    assert "without modal masses" in notes[-1]


def test_rigid_bodies_conjugates_and_further_references_are_left_out(tmp_path: Path) -> None:
    rigid = mode_set(0, freq=0.0)
    low = complex_set(1) | {"eig": complex_set(1)["eig"].conjugate()}
    again = complex_set(0, id5=f"{9:10d}{3:10d}{8:10d}{13:10d}")
    model, notes = import_modes_uff(write(tmp_path / "a.uff", rigid, complex_set(0), again, complex_set(1), low))
    assert frf_error(model) < 1e-4
    said = " ".join(notes)
    for words in ("1 mode at 0 Hz", "1 mode in the lower half plane", "shapes of further references left out (1)"):
        assert words in said


def test_six_values_scalars_and_missing_nodes(tmp_path: Path) -> None:
    turning = {f"r{k}": np.array([0.1, 0.2]) for k in (4, 5, 6)}
    first = mode_set(0, data_ch=3, **turning)
    second = mode_set(1, data_ch=3, **turning)
    model, notes = import_modes_uff(write(tmp_path / "a.uff", first, second))
    assert frf_error(model) < 1e-4
    assert any("rotations" in note for note in notes)
    lines = write(tmp_path / "b.uff", complex_set(0), complex_set(1)).read_text().splitlines(keepends=True)
    six = [line.replace("         5         3\n", "         5         6\n") for line in lines]
    values = [line for line in lines if len(line) == 79]
    for line in values[1:3] + values[4:6]:  # behind the parameters: each node gets three rotations of 0
        six.insert(six.index(line) + 1, "".join(f"{0.0:13.5e}" for _ in range(6)) + "\n")
    (tmp_path / "b.uff").write_text("".join(six))
    assert frf_error(import_modes_uff(tmp_path / "b.uff")[0]) < 1e-4
    still = {"node_nums": np.array([3]), "r1": SHAPES[0, :1], "r2": np.zeros(1), "r3": SHAPES[0, 1:2]}
    model, _ = import_modes_uff(write(tmp_path / "c.uff", mode_set(0, **still), mode_set(1)))
    assert model.responses == LABELS
    np.testing.assert_allclose(model.right[0], [*SHAPES[0, :2], 0, 0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text[: len(text) * 2 // 5], "cut short"),
        (lambda text: text.replace("3.00000e-02", "2.00000e+00"), r"damping ratio of 2; the format holds shares"),
        (lambda text: text.replace("  1.00000e+00  0.00000e+00  5.0", "  1.00000e+00  0.0000x+00  5.0"), "is damaged"),
        (lambda text: text.replace("  1.00000e+00  0.00000e+00  5.0", "          NaN  0.00000e+00  5.0"), "3 finite"),
        (lambda text: "\n".join(text.split("\n")[:11] + text.split("\n")[12:]), "do not come in groups of 2"),
        (lambda text: text.replace("         1         2         2", "         1         4         2"), "types 4"),
        (lambda text: text.replace("         2         3\n", "         2         9\n"), "9 values a node"),
    ],
)  # fmt: skip
def test_damaged_files_of_others_end_in_one_line(tmp_path: Path, change: Any, message: str) -> None:
    path = write(tmp_path / "a.uff", mode_set(0), mode_set(1))
    text = path.read_text()
    path.write_text(change(text))
    assert path.read_text() != text
    with pytest.raises(FileFormatError, match=message) as caught:
        import_modes_uff(path)
    assert "\n" not in str(caught.value)


def test_unusable_files_and_models_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no file"):
        import_modes_uff(tmp_path / "none.uff")
    with pytest.raises(InputError, match="suffix"):
        write_modes_uff(tmp_path / "a.txt", table_one_model())
    (tmp_path / "junk.uff").write_text("nothing\n" * 20, encoding="utf-8")
    with pytest.raises(FileFormatError):
        import_modes_uff(tmp_path / "junk.uff")
    with pytest.raises(InputError, match="has no direction"):
        write_modes_uff(tmp_path / "a.uff", model_of(["1:+S"], ["1:+X"]))
    write_modes_uff(tmp_path / "a.uff", model_of(["A:+X"], ["A:+X"]))
    text = (tmp_path / "a.uff").read_text()
    (tmp_path / "a.uff").write_text(text.replace("left vector of mode 3", "LEFT"))
    with pytest.raises(FileFormatError, match="4 right but 3 left"):
        import_modes_uff(tmp_path / "a.uff")
    with pytest.raises(InputError, match="too long"):
        write_modes_uff(tmp_path / "a.uff", model_of(["A" * 40 + ":+X"], ["A:+X"]))
