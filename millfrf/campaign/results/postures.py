"""The posture model of a campaign: its coverage at held-out poses."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from millfrf.core.terminal import Table
from millfrf.figures import COLOURS, house_style, new_figure, panel_letter, save_figure
from millfrf.reports.section import Section, picture_of
from millfrf.robot_model import (
    LearnedPostures,
    LeftOutPosture,
    left_out_postures,
    read_learned_postures,
    read_spatial_robot,
    typed_values,
)

FALSE_ALARMS = 0.01
"""Expected share of false ones among the poses that are named. Bands are not exact, so it is below that of drifts."""


@dataclass(frozen=True)
class Contradiction:
    """A pose whose frequency lies outside of what the other poses lead one to expect.

    Parameters
    ----------
    pose
        Name of the pose.
    frequency : Hz
        Measured natural frequency of the mode that is farthest off.
    low, high : Hz
        Ends of the 95 % band that the other poses give.
    """

    pose: str
    frequency: float
    low: float
    high: float


@dataclass(frozen=True)
class PostureCoverage:
    """The posture model at poses that were left out in turn.

    Parameters
    ----------
    left_out
        Each measurement beside what the other poses say of its pose; empty below three poses.
    poses
        Name of the pose of each of them.
    contradictions
        Poses that the others contradict.
    middle
        Driven joint values in the middle of the measured poses, as typed (degrees; prismatic joints: m).
    """

    left_out: tuple[LeftOutPosture, ...]
    poses: tuple[str, ...]
    contradictions: tuple[Contradiction, ...]
    middle: tuple[float, ...]

    @property
    def held(self) -> tuple[int, int, int]:
        """Number of modes whose frequency, and whose damping, lies in its band, and number of modes."""
        if not self.left_out:
            return 0, 0, 0
        every = np.vstack([one.held for one in self.left_out])
        return int(every[:, 0].sum()), int(every[:, 1].sum()), len(every)


def coverage_of(robot: str, learned: Path, pose_of: Mapping[str, str]) -> PostureCoverage:
    """Leave each pose out of the posture model in turn.

    Parameters
    ----------
    robot
        Name of a robot that ships, or its file.
    learned
        File of learned postures.
    pose_of
        Name of the pose of each measurement; one that is missing is its own.

    Raises
    ------
    InputError
        A robot or a file that cannot be used.
    """
    case = read_spatial_robot(robot)
    model: LearnedPostures = read_learned_postures(learned, case.robot)
    left_out = left_out_postures(model)
    poses = tuple(pose_of.get(one.name, one.name) for one in left_out)
    middle = typed_values(case.robot.mechanism, np.mean([one.driven for one in model.measured], axis=0))
    return PostureCoverage(left_out, poses, _contradictions(left_out, poses), tuple(float(x) for x in middle))


def _contradictions(left_out: Sequence[LeftOutPosture], poses: Sequence[str]) -> tuple[Contradiction, ...]:
    """Poses whose farthest frequency is more than chance: the largest of several normal deviations."""
    worst: dict[str, tuple[float, Contradiction]] = {}
    for pose in dict.fromkeys(poses):
        own = [one for one, name in zip(left_out, poses, strict=True) if name == pose and len(one.errors)]
        found = [_farthest(pose, one) for one in own]
        if found:
            worst[pose] = sorted(found, key=lambda one: one[0])[len(found) // 2]
    if not worst:
        return ()
    adjusted = scipy.stats.false_discovery_control([p_value for p_value, _ in worst.values()])
    return tuple(one for (_, one), value in zip(worst.values(), adjusted, strict=True) if value <= FALSE_ALARMS)


def _farthest(pose: str, one: LeftOutPosture) -> tuple[float, Contradiction]:
    half = np.log(one.high[:, 0] / one.low[:, 0]) / 2
    away = np.abs(one.errors[:, 0]) / (half / scipy.stats.norm.isf(0.025))
    k = int(np.argmax(away))
    p_value = min(1.0, 2 * len(away) * float(scipy.stats.norm.sf(away[k])))
    band = float(one.low[k, 0]), float(one.high[k, 0])
    return p_value, Contradiction(pose, float(one.measured[k, 0]), *band)


NAMES = 24
"""Names of poses that are written under the axis at most."""


def draw_coverage(coverage: PostureCoverage) -> Figure:
    """Draw bands as grey bars about their middle, and measured values as marks, filled where the band holds them.

    Parameters
    ----------
    coverage
        Poses that were left out in turn.
    """
    with house_style():
        figure = new_figure(112.0)
        axes = figure.subplots(2, 1, sharex=True)
        for k, quantity in enumerate(("natural frequency", "damping ratio")):
            _panel(axes[k], coverage, k)
            panel_letter(axes[k], k)
            axes[k].set_ylabel(f"{quantity}:\nfrom the middle of the band (%)")
        poses = list(dict.fromkeys(coverage.poses))
        shown = list(range(0, len(poses), max(1, -(-len(poses) // NAMES))))
        axes[1].set_xticks(shown, [poses[k] for k in shown], rotation=60 if len(poses) > 10 else 0)
        axes[1].set_xlabel("pose that was left out (modes from left to right, by frequency)")
        axes[1].set_xlim(-0.6, len(poses) - 0.4)
    return figure


def _panel(axes: Axes, coverage: PostureCoverage, quantity: int) -> None:
    poses = list(dict.fromkeys(coverage.poses))
    for one, pose in zip(coverage.left_out, coverage.poses, strict=True):
        count = len(one.measured)
        order = np.argsort(one.measured[:, 0], kind="stable")
        at = poses.index(pose) + 0.7 * ((np.arange(count) + 0.5) / max(count, 1) - 0.5)
        low, high = one.low[order, quantity], one.high[order, quantity]
        middle = np.sqrt(low * high)
        axes.vlines(at, 100 * (low / middle - 1), 100 * (high / middle - 1), color="0.78", linewidth=3.2, zorder=1)
        value, held = 100 * (one.measured[order, quantity] / middle - 1), one.held[order, quantity]
        axes.plot(at[held], value[held], "o", color="black", markersize=2.6, zorder=2)
        axes.plot(at[~held], value[~held], "X", color=COLOURS[2], markersize=5.0, zorder=3)
    axes.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
    axes.grid(False, axis="x")


FILE = "postures.json"
"""Name under which the learned postures stand beside the report."""


def posture_section(folder: Path, coverage: PostureCoverage, robot: str) -> Section:
    """Say whether the bands hold, which pose contradicts, and how to ask for another pose.

    Parameters
    ----------
    folder
        Folder of the report, where the picture is also written as ``left_out_poses.png``.
    coverage
        Poses that were left out in turn.
    robot
        Name of the robot, or of its file.
    """
    sentences = [
        *_held(coverage),
        *(contradiction_words(one) for one in coverage.contradictions),
        _command(coverage, robot),
    ]
    if not coverage.left_out:
        return Section("Posture model", tuple(sentences))
    figure = draw_coverage(coverage)
    save_figure(figure, folder / "left_out_poses.png")
    caption = (
        "Each pose left out in turn: grey bars are the 95 % bands that the other poses give, dots measured values "
        "inside them, crosses measured values outside. Also left_out_poses.png."
    )
    picture = picture_of(figure, caption, "Bands of poses that were left out, and what was measured there")
    return Section("Posture model", tuple(sentences), (_table(coverage),), (picture,))


def contradiction_words(one: Contradiction) -> str:
    """Say which pose the others contradict, and what to check.

    Parameters
    ----------
    one
        Pose with the frequency that is farthest off.
    """
    return (
        f"pose {one.pose}: its mode at {one.frequency:.2f} Hz lies outside of what the other poses lead one to expect "
        f"({one.low:.2f} to {one.high:.2f} Hz); is its posture the one that is stated?"
    )


def _held(coverage: PostureCoverage) -> list[str]:
    frequency, damping, count = coverage.held
    if not count:
        return ["The posture model was learned from fewer than three poses: nothing says whether its bands hold."]
    worst = np.sqrt(np.mean(np.vstack([one.errors for one in coverage.left_out]) ** 2, axis=0))
    told = (
        f"Each pose left out in turn: the 95 % bands that the others give hold {frequency} of {count} frequencies "
        f"({100 * frequency / count:.0f} %) and {damping} of {count} damping ratios ({100 * damping / count:.0f} %); "
        f"typical errors are {100 * worst[0]:.2g} % and {100 * worst[1]:.2g} %."
    )
    wrong = [name for name, part in (("frequency", frequency), ("damping", damping)) if part < 0.85 * count]
    if wrong:
        told += f" That is too few for the {' and the '.join(wrong)}: do not trust these bands at other poses."
    return [told]


def _command(coverage: PostureCoverage, robot: str) -> str:
    joints = ",".join(f"{value:.4g}" for value in coverage.middle)
    return (
        "Lobes with their band at a pose that was not measured (here the middle of the measured ones; --at X Y Z asks "
        "for the place of a vertical tool), in the folder of this report: "
        f"millfrf robot lobes {robot} --learned {FILE} --joints {joints} --cutting CUT.toml "
        "--speeds LO HI N --max-depth M --out lobes.csv"
    )


def _table(coverage: PostureCoverage) -> Table:
    rows = []
    for pose in dict.fromkeys(coverage.poses):
        own = [one for one, name in zip(coverage.left_out, coverage.poses, strict=True) if name == pose]
        held = np.vstack([one.held for one in own])
        errors = np.sqrt(np.mean(np.vstack([one.errors for one in own]) ** 2, axis=0)) if len(held) else (0.0, 0.0)
        cells = (f"{held[:, k].sum()} of {len(held)}" for k in range(2))
        rows.append((pose, *cells, *(f"{100 * error:.2g}" for error in errors)))
    columns = ("pose", "frequencies in band", "damping in band", "frequency off by (%)", "damping off by (%)")
    return Table("Poses that were left out in turn, all sets of each", columns, tuple(rows))
