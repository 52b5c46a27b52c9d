"""Files that a robot maker or a simulator left half empty: what is doubted once stays doubted in every result."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.core import InputError
from millfrf.robot_model import TYPICAL, in_posture, read_robot, read_urdf, typical_stiffness
from millfrf.robot_model.files import serial_file

UR10E = Path(__file__).parent / "robots" / "ur10e.urdf"
TOOL = ["--tool", "0", "0", "0.2"]


def made(tmp_path: Path, text: str, *options: str) -> tuple[int, Path]:
    """Exit code of the command and the file that it wrote, from the text of a URDF."""
    urdf, out = tmp_path / "robot.urdf", tmp_path / "robot.toml"
    urdf.write_text(text)
    spindle = [] if "--spindle-mass" in options else ["--spindle-mass", "4"]
    return run(["new", "robot", str(urdf), "--out", str(out), "--force", *TOOL, *spindle, *options]), out


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


def arm(
    masses: Sequence[float] = (20.0, 18.0, 15.0, 5.0, 3.0, 2.0), last_axis: str = "0 0 1", turn: str = "0 0 0"
) -> str:
    """URDF of six joints, a reach of 1.4 m, whose last axis is the flange's z; ``turn`` is that of its flange."""
    axes = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", last_axis)
    places = ("0 0 0.3", "0 0 0.2", "0 0 0.7", "0.2 0 0", "0.4 0 0", "0.1 0 0")
    text = '<robot name="arm"><link name="l0"/>'
    for number, (mass, axis, place) in enumerate(zip(masses, axes, places, strict=True), 1):
        moment = 0.02 * mass
        quarter = ' rpy="0 1.5707963267948966 0"' if number == 6 else ""
        text += (
            f'<link name="l{number}"><inertial><origin xyz="0.1 0 0"/><mass value="{mass}"/><inertia ixx="{moment}" '
            f'ixy="0" ixz="0" iyy="{moment}" iyz="0" izz="{moment}"/></inertial></link>'
            f'<joint name="j{number}" type="revolute"><parent link="l{number - 1}"/><child link="l{number}"/>'
            f'<origin xyz="{place}"{quarter}/><axis xyz="{axis}"/><limit lower="-3" upper="3" effort="1" '
            'velocity="1"/></joint>'
        )
    flange = '<joint name="f" type="fixed"><parent link="l6"/><child link="tool0"/>'
    return f'{text}<link name="tool0"/>{flange}<origin xyz="0 0 0.05" rpy="{turn}"/></joint></robot>'


def frequencies(tmp_path: Path, text: str, spindle: float = 1.0) -> np.ndarray:
    code, out = made(tmp_path, text, "--spindle-mass", f"{4 * spindle}")
    assert code == DONE
    case = read_robot(out)
    return in_posture(case, next(iter(case.poses.values()))).frequencies


def test_a_heavier_forearm_lowers_the_frequencies_without_a_step(tmp_path: Path) -> None:
    # the classes of payload that were assumed before gave 7.0 Hz at 5 kg and 14.4 Hz at 43 kg
    masses = np.linspace(5.0, 60.0, 12)
    lowest = np.array([frequencies(tmp_path, arm((20, 18, 15, mass, 3, 2)))[0] for mass in masses])
    steps = np.diff(np.log(lowest))
    assert (steps < 0).all()
    assert (np.abs(np.diff(steps)) < 0.05).all()


def test_all_masses_times_a_number_keep_the_frequencies(tmp_path: Path) -> None:
    given = np.array((20.0, 18.0, 15.0, 5.0, 3.0, 2.0))
    light, heavy = (frequencies(tmp_path, arm(tuple(factor * given)), spindle=factor) for factor in (1.0, 7.3))
    np.testing.assert_allclose(light, heavy, rtol=1e-5)


def test_the_assumed_stiffness_is_proportional_to_the_payload_and_to_the_reach(tmp_path: Path) -> None:
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(arm())
    chain = read_urdf(urdf).chain
    payloads = np.geomspace(3.0, 1300.0, 200)
    middles = np.array([[middle for middle, _ in typical_stiffness(chain, payload)] for payload in payloads])
    np.testing.assert_allclose(middles / payloads[:, None], middles[0] / payloads[0] * np.ones((200, 1)), rtol=1e-12)
    longer = re.sub(r'xyz="(\S+) 0 (\S+)"', lambda m: f'xyz="{2 * float(m[1])} 0 {2 * float(m[2])}"', arm())
    urdf.write_text(longer)
    doubled = [middle for middle, _ in typical_stiffness(read_urdf(urdf).chain, payloads[0])]
    np.testing.assert_allclose(doubled, 2 * middles[0], rtol=1e-9)


def test_a_forearm_that_outweighs_the_arm_is_doubted_in_every_result(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert made(tmp_path, arm())[0] == DONE
    assert "outweighs" not in capsys.readouterr().err
    code, out = made(tmp_path, arm((20, 18, 15, 42.9, 3, 2)))
    assert code == DONE
    assert "body l4: with 42.9 kg behind joint j4 it outweighs each body before it" in capsys.readouterr().err
    assert "mass and inertia of l4" in warnings_of(out)


@pytest.mark.parametrize("turn", ["0 1.5707963 0", "1.5707963 0 0", "0.3 0.9 -0.4"])
def test_a_tool_across_the_last_joint_is_doubted_and_the_advice_turns_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], turn: str
) -> None:
    assert made(tmp_path, arm())[0] == DONE
    assert "axis of the last joint" not in capsys.readouterr().err
    assert made(tmp_path, arm(turn=turn))[0] == DONE
    said = capsys.readouterr().err
    assert "to the axis of the last joint, j6" in said
    advice = re.search(r"--tool-turned (\S+ \S+ \S+)", said)
    assert advice is not None
    angles = advice[1].split()
    code, out = made(tmp_path, arm(turn=turn), "--tool-turned", *angles)
    assert code == DONE
    assert "axis of the last joint" not in capsys.readouterr().err
    mechanism = read_robot(out).robot.mechanism
    flange = Rotation.from_euler("xyz", [float(word) for word in turn.split()])
    tool = flange * Rotation.from_euler("xyz", [float(word) for word in angles], degrees=True)
    np.testing.assert_allclose(tool.apply([0, 0, 1]), [0, 0, 1], atol=1e-6)
    q = np.array([0.1, 0.4, -0.3, 0.5, 0.7, 0.0])
    turned = [mechanism.tool_transform(q + [0, 0, 0, 0, 0, angle])[:3, 2] for angle in (0.0, 1.0)]
    np.testing.assert_allclose(turned[0], turned[1], atol=1e-6)  # the spindle's axis is that of joint 6


def test_masses_far_above_those_of_robots_of_this_size_and_payload_are_doubted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # reach 1.4 m and 10 kg: data sheets have 100 to 250 kg
    for factor, doubted in ((1.0, False), (3.0, False), (10.0, True)):
        masses = tuple(factor * mass for mass in (20.0, 18.0, 15.0, 5.0, 3.0, 2.0))
        assert made(tmp_path, arm(masses), "--rated-payload", "10")[0] == DONE
        said = capsys.readouterr().err
        assert ("and 10 kg of payload about" in said) == doubted


DATA_SHEETS = """
    52 6 0.9   235 16 1.611   1049 120 2.496   1068 210 2.696   2385 500 2.826   4690 1000 3.202   25 3 0.58
    54 5 0.9   380 16 1.55    425 60 2.05      1310 180 2.55    2400 500 2.55    25 7 0.717        130 10 1.42
    250 20 1.811   1090 165 2.655   2800 700 2.832   8600 1200 3.734   111 6 1.0   980 100 2.194   248 20 1.71
    1092 90 3.095   665 60 2.033   665 30 2.033   127 5 1.412   98 6 0.81   250 6 1.45   560 50 2.05   250 25 1.73
"""  # kg of mass, kg of payload, m of reach: KR 6 R900 ... GP25


def test_the_typical_mass_is_the_regression_of_the_data_sheets() -> None:
    mass, payload, reach = np.log(np.array(DATA_SHEETS.split(), dtype=float).reshape(-1, 3)).T
    for columns, law, (scatter, freedom) in (
        ((reach,), TYPICAL.mass_over_reach, TYPICAL.mass_over_reach_residual),
        ((reach, payload), TYPICAL.mass_over_payload, TYPICAL.mass_over_payload_residual),
    ):
        matrix = np.column_stack([np.ones_like(mass), *columns])
        solution, squares, *_ = np.linalg.lstsq(matrix, mass, rcond=None)
        np.testing.assert_allclose(law, solution, atol=6e-4)
        assert freedom == len(mass) - matrix.shape[1]
        assert scatter == pytest.approx(float(np.sqrt(squares[0] / freedom)), abs=6e-4)


@pytest.mark.parametrize(("name", "payload"), [("abb_irb1200_5_90", 5.0), ("staubli_rx160", 34.0)])
def test_supplied_robots_have_the_stiffness_of_new_ones(
    monkeypatch: pytest.MonkeyPatch, name: str, payload: float
) -> None:
    chains = []
    build = serial_file.spatial_robot
    monkeypatch.setattr(
        serial_file, "spatial_robot", lambda chain, **more: chains.append(chain) or build(chain, **more)
    )
    read_robot(name)
    stored = [joint.stiffness[np.isfinite(joint.stiffness)].item() for joint in chains[0].joints]
    np.testing.assert_allclose(stored, [middle for middle, _ in typical_stiffness(chains[0], payload)], rtol=1e-5)
