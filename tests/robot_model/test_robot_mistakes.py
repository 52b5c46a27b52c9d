"""Typical mistakes with robots: what was done, and the one line that is said; never a library's own words."""

from pathlib import Path

import pytest

from millfrf.command_line import BAD_INPUT, run
from millfrf.robot_model import read_robot

FOLDER = Path(__file__).parents[2] / "millfrf" / "robot_model" / "robots"
KUKA, CHEN = "kuka_kr90_r3100", "chen_2026"
FOREIGN = ("pydantic", "numpy", "Traceback", "KeyError", "IndexError", "Field required", "Input should", "Extra inputs")

IN_FILES = [
    # what was done: robot, old text, new text; what is said
    (KUKA, "tip_node = 11\n", "", "tip_node is missing"),
    (KUKA, "mass_kg = 250.0", "mass_kg = 250.0\nmass = 3", "bodies[1].mass is not a known key"),
    (KUKA, "mass_kg = 250.0", 'mass_kg = "heavy"', "bodies[1].mass_kg must be a number, not 'heavy'"),
    (KUKA, "mass_kg = 250.0", "mass_kg = -250.0", "bodies[1].mass_kg must be above 0, not -250.0"),
    (KUKA, "mass_kg = 250.0", "mass_kg = nan", "bodies[1].mass_kg must be finite, not nan"),
    (KUKA, "mass_kg = 250.0", "mass_kg = 250000.0", "kilograms"),
    (KUKA, "d_m = 0.35\n", "d_m = 350.0\n", "metres"),
    (KUKA, "outer_m = 0.60", "outer_m = 600.0", "metres"),
    (KUKA, "inner_m = 0.50", "inner_m = 0.70", "inner < outer"),
    (KUKA, "young_pa = 69e9", "young_pa = 69.0", "pascals"),
    (KUKA, "density_kg_per_m3 = 2700.0", "density_kg_per_m3 = 2.7", "kg/m^3"),
    (KUKA, "turning_nm_per_rad = 1.03e7", "turning_nm_per_rad = 0.0", "turning_nm_per_rad must be above 0, not 0.0"),
    (KUKA, "limits_deg = [-185.0, 185.0]", "limits_deg = [185.0, -185.0]", "not increasing"),
    (KUKA, 'frame = "4"\nmass_kg', 'frame = "9"\nmass_kg', "no frame '9'"),
    (KUKA, 'frame = "4"\nmass_kg', 'frame = "3"\nmass_kg', "on another body"),
    (KUKA, 'frame = "1"\nnodes = [1, 2]', 'frame = "one"\nnodes = [1, 2]', "no frame 'one'"),
    (KUKA, "nodes = [1, 2]", "nodes = [1, 1]", "two different nodes"),
    (KUKA, "nodes = [1, 2]", "nodes = [-1, 2]", "negative"),
    (KUKA, "nodes = [2, 3]", "nodes = [2, 4]", "bypasses the joint"),
    (KUKA, "tip_node = 11", "tip_node = 40", "no joint and no point"),
    (KUKA, "tip_node = 11", "tip_node = 10", "tool frame"),
    (KUKA, "ratio = 0.04", "ratio = 4.0", "ratio must be below 1, not 4.0"),
    (KUKA, "ratio = 0.04", "ratio = 0.04\nfrequencies_hz = [5.0, 8.0]", "not both"),
    (KUKA, "ratio = 0.04", "ratios = [0.04, 0.04]", "give frequencies_hz and ratios"),
    (KUKA, "ratio = 0.04", "frequencies_hz = [5.0, 8.0]\nratios = [4.0, 4.0]", "ratios = [4.0, 4.0]"),
    (KUKA, "[0.0, -10.0, 100.0, 0.0, 90.0, 0.0]", "[0.0, -10.0, 100.0]", "3 joint values for 6"),
    (KUKA, "[0.0, -10.0, 100.0, 0.0, 90.0, 0.0]", "[0.0, -10.0, 190.0, 0.0, 90.0, 0.0]", "outside"),
    (KUKA, 'motion = "fixed"\nr_m = 0.215', 'motion = "welded"\nr_m = 0.215', "welded"),
    (KUKA, "inertia_kg_m2 = [12.0, 12.0, 12.0]", "inertia_kg_m2 = [12.0, -12.0, 12.0]", "inertia"),
    (KUKA, "inertia_kg_m2 = [12.0, 12.0, 12.0]", "inertia_kg_m2 = [12.0, 1.0, 1.0]", "larger than"),
    (
        KUKA,
        'source = "each link one beam"\n\n[links.tube]\nouter_m = 0.50',
        'angles_deg = [0.0, 9.0, 0.0]\nsource = "each link one beam"\n\n[links.tube]\nouter_m = 0.50',
        "angles_deg",
    ),
    (
        KUKA,
        'source = "tool tip"',
        'source = "tool tip"\n[[points]]\nnode = 11\nframe = "tool"\nat_m = [0.0, 0.0, 0.1]\nsource = "x"',
        "node 11 twice",
    ),
    (CHEN, "length_m = 0.90", "length_m = 900.0", "metres"),
    (CHEN, "damping_ratio = 0.01", "damping_ratio = 1.0", "damping_ratio must be below 1, not 1.0"),
    (CHEN, "[-120.13, 133.37, -14.13]", "[-120.13, 133.37]", "2 joint values for 3"),
    (CHEN, 'name = "P2"', 'name = "P1"', "two postures are named 'P1'"),
]


@pytest.mark.parametrize(("robot", "old", "new", "said"), IN_FILES, ids=[f"{row[0][:4]}-{row[3]}" for row in IN_FILES])
def test_mistakes_in_files(
    robot: str, old: str, new: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (FOLDER / f"{robot}.toml").read_text(encoding="utf-8")
    assert old in text
    own = tmp_path / "own.toml"
    own.write_text(text.replace(old, new, 1), encoding="utf-8")
    code = run(["robot", "stiffness", str(own)])
    error = capsys.readouterr().err
    assert said in error
    assert not any(word in error for word in FOREIGN)
    if code != BAD_INPUT:
        assert "warning: " in error  # a doubt, not a refusal: a posture beyond its limits
        assert said == "outside"
    else:
        assert len(error.strip().splitlines()) == 1


TYPED = [
    (["stiffness", KUKA, "--tip-force", "nan"], "--tip-force nan"),
    (["stiffness", KUKA, "--tip-force", "-3"], "--tip-force -3"),
    (["stiffness", KUKA, "--payload", "nan"], "payload nan"),
    (["stiffness", KUKA, "--payload-at", "0", "0", "0.1"], "--payload KG"),
    (
        ["stiffness", KUKA, "--payload", "5", "--payload-at", "0", "0", "200"],
        "--payload-at 200 m: give a number at most 5 m",
    ),
    (["stiffness", CHEN, "--payload", "5", "--payload-at", "0", "0", "0.2"], "planar"),
    (["stiffness", KUKA, "--at", "1500", "0", "800"], "--at 1500 m: give a number at most 20 m"),
    (["stiffness", KUKA, "--at", "1.5", "0", "nan"], "--at (1.5, 0.0, nan): give 3 numbers X Y Z, in m"),
    (["stiffness", KUKA, "--at", "1.5", "0", "0.8", "--feed", "inf"], "--feed inf deg: give a number at most 1080 deg"),
    (["modes", KUKA, "--joints", "0,-10,100,0,90"], "5 joint values for 6"),
    (["modes", KUKA, "--joints", "0;-10;100;0;90;0"], "list of degrees"),
    (["modes", KUKA, "--joints", "0,-10,nan,0,90,0"], "joint 3 = nan"),
    (["modes", KUKA, "--modes", "0"], "--modes 0"),
    (["modes", "kuka"], "no robot kuka"),
    (["modes", "kuka.toml"], "no robot file"),
    (["frf", KUKA, "--out", "x.h5", "--band", "1", "inf"], "--band: band 1 to inf Hz"),
    (["frf", KUKA, "--out", "x.json", "--sensor-at", "60", "0", "250"], "--sensor-at 60 m: give a number at most 5 m"),
    (["deviation", KUKA, "--x", "1500", "2000", "5"], "metres"),
    (["deviation", KUKA, "--x", "2", "1.5", "5"], "LO <= HI"),
    (["deviation", KUKA, "--drill", "0"], "--drill 0"),
    (["deviation", KUKA, "--feed-per-rev", "nan"], "--feed-per-rev nan"),
    (["deviation", KUKA, "--repeatability", "40"], "--repeatability 40 mm: give a number at most 5 mm"),
    (["deviation", KUKA, "--position-tolerance", "0"], "--position-tolerance 0"),
    (["deviation", KUKA, "--force-uncertainty", "500"], "500 %"),
    (["deviation", "fanuc_s420if"], "spherical wrist"),
    (["map", KUKA, "--picture", "x.png", "--z", "800"], "--z 800 m: give a number at most 20 m"),
    (["map", KUKA, "--picture", "x.png", "--x", "1", "2", "0"], "1 to 1000"),
]


@pytest.mark.parametrize(("arguments", "said"), TYPED, ids=[" ".join(row[0]) for row in TYPED])
def test_mistakes_on_the_command_line(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["robot", *arguments]) == BAD_INPUT
    error = capsys.readouterr().err
    assert said in error
    assert not any(word in error for word in FOREIGN)
    assert not list(tmp_path.iterdir())


@pytest.mark.long
@pytest.mark.parametrize(
    ("column", "value", "said"),
    [
        ("x_m", "1500", "metres"),
        ("rx_rad", "180", "rad"),
        ("fx_n", "many", "numbers"),
        ("fz_n", "nan", "not finite"),
        ("fz_n", "1e9", "newtons"),
        ("x_m", "9", "does not reach"),
    ],
)
def test_mistakes_in_paths(
    column: str, value: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = ["x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad", "fx_n", "fy_n", "fz_n"]
    row = dict(zip(names, ["1.5", "0", "0.7", "3.14159", "0", "0", "100", "0", "200"], strict=True)) | {column: value}
    path, out = tmp_path / "p.csv", tmp_path / "o.csv"
    path.write_text(",".join(names) + "\n" + ",".join(row.values()) + "\n")
    assert run(["robot", "compensate", KUKA, str(path), "--out", str(out)]) == BAD_INPUT
    error = capsys.readouterr().err
    assert said in error
    assert not out.exists()


def test_a_path_is_not_written_over(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "p.csv"
    path.write_text("x_m,y_m,z_m,rx_rad,ry_rad,rz_rad,fx_n,fy_n,fz_n\n1.5,0,0.7,3.14159,0,0,100,0,200\n")
    assert run(["robot", "compensate", KUKA, str(path), "--out", str(path)]) == BAD_INPUT
    assert "is the input itself" in capsys.readouterr().err


def test_the_robots_that_come_along_are_without_fault() -> None:
    for path in FOLDER.glob("*.toml"):
        assert read_robot(path) is not None


@pytest.mark.parametrize("name", ["frf.h5", "model.json"])
def test_a_diagnosis_of_frfs_or_models_is_led_to_the_update(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    given = tmp_path / name
    assert run(["robot", "frf", KUKA, "--out", str(given)]) == 0
    capsys.readouterr()
    words = ["robot", "diagnose", KUKA, str(given), "--pose", "0,-10,100,0,90,0", "--out", str(tmp_path / "out")]
    assert run(words) == BAD_INPUT
    said = capsys.readouterr().err
    assert name in said
    assert "millfrf robot update" in said
    assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()
