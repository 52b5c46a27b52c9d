"""Geometry: directions and places, and files of it, written by other means than those that read them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyuff

from estimation import Geometry, import_geometry, read_geometry, write_geometry
from millfrf.command_line import run
from millfrf.core import FileFormatError, InputError

UNITS = {"type": 164, "units_code": 5, "units_description": "mm", "temp_mode": 1, "length": 1e3, "force": 1e3}
UNITS |= {"temp": 1.0, "temp_offset": 273.15}


def write(path: Path, *sets: dict[str, Any]) -> Path:
    pyuff.UFF(str(path)).write_sets([dict(each) for each in sets], "overwrite")
    return path


def nodes(kind: int, rows: list[tuple[int, int, int, float, float, float]]) -> dict[str, Any]:
    """Number, definition system, displacement system, three coordinates."""
    number, defined, measured, x, y, z = (list(column) for column in zip(*rows, strict=True))
    systems = {"def_cs": defined, "disp_cs": measured, "color": [1] * len(rows)}
    return {"type": kind, "node_nums": number, **systems, "x": x, "y": y, "z": z}


def systems(*given: tuple[int, int, np.ndarray]) -> dict[str, Any]:
    """Data set 2420: number, kind, matrix (4, 3)."""
    numbers, kinds, matrices = zip(*given, strict=True)
    single = {"type": 2420, "part_UID": 1, "part_name": "P", "cs_type": 0, "cs_color": 8}
    return single | {
        "CS_sys_labels": list(numbers),
        "CS_types": list(kinds),
        "CS_colors": [8] * len(given),
        "CS_names": [f"CS{n}" for n in numbers],
        "CS_matrices": list(matrices),
    }


def rotation(seed: int) -> np.ndarray:
    """Rows are right-handed unit vectors."""
    q, r = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    return np.asarray(q if np.linalg.det(q) > 0 else q[[1, 0, 2]])


def test_directions_and_places() -> None:
    turned = np.array([np.eye(3), 5 * rotation(1)])
    beam = Geometry(("1", "TIP"), np.array([[0.0, 0, 0], [0.3, 0, 0.1]]), turned, (("1", "TIP"),))
    np.testing.assert_allclose(beam.position("TIP"), [0.3, 0, 0.1])
    np.testing.assert_allclose(beam.direction("1:-Z"), [0, 0, -1])
    np.testing.assert_allclose(beam.direction("TIP:+Y"), rotation(1)[1])
    np.testing.assert_allclose(beam.direction("TIP:-RX"), -rotation(1)[0])
    with pytest.raises(InputError, match="has no node 2; it has 1, TIP"):
        beam.direction("2:+X")
    with pytest.raises(InputError, match="no direction"):
        beam.direction("1:+S")


@pytest.mark.parametrize(
    ("names", "positions", "axes", "lines", "message"),
    [
        (("1", "1"), np.zeros((2, 3)), None, (), "node 1 is given twice"),
        (("1",), np.zeros((1, 2)), None, (), "three coordinates"),
        (("1",), np.full((1, 3), np.nan), None, (), "node 1 is not finite"),
        (("1",), np.zeros((1, 3)), np.ones((1, 3, 3)), (), "node 1 are not three directions at right angles"),
        (("1",), np.zeros((1, 3)), np.zeros((1, 3, 3)), (), "right angles"),
        (("1",), np.zeros((1, 3)), None, (("1", "7"),), "line goes to node 7"),
        ((), np.zeros((0, 3)), None, (), "at least"),
    ],
)
def test_what_does_not_hold_together_is_refused(
    names: tuple[str, ...], positions: np.ndarray, axes: np.ndarray | None, lines: Any, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        Geometry(names, positions, axes, lines)


def test_toml_round_trip_and_a_file_written_by_hand(tmp_path: Path) -> None:
    axes = np.array([np.eye(3), rotation(2), np.eye(3)])
    truth = Geometry(("1", "TIP A", 'a"b'), rotation(3), axes, (("1", "TIP A"), ("TIP A", 'a"b', "1")))
    write_geometry(tmp_path / "g.toml", truth)
    result = read_geometry(tmp_path / "g.toml")
    assert (result.nodes, result.lines) == (truth.nodes, truth.lines)
    np.testing.assert_array_equal(result.positions, truth.positions)
    assert result.axes is not None
    np.testing.assert_allclose(result.axes, axes, atol=1e-15)
    (tmp_path / "h.toml").write_text('unit = "mm"\n[nodes]\n1 = [0, 0, 0]\nTCP = [120, -5.5, 0]\n')
    np.testing.assert_allclose(read_geometry(tmp_path / "h.toml").position("TCP"), [0.12, -0.0055, 0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nodes = 3\n", r"nodes must be a table"),
        ("[nodes]\n1 = [0, 0]\n", r"g.toml: nodes\.1 must have more entries"),
        ('[nodes]\n1 = [0, 0, 0]\n[axes]\n2 = [[1,0,0],[0,1,0],[0,0,1]]\n', "node 2, which is not there"),
        ('unit = "kg"\n[nodes]\n1 = [0, 0, 0]\n', "'kg' is not a unit of displacement"),
        ('lines = [["1", "2"]]\n[nodes]\n1 = [0, 0, 0]\n', "line goes to node 2"),
        ("[nodes]\n1 = [nan, 0, 0]\n", "nodes.1"),
        ("[other]\nx = 1\n", "is no geometry"),
        ("[nodes\n", "is not TOML"),
    ],
)  # fmt: skip
def test_wrong_toml_ends_in_one_line(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "g.toml").write_text(text)
    with pytest.raises(FileFormatError, match=message) as caught:
        read_geometry(tmp_path / "g.toml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", [15, 2411])
def test_uff_nodes_systems_lines_and_units(tmp_path: Path, kind: int) -> None:
    axes = rotation(4)
    matrix = np.vstack([axes, [10.0, 0, 0]])
    rows = [(5, 0, 0, 0.0, 0.0, 0.0), (12, 0, 3, 100.0, 20.0, 0.0), (7, 0, 0, 0.0, 0.0, 50.0)]
    trace = {"type": 82, "trace_num": 1, "n_nodes": 6, "color": 1, "id": "T", "nodes": np.array([5, 12, 0, 7, 5, 99])}
    path = write(tmp_path / "g.unv", UNITS, systems((3, 0, matrix)), nodes(kind, rows), trace)
    result, notes = import_geometry(path)
    assert result.nodes == ("5", "12", "7")
    np.testing.assert_allclose(result.position("12"), [0.1, 0.02, 0])
    for k, axis in enumerate("XYZ"):
        np.testing.assert_allclose(result.direction(f"12:-{axis}"), -axes[k], atol=1e-6)
        np.testing.assert_allclose(result.direction(f"7:+{axis}"), np.eye(3)[k])
    assert result.lines == (("5", "12"), ("7", "5"))
    assert notes == ("g.unv: lines to 1 missing nodes are left out",)


def test_cylinders_and_spheres(tmp_path: Path) -> None:
    """A point at radius 2, 90 degrees around the local Z, 3 up: +X outward, +Y along the turn."""
    axes, origin = rotation(5), np.array([1.0, 2.0, 3.0])
    matrix = np.vstack([axes, origin])
    rows = [(1, 1, 1, 2.0, 90.0, 3.0), (2, 2, 2, 2.0, 90.0, 90.0)]
    path = write(tmp_path / "g.uff", systems((1, 1, matrix), (2, 2, matrix)), nodes(15, rows))
    result, notes = import_geometry(path)
    np.testing.assert_allclose(result.position("1"), origin + 2 * axes[1] + 3 * axes[2], atol=1e-5)
    np.testing.assert_allclose(result.direction("1:+X"), axes[1], atol=1e-5)
    np.testing.assert_allclose(result.direction("1:+Y"), -axes[0], atol=1e-5)
    np.testing.assert_allclose(result.position("2"), origin + 2 * axes[1], atol=1e-5)
    np.testing.assert_allclose(result.direction("2:+X"), axes[1], atol=1e-5)
    np.testing.assert_allclose(result.direction("2:+Y"), -axes[2], atol=1e-5)
    np.testing.assert_allclose(result.direction("2:+Z"), -axes[0], atol=1e-5)
    assert "states no units" in notes[0]


def points(number: int, reference: int, corner: np.ndarray, padding: str) -> str:
    """One system of data set 18: origin, a point on +X, a point in the plane of +X and +Z."""
    first, second = corner[:2].ravel(), corner[2]
    fields = ["".join(f"{x:13.5e}" for x in row) + padding for row in (first, second)]
    return "\n".join([f"{number:10d}{0:10d}{reference:10d}{8:10d}{1:10d}", f"SYS{number}", *fields]) + "\n"


@pytest.mark.parametrize("padding", ["", "  "])
def test_systems_by_points_one_in_another(tmp_path: Path, padding: str) -> None:
    """Lines that are filled up with blanks to 80 characters shift pyuff's fields; they must not shift ours."""
    outer, inner = rotation(6), rotation(7)
    origin = np.array([1.0, -2.0, 0.5])
    text = points(1, 0, np.array([origin, origin + 2 * outer[0], origin + outer[0] + 3 * outer[2]]), padding)
    text += points(4, 1, np.array([np.zeros(3), inner[0], inner[2]]), padding)
    path = write(tmp_path / "g.uff", nodes(15, [(1, 0, 4, 0.0, 0.0, 0.0), (2, 1, 0, 1.0, 0.0, 0.0)]))
    path.write_text(f"    -1\n    18\n{text}    -1\n" + path.read_text())
    result = read_geometry(path)
    for k, axis in enumerate("XYZ"):
        np.testing.assert_allclose(result.direction(f"1:+{axis}"), (inner @ outer)[k], atol=1e-4)
    np.testing.assert_allclose(result.position("2"), origin + outer[0], atol=1e-4)


def test_wrong_uff_geometry_ends_in_one_line(tmp_path: Path) -> None:
    rows = [(1, 0, 0, 0.0, 0.0, 0.0), (2, 0, 0, 1.0, 0.0, 0.0)]
    path = write(tmp_path / "a.uff", nodes(15, rows))
    text = path.read_text()
    for changed, message in (
        (text.replace(" 0.00000E+00\n", "\n", 1), "damaged or cut short"),
        (text + text.replace("1.00000E+00", "2.00000E+00"), "node 2 lies at two places"),
        (text[:-20], "cut short"),
        (text.replace("1.00000E+00", "        nan"), "damaged or cut short"),
        (f"    -1\n    18\n{points(3, 9, np.eye(3), '')}    -1\n" + text, "system 9 is referred to but missing"),
        (f"    -1\n    18\n{points(3, 0, np.zeros((3, 3)), '')}    -1\n" + text, "lie on one line"),
        (f"    -1\n    18\n{points(3, 4, np.eye(3), '')}{points(4, 3, np.eye(3), '')}    -1\n" + text, "to itself"),
    ):
        path.write_text(changed)
        with pytest.raises(FileFormatError, match=message) as caught:
            read_geometry(path)
        assert "\n" not in str(caught.value)
    _, notes = import_geometry(write(tmp_path / "b.uff", UNITS, nodes(15, [(1, 0, 6, 0.0, 0.0, 0.0)])))
    assert notes == ("b.uff: coordinate system 6 is missing; the structure's own axes are taken",)


SETUP = """xHammer,0,0,0
yHammer,0,0,0
zHammer,0.1,0.25,0.375
FxHammer,1,1,1
xAccel,0,,
yAccel,0,,
zAccel,0.5,,
fMin,65,,
"""


def test_tables_of_nodes(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("Node;X (mm);Y [mm];Z(mm);note\n12;100;0;-3.5;tip\nA;0;0;1;\n")
    result, notes = import_geometry(tmp_path / "a.csv")
    assert (result.nodes, notes) == (("12", "A"), ())
    np.testing.assert_allclose(result.position("12"), [0.1, 0, -0.0035])
    (tmp_path / "b.csv").write_text("x [mm],y [mm],z [mm]\n750,850,0\n750,750,0\n")
    result, notes = import_geometry(tmp_path / "b.csv")
    assert (result.nodes, notes) == (("1", "2"), ())
    np.testing.assert_allclose(result.position("2"), [0.75, 0.75, 0])
    (tmp_path / "setup.csv").write_text(SETUP)
    result, notes = import_geometry(tmp_path / "setup.csv")
    assert result.nodes == ("Hammer1", "Hammer2", "Hammer3", "Accel")
    np.testing.assert_allclose(result.positions[:, 2], [0.1, 0.25, 0.375, 0.5])
    assert "taken in m" in notes[0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("node,x,y\n1,0,0\n", "has no column z"),
        ("node,x,y,z\n1,0,zero,0\n", "row 2, column 3: 'zero' is not a number"),
        ("node,x,y,z\n1,0,0\n", "row 2, column 4: '' is not a number"),
        ("f,re,im\n1,2,3\n", "is no table of nodes"),
        ("", "is no table of nodes"),
        ("xA,1,2\nyA,1\nzA,1,2\n", "have 2 of x, 1 of y, 2 of z"),
    ],
)
def test_wrong_tables_end_in_one_line(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(FileFormatError, match=message):
        read_geometry(tmp_path / "a.csv")


def test_it_is_converted_and_looked_at(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path / "g.unv", nodes(15, [(1, 0, 0, 0.0, 0.0, 0.0), (2, 0, 0, 300.0, 0.0, 0.0)]))
    assert run(["convert", str(tmp_path / "g.unv"), str(tmp_path / "g.toml")]) == 0
    assert "states no units" in capsys.readouterr().err
    assert run(["inspect", str(tmp_path / "g.toml")]) == 0
    said = capsys.readouterr().out
    assert "geometry of 2 nodes, X 0 to 300 m" in said
    assert "is the file in mm?" in said
