"""Forming a frustum and a twisted pyramid with a soft robot, paths corrected off line (Belchior et al. 2013).

Run it: `python examples/robot_path_compensation.py [PICTURE.png]`. The correction comes from a robot whose joint
stiffnesses are off by 10 % each and from forces predicted 10 % too large, as in the paper; the deviation is that of the
true robot under the true forces. On the real robot the mean deviation fell from 1.8 to 0.25 mm (frustum) and from 3 to
0.6 mm (pyramid). Paths follow the paper's figures; the forces are assumed, since it prints them as curves only: up to
600 N down for the frustum (section 2), and as much more for the pyramid as its larger deviation asks for.
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from millfrf.figures import COLOURS, house_style, new_figure, panel_letter, save_figure
from millfrf.robot_model import (
    SpatialRobot,
    ToolPath,
    close_loops,
    compensate_path,
    inverse_kinematics,
    named_posture,
    read_spatial_robot,
    rotation_vector,
    structure_at,
    tip_compliance,
)

CASE = read_spatial_robot("fanuc_s420if")
PAPER = {"frustum": (1.8, 4.0, 0.25, 1.0), "twisted pyramid": (3.0, 6.0, 0.6, 1.0)}
"""Mean and largest deviation, mm, without and with correction."""


@dataclass(frozen=True)
class Outcome:
    """Nominal path, and the places to which the true robot is pushed without and with correction, m, (n, 3)."""

    nominal: ToolPath
    places: np.ndarray
    corrected_places: np.ndarray

    @property
    def without(self) -> np.ndarray:
        """Length of the deviation at each point without correction, m."""
        return np.asarray(np.linalg.norm(self.places - self.nominal.positions, axis=1))

    @property
    def corrected(self) -> np.ndarray:
        """The same with correction, m."""
        return np.asarray(np.linalg.norm(self.corrected_places - self.nominal.positions, axis=1))


def frustum(points: int) -> ToolPath:
    """Loops of a cone of 45 degrees, 40 mm deep, 160 mm wide at the top; up to 600 N down and 300 N across."""
    share = np.linspace(0.0, 1.0, points)
    turn, radius = 2 * np.pi * 8 * share, 0.08 - 0.04 * share
    outwards = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(points)])
    places = radius[:, None] * outwards - [0.0, 0.0, 0.04] * share[:, None]
    size = np.sqrt(0.1 + 0.9 * share)[:, None]
    return _on_the_robot(places, size * (-300.0 * outwards + [0.0, 0.0, 600.0]))


def twisted_pyramid(points: int, levels: int = 50) -> ToolPath:
    """Constant levels 1 mm apart (section 5.2): a square of 150 mm that shrinks to 60 mm and turns by 45 degrees.

    The tool presses on the face that it runs along: up to 1000 N down and 500 N across, normal to the face.
    """
    share = np.linspace(0.0, 1.0, points)
    level = np.floor(np.minimum(share * levels, levels - 1e-9))
    around = 4 * (share * levels - level)  # 0 to 4: along which side of the square, and how far
    side = np.minimum(np.floor(around), 3)
    depth = level / (levels - 1)
    half, twist = 0.075 - 0.045 * depth, np.pi / 4 * depth
    angle = twist + np.pi / 2 * side
    normal = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(points)])
    along = np.column_stack([-np.sin(angle), np.cos(angle), np.zeros(points)])
    places = half[:, None] * (normal + (2 * (around - side) - 1)[:, None] * along)
    places[:, 2] = -0.001 * (level + 1)
    size = np.sqrt(0.1 + 0.9 * share)[:, None]
    return _on_the_robot(places, size * (-500.0 * normal + [0.0, 0.0, 1000.0]))


PATHS = {"frustum": frustum, "twisted pyramid": twisted_pyramid}


def _on_the_robot(places: np.ndarray, forces: np.ndarray) -> ToolPath:
    """A path about the tool's place in the file's posture, the tool held as there."""
    mechanism = CASE.robot.mechanism
    tool = mechanism.transforms(close_loops(mechanism, named_posture(CASE, None)))[mechanism.index("E")]
    attitudes = np.tile(rotation_vector(tool[:3, :3]), (len(places), 1))
    return ToolPath(tool[:3, 3] + places, attitudes, np.hstack([forces, np.zeros((len(places), 3))]))


def imperfect(robot: SpatialRobot, seed: int = 4) -> SpatialRobot:
    """The robot as a model knows it: every joint's stiffness off by 10 % (one standard deviation)."""
    stiffness = np.array([joint.stiffness for joint in robot.joints])
    return robot.with_stiffness(stiffness * np.exp(0.1 * np.random.default_rng(seed).normal(size=(len(stiffness), 1))))


def true_places(sent: ToolPath, q: np.ndarray, nominal: ToolPath) -> np.ndarray:
    """Where the true robot is pushed under the true forces, m, (n, 3)."""
    pushed = [
        tip_compliance(structure_at(CASE.robot, posture)) @ w for posture, w in zip(q, nominal.wrenches, strict=True)
    ]
    return np.asarray(sent.positions + np.array(pushed)[:, :3])


def run(points: int = 80, shape: str = "frustum") -> Outcome:
    """Form the part twice."""
    nominal = PATHS[shape](points)
    start = named_posture(CASE, None)
    predicted = replace(nominal, wrenches=1.1 * nominal.wrenches)
    result = compensate_path(imperfect(CASE.robot), predicted, start)
    uncorrected = []
    for position, attitude in zip(nominal.positions, nominal.attitudes, strict=True):
        target = np.eye(4)
        target[:3, :3] = Rotation.from_rotvec(attitude).as_matrix()
        target[:3, 3] = position
        uncorrected.append(inverse_kinematics(CASE.robot.mechanism, target, start))
    without = true_places(nominal, np.array(uncorrected), nominal)
    return Outcome(nominal, without, true_places(result.path, result.q, nominal))


def draw(outcomes: dict[str, Outcome], picture: Path) -> None:
    """Paths from above, and the deviation along them with and without correction (Figs. 11d and 15)."""
    with house_style():
        figure = new_figure(110.0)
        panels = figure.subplots(2, 2, width_ratios=(1, 1.9))
        for row, (shape, outcome) in enumerate(outcomes.items()):
            plan, error = panels[row]
            places = 1e3 * (outcome.nominal.positions - outcome.nominal.positions.mean(axis=0))
            plan.plot(places[:, 0], places[:, 1], color=COLOURS[0], linewidth=0.5)
            plan.set_aspect("equal")
            plan.set_xlabel("x (mm)")
            plan.set_ylabel(f"{shape}\ny (mm)")
            share = np.linspace(0, 100, len(outcome.without))
            error.plot(share, 1e3 * outcome.without, color=COLOURS[2], linestyle="--", label="without correction")
            error.plot(share, 1e3 * outcome.corrected, color=COLOURS[0], label="corrected off line")
            for value, style in ((PAPER[shape][0], "--"), (PAPER[shape][2], "-")):
                error.axhline(value, color="0.5", linewidth=0.7, linestyle=style)
            error.set_ylabel("Deviation (mm)")
            error.set_ylim(0)
            for column, axes in enumerate((plan, error)):
                panel_letter(axes, 2 * row + column)
        panels[1, 1].set_xlabel("Share of the path (%); thin lines: the paper's means")
        handles, labels = panels[0, 1].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=2)
        save_figure(figure, picture)


def main(picture: Path | None = None, points: int = 400) -> dict[str, Outcome]:
    """Print both deviations of both parts; draw them where asked."""
    outcomes = {shape: run(points, shape) for shape in PATHS}
    for shape, outcome in outcomes.items():
        paper = PAPER[shape]
        for name, length, at in (("without correction", outcome.without, 0), ("corrected", outcome.corrected, 2)):
            print(
                f"{shape:15s} {name:18s} mean {1e3 * length.mean():.2f} mm, largest {1e3 * length.max():.2f} mm "
                f"(paper, real robot: {paper[at]:g} and {paper[at + 1]:g} mm)"
            )
    if picture is not None:
        draw(outcomes, picture)
    return outcomes


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
