"""Forming a frustum with a soft robot: the path corrected off line by an imperfect model (Belchior et al. 2013).

Run it: `python examples/robot_path_compensation.py`. The correction comes from a robot whose joint stiffnesses are off
by 10 % each and from forces predicted 10 % too large, as in the paper; the deviation is that of the true robot under
the true forces. On the real robot the mean deviation fell from 1.8 to 0.25 mm (frustum) and from 3 to 0.6 mm (pyramid).
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from robot_model import (
    SpatialRobot,
    ToolPath,
    close_loops,
    compensate_path,
    inverse_kinematics,
    named_posture,
    read_spatial_robot,
    structure_at,
    tip_compliance,
)
from robot_model.kinematics.mechanism import rotation_vector

CASE = read_spatial_robot("fanuc_s420if")


@dataclass(frozen=True)
class Outcome:
    """Lengths of the true deviation at each point, m, with and without correction."""

    without: np.ndarray
    corrected: np.ndarray


def frustum(points: int) -> ToolPath:
    """Loops of a cone of 45 degrees, 40 mm deep, 80 mm at the top; forces rise to 600 N down and 300 N outwards."""
    mechanism = CASE.robot.mechanism
    tool = mechanism.transforms(close_loops(mechanism, named_posture(CASE, None)))[mechanism.index("E")]
    share = np.linspace(0.0, 1.0, points)
    turn, radius = 2 * np.pi * 8 * share, 0.08 - 0.04 * share
    outwards = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(points)])
    positions = tool[:3, 3] + radius[:, None] * outwards - [0.0, 0.0, 0.04] * share[:, None]
    size = np.sqrt(0.1 + 0.9 * share)[:, None]
    forces = size * (-300.0 * outwards + [0.0, 0.0, 600.0])
    attitudes = np.tile(rotation_vector(tool[:3, :3]), (points, 1))
    return ToolPath(positions, attitudes, np.hstack([forces, np.zeros((points, 3))]))


def imperfect(robot: SpatialRobot, seed: int = 4) -> SpatialRobot:
    """The robot as a model knows it: every joint's stiffness off by 10 % (one standard deviation)."""
    stiffness = np.array([joint.stiffness for joint in robot.joints])
    return robot.with_stiffness(stiffness * np.exp(0.1 * np.random.default_rng(seed).normal(size=(len(stiffness), 1))))


def true_deviation(sent: ToolPath, q: np.ndarray, nominal: ToolPath) -> np.ndarray:
    """Length of the way from the nominal point to where the true robot is pushed, m."""
    pushed = [
        tip_compliance(structure_at(CASE.robot, posture)) @ w for posture, w in zip(q, nominal.wrenches, strict=True)
    ]
    return np.asarray(np.linalg.norm(sent.positions + np.array(pushed)[:, :3] - nominal.positions, axis=1))


def run(points: int = 80) -> Outcome:
    """Form the frustum twice."""
    nominal = frustum(points)
    start = named_posture(CASE, None)
    predicted = replace(nominal, wrenches=1.1 * nominal.wrenches)
    result = compensate_path(imperfect(CASE.robot), predicted, start)
    uncorrected = []
    for position, attitude in zip(nominal.positions, nominal.attitudes, strict=True):
        target = np.eye(4)
        target[:3, :3] = Rotation.from_rotvec(attitude).as_matrix()
        target[:3, 3] = position
        uncorrected.append(inverse_kinematics(CASE.robot.mechanism, target, start))
    return Outcome(
        true_deviation(nominal, np.array(uncorrected), nominal), true_deviation(result.path, result.q, nominal)
    )


def main() -> Outcome:
    """Print both deviations."""
    outcome = run()
    for name, length in (("without correction", outcome.without), ("corrected", outcome.corrected)):
        print(f"{name:20s} mean {1e3 * length.mean():.2f} mm, largest {1e3 * length.max():.2f} mm")
    print("paper, frustum       mean 1.8 and 0.25 mm; largest 4 and 1 mm")
    return outcome


if __name__ == "__main__":
    main()
