"""Robots of others from URDF: masses, places and the mass matrix are Pinocchio's; three commands lead to lobes."""

from pathlib import Path

import numpy as np
import pytest

from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.robot_model import SpatialCase, modes_at, read_robot, read_urdf, structure_at
from millfrf.robot_model.finite_elements.structure import coordinate_basis, mass_matrix
from millfrf.stability import read_lobes

ROBOTS = Path(__file__).parent / "robots"
SIX, SEVEN = "3e4,3e4,3e4,1e4,1e4,1e4", "5e7,4e5,4e5,3e5,8e4,8e4,5e4"
CUT = """[cutting]
teeth = 2
diameter_m = 0.01
ktc_pa = 119e6
krc = 0.17
kac = 0.33
start_angle_deg = 90.0
exit_angle_deg = 180.0
"""


def made(tmp_path: Path, name: str, *options: str) -> SpatialCase:
    """The robot file that the command writes, read."""
    out = tmp_path / f"{name}.toml"
    assert run(["new", "robot", str(ROBOTS / f"{name}.urdf"), "--out", str(out), *options]) == DONE
    case = read_robot(out)
    assert isinstance(case, SpatialCase)
    return case


@pytest.mark.parametrize(("name", "stiffness"), [("ur10e", SIX), ("tx90_on_rail", SEVEN)])
def test_masses_places_and_mass_matrix_are_those_of_pinocchio(tmp_path: Path, name: str, stiffness: str) -> None:
    pinocchio = pytest.importorskip("pinocchio", reason="Pinocchio has no wheel for this system")
    case = made(tmp_path, name, "--joint-stiffness", stiffness)
    model = pinocchio.buildModelFromUrdf(str(ROBOTS / f"{name}.urdf"))
    data = model.createData()
    chain = read_urdf(ROBOTS / f"{name}.urdf").chain
    for number, joint in enumerate(chain.joints, start=1):
        assert model.names[number] == joint.name
        parts = [part for part in chain.parts if part.joint == joint.name]
        mass = sum(part.mass for part in parts)
        centre = sum((part.mass * part.centre for part in parts), np.zeros(3)) / mass
        about = np.zeros((3, 3))
        for part in parts:
            arm = part.centre - centre
            about += part.inertia + part.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        other = model.inertias[number]
        assert mass == pytest.approx(other.mass, rel=1e-12)
        assert centre == pytest.approx(other.lever, abs=1e-10)
        assert about == pytest.approx(other.inertia, abs=1e-10)
    rng = np.random.default_rng(11)
    for _ in range(4):
        q = rng.uniform(-1.5, 1.5, model.nq)
        whole = np.triu(pinocchio.crba(model, data, q))
        whole = whole + np.triu(whole, 1).T
        structure = structure_at(case.robot, q)
        basis = coordinate_basis(structure)
        assert basis.T @ mass_matrix(structure) @ basis == pytest.approx(whole, abs=1e-10 * np.abs(whole).max())
        pinocchio.framesForwardKinematics(model, data, q)
        place = data.oMf[model.getFrameId("tool0")].homogeneous
        assert case.robot.mechanism.transforms(q)[-1] == pytest.approx(place, abs=1e-10)
        assert structure.positions[case.robot.tip] == pytest.approx(place[:3, 3], abs=1e-10)
        stiffness_matrix = np.diag([float(value) for value in stiffness.split(",")])
        squares = np.linalg.eigvals(np.linalg.solve(whole, stiffness_matrix)).real
        expected = np.sqrt(np.sort(squares)) / (2 * np.pi)
        assert modes_at(case.robot, q).frequencies == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize(("name", "place"), [("ur10e", ["0.7", "0.2", "0.3"]), ("tx90_on_rail", ["0.6", "2.5", "0.6"])])
def test_from_file_to_lobes_in_three_commands(
    tmp_path: Path, name: str, place: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    made(tmp_path, name, "--tool", "0", "0", "0.18", "--spindle-mass", "4")
    robot, cut = str(tmp_path / f"{name}.toml"), tmp_path / "cut.toml"
    cut.write_text(CUT)
    assert run(["robot", "modes", robot, "--at", *place]) == DONE
    lobes = tmp_path / "lobes.csv"
    options = ["--cutting", str(cut), "--speeds", "3000", "6000", "3", "--max-depth", "0.02", "--out", str(lobes)]
    assert run(["robot", "lobes", robot, "--at", *place, *options]) == DONE
    assert "stiffness of joints" in capsys.readouterr().err  # what was assumed is said with each result
    result = read_lobes(lobes)
    assert np.all(result.depth_limits > 0)
    assert any("is assumed" in warning for warning in result.warnings)


def test_a_parallelogram_is_refused_unless_the_branch_is_chosen(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    urdf, out = str(ROBOTS / "m900ib700.urdf"), tmp_path / "r.toml"
    common = ["new", "robot", urdf, "--out", str(out), "--total-mass", "1900", "--rated-payload", "700"]
    assert run(common) == BAD_INPUT
    said = capsys.readouterr().err
    assert "follows joint_3" in said
    assert "--flange LINK" in said
    assert not out.exists()
    assert run([*common, "--flange", "plink_1"]) == BAD_INPUT  # this way leads over a joint that follows another
    assert "parallelogram" in capsys.readouterr().err
    assert run([*common, "--flange", "tool0"]) == DONE
    said = capsys.readouterr().err
    assert "its stiffness is left out" in said
    assert "pjoint_1" in out.read_text()
