"""Weight and payload as loads: against potential energy by differences, and against beams in closed form."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.core import InputError, read_csv
from millfrf.robot_model import (
    Frame,
    Mechanism,
    Payload,
    SpatialRobot,
    ToolPath,
    compensate_path,
    counted_weight,
    deviation_map,
    in_posture,
    nearest_solution,
    read_planar_robot,
    read_spatial_robot,
    structure_at,
    tip_compliance,
    tool_down,
    with_payload,
)
from millfrf.robot_model.finite_elements.beam_element import Material, hollow_circle
from millfrf.robot_model.model_updating.changes import with_rigid_links
from millfrf.robot_model.spatial.spatial_robot import ElasticJoint, Link, LumpedBody
from millfrf.robot_model.spatial.weight import static_response, weight_deflection

KUKA = read_spatial_robot("kuka_kr90_r3100")
G = 9.80665
PAYLOAD = Payload(60.0, (0.05, -0.02, -0.2))


def height_of_masses(robot: SpatialRobot, q: np.ndarray) -> float:
    """``sum m z`` of all bodies, from the frames alone: the structure's mass matrix has no part in it."""
    mechanism = robot.mechanism
    placed = mechanism.transforms(q)
    frames = {frame.name: placed[i] for i, frame in enumerate(mechanism.frames)} | {"0": np.eye(4)}
    joints = {node: frames[joint.frame][:3, 3] for joint in robot.joints for node in joint.nodes}
    points = {node: frames[name][:3, :3] @ at + frames[name][:3, 3] for node, (name, at) in robot.points.items()}
    places = joints | points
    return float(
        sum(body.mass * (places[body.node] + frames[body.frame][:3, :3] @ body.centre)[2] for body in robot.bodies)
    )


def sag_by_energy(robot: SpatialRobot, q: np.ndarray) -> np.ndarray:
    """``J K^-1 tau`` with ``tau = -dV/dq`` and J by central differences, shape (3,)."""
    step, tool = 1e-5, robot.mechanism.index(robot.mechanism.tool)
    stiffness = {joint.frame: joint.stiffness[5] for joint in robot.joints}
    sag = np.zeros(3)
    for column, index in enumerate(robot.mechanism.moving):
        ahead, behind = q.copy(), q.copy()
        ahead[column] += step
        behind[column] -= step
        torque = -G * (height_of_masses(robot, ahead) - height_of_masses(robot, behind)) / (2 * step)
        places = [robot.mechanism.transforms(x)[tool, :3, 3] for x in (ahead, behind)]
        sag += (places[0] - places[1]) / (2 * step) * torque / stiffness[robot.mechanism.frames[index].name]
    return sag


@pytest.mark.parametrize("q", [(0, -10, 100, 0, 90, 0), (30, 20, 60, 40, -50, 80), (-70, 60, 20, -100, 60, 10)])
def test_joints_sag_by_the_gradient_of_the_potential_energy(q: tuple[float, ...]) -> None:
    posture = np.radians(q)
    robot = with_rigid_links(KUKA.robot)
    deflection = weight_deflection(robot, posture, static_response(robot, structure_at(robot, posture)), Payload())
    assert deflection[:3] == pytest.approx(sag_by_energy(robot, posture), rel=1e-5, abs=1e-9)
    loaded = with_payload(robot, PAYLOAD.mass, np.array(PAYLOAD.centre))
    carrying = weight_deflection(robot, posture, static_response(robot, structure_at(robot, posture)), PAYLOAD)
    assert carrying[:3] == pytest.approx(sag_by_energy(loaded, posture), rel=1e-5, abs=1e-9)
    assert np.linalg.norm(deflection[:3]) > 1e-4  # a tenth of a millimetre at least: no small matter


def cantilever(elements: int) -> SpatialRobot:
    """A tube along x, clamped at one end over a nearly rigid joint, 20 kg at its tip."""
    section = hollow_circle(0.1, 0.08, Material(70e9, 26e9, 2700.0))
    mechanism = Mechanism((Frame("1", "0"), Frame("tool", "1", motion="fixed", d=1.5)), "tool")
    joint = ElasticJoint("1", (0, 1), np.full(6, np.inf))
    body = LumpedBody(2, "tool", 20.0, np.zeros(3), np.zeros((3, 3)))
    return SpatialRobot(mechanism, (joint,), (Link((1, 2), section, elements),), (body,), {2: ("tool", np.zeros(3))}, 2)


@pytest.mark.parametrize("elements", [1, 3])
def test_a_tube_sags_as_beam_theory_says(elements: int) -> None:
    """``w L^4 / (8 E I) + w L^2 / (2 kappa G A)``, and ``P L^3 / (3 E I) + P L / (kappa G A)`` of the body."""
    robot, q = cantilever(elements), np.zeros(1)
    section, length = robot.links[0].section, 1.5
    assert section is not None
    own = section.mass * G
    expected = own * length**4 / (8 * section.bending_z) + own * length**2 / (2 * section.shear_z)
    load = 20.0 * G
    expected += load * length**3 / (3 * section.bending_z) + load * length / section.shear_z
    deflection = weight_deflection(robot, q, static_response(robot, structure_at(robot, q)), Payload())
    assert deflection[2] == pytest.approx(-expected, rel=1e-9)
    assert deflection[[0, 1]] == pytest.approx([0, 0], abs=1e-15)
    hung = replace(robot, up=(0.0, 0.0, -1.0))
    assert weight_deflection(hung, q, static_response(hung, structure_at(hung, q)), Payload())[2] == pytest.approx(
        expected, rel=1e-9
    )


def test_a_posture_tells_its_sag_and_what_it_does_not_know() -> None:
    result = in_posture(KUKA, KUKA.poses["ready"])
    assert result.own_weight is not None
    assert 0.3e-3 < np.linalg.norm(result.own_weight[:3]) < 1.4e-3
    fanuc = read_spatial_robot("fanuc_s420if")
    unknown = in_posture(fanuc, fanuc.poses["ready"])
    assert unknown.own_weight is None
    assert any("own weight is unknown" in line for line in unknown.warnings)


def test_a_planar_robot_sags_by_the_gradient_of_its_energy() -> None:
    case = read_planar_robot("chen_2026")
    angles = case.poses["P2"]
    robot, step = case.robot, 1e-6

    def energy(theta: np.ndarray) -> float:
        directions = np.cumsum(theta)
        ends = np.cumsum(robot.lengths * np.sin(directions))
        middles = ends - robot.lengths * np.sin(directions) / 2
        return float(G * robot.masses @ middles)

    unit = step * np.eye(3)
    torque = np.array([-(energy(angles + e) - energy(angles - e)) / (2 * step) for e in unit])
    jacobian = np.array([(robot.tip(angles + e) - robot.tip(angles - e)) / (2 * step) for e in unit]).T
    result = in_posture(case, angles).own_weight
    assert result is not None
    assert result[:2] == pytest.approx(jacobian @ (torque / robot.stiffness), rel=1e-6)


def path_of(places: list[tuple[float, float, float]], force: tuple[float, float, float]) -> ToolPath:
    attitude = np.array([[np.pi, 0.0, 0.0]] * len(places))
    return ToolPath(np.array(places), attitude, np.array([[*force, 0.0, 0.0, 0.0]] * len(places)))


def test_compensation_takes_weight_and_payload_along() -> None:
    path = path_of([(1.5, 0.0, 0.7), (1.9, 0.4, 0.9)], (100.0, 0.0, 200.0))
    start = KUKA.poses["ready"]
    force_alone = compensate_path(KUKA.robot, path, start, weight="none")
    whole = compensate_path(KUKA.robot, path, start, payload=PAYLOAD)
    change = compensate_path(KUKA.robot, path, start, payload=PAYLOAD, weight="change")
    for i in range(2):
        target = np.diag([1.0, -1.0, -1.0, 1.0])
        target[:3, 3] = path.positions[i]
        q = nearest_solution(KUKA.robot.mechanism, target, force_alone.q[i])
        assert q is not None
        by_force = tip_compliance(structure_at(KUKA.robot, q)) @ path.wrenches[i]
        assert force_alone.deviations[i] == pytest.approx(by_force, rel=1e-5, abs=1e-12)
        carried = with_payload(KUKA.robot, PAYLOAD.mass, np.array(PAYLOAD.centre))
        sag = static_response(carried, structure_at(carried, q)).own_weight
        assert sag is not None
        assert whole.deviations[i] - force_alone.deviations[i] == pytest.approx(sag, rel=1e-5, abs=1e-11)
        assert whole.weight[i] == pytest.approx(sag, rel=1e-5, abs=1e-11)
    assert np.linalg.norm(whole.deviations[0, :3]) > 5e-4
    assert change.deviations[0] == pytest.approx(force_alone.deviations[0], rel=1e-6, abs=1e-12)
    assert change.deviations[1] - force_alone.deviations[1] == pytest.approx(
        whole.weight[1] - whole.weight[0], abs=1e-9
    )
    assert np.abs(whole.left[:, :3]).max() < 1e-6
    with pytest.raises(InputError, match="all, change, none"):
        compensate_path(KUKA.robot, path, start, weight="some")


def test_drilled_holes_sink_with_the_robot() -> None:
    from millfrf.cutting import Drill, drilling_load, fitted_to_catalogue

    drill = Drill(8e-3)
    load = drilling_load(drill, 0.2e-3, *fitted_to_catalogue(drill))
    robot = with_rigid_links(KUKA.robot)
    places = [tool_down([1.5, 0.0, 0.7]), tool_down([9.0, 0.0, 0.7]), tool_down([2.0, 0.3, 0.7])]
    for links in (False, True):
        result = deviation_map(robot, places, load, links=links)
        for i in (0, 2):
            assert -result.weight[i] == pytest.approx(sag_by_energy(robot, result.q[i]), rel=2e-3, abs=1e-7)
        assert np.isnan(result.weight[1]).all()


def test_limits_on_a_path_are_said() -> None:
    """Inverse kinematics in steps does not keep to limits, so the rows that pass one are named."""
    path = path_of([(1.5, 0.0, 0.7)], (0.0, 0.0, 0.0))
    narrow = tuple(
        replace(frame, lower=-0.1, upper=0.1) if frame.name == "3" else frame for frame in KUKA.robot.mechanism.frames
    )
    robot = replace(KUKA.robot, mechanism=replace(KUKA.robot.mechanism, frames=narrow))
    result = compensate_path(robot, path, KUKA.poses["ready"])
    assert any("row 2 of the path: joint 3" in line and "outside" in line for line in result.warnings)
    assert not compensate_path(KUKA.robot, path, KUKA.poses["ready"]).warnings


def test_compensation_of_the_kuka_moves_against_its_weight(tmp_path: Path) -> None:
    """Without any force: half a millimetre near the base, 1.3 mm far out. Before: none, weight was no load.

    Its joints' part is that of the potential energy (above); beams give way as well.
    """
    places = [(1.2, 0.0, 0.8), (1.5, 0.0, 0.4), (2.3, 0.6, 0.8)]
    path, out = tmp_path / "p.csv", tmp_path / "o.csv"
    rows = "".join(f"{x},{y},{z},3.14159265,0,0,0,0,0\n" for x, y, z in places)
    path.write_text("x_m,y_m,z_m,rx_rad,ry_rad,rz_rad,fx_n,fy_n,fz_n\n" + rows)
    corrected = {}
    for weight in ("all", "none"):
        asked = ["robot", "compensate", "kuka_kr90_r3100", str(path), "--weight", weight]
        assert run([*asked, "--out", str(out), "--force"]) == DONE
        with out.open(newline="") as stream:
            table = list(csv.DictReader(stream))
        corrected[weight] = np.array([[float(row[name]) for name in ("x_m", "y_m", "z_m")] for row in table])
    assert corrected["none"] == pytest.approx(np.array(places), abs=1e-9)
    against = np.array(places) - corrected["all"]
    assert 0.3e-3 < np.linalg.norm(against, axis=1).min() < 0.6e-3
    assert 1.2e-3 < np.linalg.norm(against, axis=1).max() < 1.4e-3
    q = KUKA.poses["ready"]
    for place, moved in zip(places, against, strict=True):
        target = np.diag([1.0, -1.0, -1.0, 1.0])
        target[:3, 3] = place
        solution = nearest_solution(KUKA.robot.mechanism, target, q)
        assert solution is not None
        q = solution
        own = in_posture(KUKA, q).own_weight
        assert own is not None
        assert moved == pytest.approx(own[:3], rel=5e-3, abs=1e-7)  # of the place beside it
        joints = sag_by_energy(KUKA.robot, q)
        assert moved[2] < joints[2] < 0


def test_warnings_stand_in_what_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Before: of `stiffness`, `compensate`, `deviation` and posture maps they reached the terminal alone."""
    path, out, table = tmp_path / "p.csv", tmp_path / "o.csv", tmp_path / "s.json"
    path.write_text("x_m,y_m,z_m,rx_rad,ry_rad,rz_rad,fx_n,fy_n,fz_n\n1.4,0,0.7,3.14159,0,0,100,0,200\n")
    assert run(["robot", "stiffness", "fanuc_s420if", "--out", str(table)]) == DONE
    said = [line.removeprefix("warning: ") for line in capsys.readouterr().err.splitlines()]
    stored = json.loads(table.read_text())
    assert stored["warnings"] == said
    assert any("own weight is unknown" in line for line in said)
    assert stored["largest_deflection_m"] == pytest.approx(3.173e-3, abs=1e-6)
    assert np.array(stored["compliance"]).shape == (6, 6)
    assert run(["robot", "compensate", "fanuc_s420if", str(path), "--out", str(out)]) == DONE
    said = [line.removeprefix("warning: ") for line in capsys.readouterr().err.splitlines()]
    assert said
    assert list(read_csv(out).warnings) == said
    again = tmp_path / "again.csv"  # a written path is a path, and its rows keep their numbers
    assert run(["robot", "compensate", "fanuc_s420if", str(out), "--out", str(again), "--weight", "none"]) == DONE
    *before, last = out.read_text().splitlines()
    out.write_text("\n".join([*before, "one," + last.partition(",")[2]]))
    assert run(["robot", "compensate", "fanuc_s420if", str(out), "--out", str(again), "--force"]) == BAD_INPUT
    assert f"in line {len(before) + 1} is no number" in capsys.readouterr().err


def test_counted_weight() -> None:
    sags = np.array([[np.nan] * 6, [1.0] * 6, [3.0] * 6])
    assert counted_weight(sags, "change")[1:, 0].tolist() == [0.0, 2.0]
    assert counted_weight(sags, "all")[2, 0] == 3.0
    assert counted_weight(sags, "none")[1, 0] == 0.0


def test_commands_tell_the_weight(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["robot", "stiffness", "kuka_kr90_r3100"]) == DONE
    plain = capsys.readouterr().out
    assert "under the robot's own weight" in plain
    assert run(["robot", "stiffness", "kuka_kr90_r3100", "--payload", "60", "--payload-at", "0", "0", "-0.2"]) == DONE
    assert "under a payload of 60 kg" in capsys.readouterr().out
    assert run(["robot", "stiffness", "kuka_kr90_r3100", "--payload", "-5"]) == BAD_INPUT
    assert "payload -5" in capsys.readouterr().err
    path, out = tmp_path / "p.csv", tmp_path / "o.csv"
    written = ["--out", str(out), "--force"]
    path.write_text("x_m,y_m,z_m,rx_rad,ry_rad,rz_rad,fx_n,fy_n,fz_n\n1.5,0,0.7,3.14159,0,0,100,0,200\n")
    assert run(["robot", "compensate", "kuka_kr90_r3100", str(path), *written]) == DONE
    printed = capsys.readouterr().out
    assert "weight" in printed
    assert "weight_z_m" in read_csv(out).columns
    assert run(["robot", "compensate", "kuka_kr90_r3100", str(path), *written, "--weight", "half"]) == BAD_INPUT
    path.write_text(path.read_text().replace("1.5,0,0.7", "1.4,0,0.7"))
    assert run(["robot", "compensate", "fanuc_s420if", str(path), *written, "--weight", "none"]) == DONE
    assert "the robot unknown" in capsys.readouterr().out
    fanuc = ["robot", "stiffness", "fanuc_s420if"]
    assert run(fanuc) == DONE
    assert "own weight is unknown" in capsys.readouterr().err
