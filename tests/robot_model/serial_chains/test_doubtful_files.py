"""Files that a robot maker or a simulator left half empty: what is doubted once stays doubted in every result."""

import re
from pathlib import Path

import pytest

from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.core import InputError
from millfrf.robot_model import in_posture, read_robot

UR10E = Path(__file__).parent / "robots" / "ur10e.urdf"
TOOL = ["--tool", "0", "0", "0.2", "--spindle-mass", "4"]


def made(tmp_path: Path, text: str, *options: str) -> tuple[int, Path]:
    """Exit code of the command and the file that it wrote, from the text of a URDF."""
    urdf, out = tmp_path / "robot.urdf", tmp_path / "robot.toml"
    urdf.write_text(text)
    return run(["new", "robot", str(urdf), "--out", str(out), "--force", *TOOL, *options]), out


def warnings_of(out: Path) -> str:
    case = read_robot(out)
    return " ".join(in_posture(case, next(iter(case.poses.values()))).warnings)


def test_a_spindle_alone_is_no_robot_with_modes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bare = re.sub(r"<inertial>.*?</inertial>", "", UR10E.read_text(), flags=re.DOTALL)
    code, out = made(tmp_path, bare, "--rated-payload", "10")
    assert code == DONE
    said = capsys.readouterr()
    assert "natural frequencies" not in said.out + said.err
    assert "modes and lobes cannot" in said.out
    case = read_robot(out)
    result = in_posture(case, next(iter(case.poses.values())))
    assert not len(result.frequencies)
    with pytest.raises(InputError, match="statics, not modes"):
        result.known_model()


def test_masses_that_look_like_placeholders_are_named_in_every_result(tmp_path: Path) -> None:
    alike = re.sub(r'<mass value="[^"]*"', '<mass value="2.0"', UR10E.read_text())
    code, out = made(tmp_path, alike)
    assert code == DONE
    assert "mass and inertia of " in warnings_of(out)
    assert "forearm_link" in warnings_of(out)
    code, out = made(tmp_path, UR10E.read_text())
    assert code == DONE
    assert "forearm_link" not in warnings_of(out)


def test_a_stiffness_in_another_unit_is_doubted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert made(tmp_path, UR10E.read_text(), "--joint-stiffness", "30,30,30,1e4,1e4,1e4")[0] == DONE
    said = capsys.readouterr()
    assert "shoulder_pan_joint 30, shoulder_lift_joint 30, elbow_joint 30 is far from" in said.out + said.err
    assert made(tmp_path, UR10E.read_text(), "--joint-stiffness", "3e4,3e4,3e4,1e4,1e4,1e4")[0] == DONE
    said = capsys.readouterr()
    assert "is the unit right" not in said.out + said.err


def test_a_joint_without_limits_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert made(tmp_path, re.sub(r"<limit[^>]*/>", "", UR10E.read_text(), count=1))[0] == DONE
    said = capsys.readouterr()
    assert "the URDF gives no limits of shoulder_pan_joint: no posture is beyond them" in said.out + said.err


def test_a_fault_names_the_users_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def longer(match: re.Match[str]) -> str:
        return f'xyz="{" ".join(str(1000 * float(value)) for value in match[1].split())}"'

    code, out = made(tmp_path, re.sub(r'xyz="([^"]*)"', longer, UR10E.read_text()))
    said = capsys.readouterr().err
    assert code == BAD_INPUT
    assert "give metres" in said
    assert "robot.urdf, as " in said
    assert "unfinished" not in said
    assert not out.exists()


def test_the_heaviest_class_has_no_bound(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert made(tmp_path, UR10E.read_text(), "--rated-payload", "900")[0] == DONE
    said = capsys.readouterr()
    assert "class of the heaviest robots" in said.out + said.err
    assert "inf kg" not in said.out + said.err
