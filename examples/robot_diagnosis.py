"""A robot with something concealed mills in several postures; its model and the recordings then say what it was.

Run it: `python examples/robot_diagnosis.py FOLDER [CHANGE] [POSTURES]`. CHANGE is one of `nothing`, `joint-3`
(stiffness times 0.7), `payload` (12 kg more on the spindle), `posture` (joint 3 stands 3 degrees off), `links` (the
model in question has rigid links); POSTURES 1 to 3. The simulated cell mills porous plastic with a sweeping spindle;
an accelerometer sits on the housing. The same command reads recordings of a real robot:

    millfrf robot diagnose ROBOT.toml A.h5 B.h5 --pose DEG,DEG,... --pose DEG,DEG,... --sensor-at X Y Z --out DIR
"""

import sys
from dataclasses import dataclass, field
from math import pi
from pathlib import Path

import numpy as np

from acquisition import record
from millfrf.command_line import run
from millfrf.cutting import MillingProcess
from millfrf.robot_model import SpatialRobot, cell_structure_at, read_spatial_robot, with_joint_factor, with_payload
from replay_data import LinearSweep, MillingCell

ROBOT = "kuka_kr90_r3100"
POSTURES = ("0,-10,100,0,90,0", "20,25,70,40,60,0", "-15,45,30,80,-50,0")
SENSOR = (0.06, -0.04, 0.25)
SLOT = MillingProcess(2, 12.7e-3, pi / 2, 119e6, 0.17, 0.33, 0.0, pi, 0.15e-3)
"""Slotting acetal, the coefficients of Mohammadi & Ahmadi."""


@dataclass(frozen=True)
class Truth:
    """The robot that mills, by how much its joints stand elsewhere (deg), and options of the diagnosis."""

    robot: SpatialRobot
    offset: np.ndarray = field(default_factory=lambda: np.zeros(6))
    options: tuple[str, ...] = ()


def truth_of(change: str) -> Truth:
    """The robot with the change made."""
    robot = read_spatial_robot(ROBOT).robot
    return {
        "nothing": Truth(robot),
        "joint-3": Truth(with_joint_factor(robot, "3", 0.7)),
        "payload": Truth(with_payload(robot, 12.0)),
        "posture": Truth(robot, np.array([0.0, 0.0, 3.0, 0.0, 0.0, 0.0])),
        "links": Truth(robot, options=("--rigid-links",)),
    }[change]


def mill(truth: Truth, posture: str, path: Path, duration: float, seed: int) -> None:
    """Record a sweep of the spindle in one posture."""
    q = np.radians([float(angle) for angle in posture.split(",")] + truth.offset)
    structure = cell_structure_at(truth.robot, q, np.array(SENSOR), highest_frequency=400.0)
    sweep = LinearSweep(300 * pi / 30, 900 * pi / 30, duration)
    cell = MillingCell(
        structure, SLOT, 0.5e-3, sweep, duration, sample_rate=2048.0, material="porous", seed=seed, oversampling=5
    )
    record(cell, path)


def main(folder: Path, change: str = "joint-3", postures: int = 3, duration: float = 40.0) -> int:
    """Mill, diagnose; the exit code of the command."""
    truth = truth_of(change)
    files, poses = [], []
    for number, posture in enumerate(POSTURES[:postures]):
        path = folder / f"posture_{number + 1}.h5"
        mill(truth, posture, path, duration, number)
        files.append(str(path))
        poses += ["--pose", posture]
    place = [str(value) for value in SENSOR]
    options = ["--sensor-at", *place, "--band", "5", "45", *truth.options]
    out = ["--out", str(folder / "diagnosis"), "--force"]
    return run(["robot", "diagnose", ROBOT, *files, *poses, *options, *out])


if __name__ == "__main__":
    target = Path(sys.argv[1])
    target.mkdir(parents=True, exist_ok=True)
    arguments = sys.argv[2:]
    sys.exit(main(target, *arguments[:1], *(int(count) for count in arguments[1:2])))
