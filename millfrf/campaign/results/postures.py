"""Coverage of the posture model at held-out poses."""

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

from .settings import SETTINGS


@dataclass(frozen=True)
class Contradiction:
    """A pose with a frequency outside the band that the other poses predict."""

    pose: str
    frequency: float  # Hz; measured, of the mode with the largest deviation
    low: float  # Hz; lower end of the predicted 95 % band
    high: float  # Hz; upper end


@dataclass(frozen=True)
class PostureCoverage:
    """Predictions of the posture model for each pose from the other poses."""

    # measurements and predictions; empty below three poses
    left_out: tuple[LeftOutPosture, ...]
    poses: tuple[str, ...]  # pose of each
    contradictions: tuple[Contradiction, ...]
    middle: tuple[float, ...]  # mean driven joint values of the poses, deg (prismatic joints: m)

    @property
    def held(self) -> tuple[int, int, int]:
        """Return the number of frequencies and of damping ratios inside their bands, and the number of modes."""
        if not self.left_out:
            return 0, 0, 0
        inside = np.vstack([posture.held for posture in self.left_out])
        return int(inside[:, 0].sum()), int(inside[:, 1].sum()), len(inside)


def coverage_of(robot: str, learned: Path, pose_of: Mapping[str, str]) -> PostureCoverage:
    """Predict each pose from the other poses."""
    case = read_spatial_robot(robot)
    model: LearnedPostures = read_learned_postures(learned, case.robot)
    left_out = left_out_postures(model)
    poses = tuple(pose_of.get(posture.name, posture.name) for posture in left_out)
    middle = typed_values(case.robot.mechanism, np.mean([posture.driven for posture in model.measured], axis=0))
    return PostureCoverage(left_out, poses, _contradictions(left_out, poses), tuple(float(x) for x in middle))


def _contradictions(left_out: Sequence[LeftOutPosture], poses: Sequence[str]) -> tuple[Contradiction, ...]:
    """Return the poses with a frequency significantly outside its prediction, corrected for the number of tests."""
    worst: dict[str, tuple[float, Contradiction]] = {}
    for pose in dict.fromkeys(poses):
        tests = [item for item, name in zip(left_out, poses, strict=True) if name == pose and len(item.errors)]
        candidates = [_farthest(pose, item) for item in tests]
        if candidates:
            worst[pose] = sorted(candidates, key=lambda item: item[0])[len(candidates) // 2]
    if not worst:
        return ()
    adjusted = scipy.stats.false_discovery_control([p_value for p_value, _ in worst.values()])
    return tuple(
        item
        for (_, item), value in zip(worst.values(), adjusted, strict=True)
        if value <= SETTINGS.posture_false_discovery_rate
    )


def _farthest(pose: str, left_out: LeftOutPosture) -> tuple[float, Contradiction]:
    half = np.log(left_out.high[:, 0] / left_out.low[:, 0]) / 2
    deviations = np.abs(left_out.errors[:, 0]) / (half / scipy.stats.norm.isf(0.025))
    k = int(np.argmax(deviations))
    p_value = min(1.0, 2 * len(deviations) * float(scipy.stats.norm.sf(deviations[k])))
    band = float(left_out.low[k, 0]), float(left_out.high[k, 0])
    return p_value, Contradiction(pose, float(left_out.measured[k, 0]), *band)


NAMES = 24  # most names of poses on the axis


def draw_coverage(coverage: PostureCoverage) -> Figure:
    """Draw predicted bands as grey bars, values inside as dots and values outside as crosses."""
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
    for left_out, pose in zip(coverage.left_out, coverage.poses, strict=True):
        count = len(left_out.measured)
        order = np.argsort(left_out.measured[:, 0], kind="stable")
        at = poses.index(pose) + 0.7 * ((np.arange(count) + 0.5) / max(count, 1) - 0.5)
        low, high = left_out.low[order, quantity], left_out.high[order, quantity]
        middle = np.sqrt(low * high)
        axes.vlines(at, 100 * (low / middle - 1), 100 * (high / middle - 1), color="0.78", linewidth=3.2, zorder=1)
        value, inside = 100 * (left_out.measured[order, quantity] / middle - 1), left_out.held[order, quantity]
        axes.plot(at[inside], value[inside], "o", color="black", markersize=2.6, zorder=2)
        axes.plot(at[~inside], value[~inside], "X", color=COLOURS[2], markersize=5.0, zorder=3)
    axes.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
    axes.grid(False, axis="x")


FILE = "postures.json"  # file of the learned postures in the folder of the report


def posture_section(folder: Path, coverage: PostureCoverage, robot: str) -> Section:
    """Report the coverage, contradictory poses, and the command for other poses."""
    sentences = [
        *_held(coverage),
        *(contradiction_words(contradiction) for contradiction in coverage.contradictions),
        _command(coverage, robot),
    ]
    if not coverage.left_out:
        return Section("Posture model", tuple(sentences))
    figure = draw_coverage(coverage)
    save_figure(figure, folder / "left_out_poses.png")
    caption = (
        "Prediction of each pose from the other poses: grey bars are 95 % bands, dots are measured values inside the "
        "band, crosses are values outside. Also left_out_poses.png."
    )
    picture = picture_of(figure, caption, "Bands of poses that were left out, and what was measured there")
    return Section("Posture model", tuple(sentences), (_table(coverage),), (picture,))


def contradiction_words(contradiction: Contradiction) -> str:
    """Describe a contradictory pose and what to check."""
    return (
        f"pose {contradiction.pose}: its mode at {contradiction.frequency:.2f} Hz lies outside the 95 % band of the "
        f"other poses ({contradiction.low:.2f} to {contradiction.high:.2f} Hz); check the stated posture"
    )


def _held(coverage: PostureCoverage) -> list[str]:
    frequency, damping, count = coverage.held
    if not count:
        return ["The posture model was learned from fewer than three poses: the coverage of its bands is unknown."]
    worst = np.sqrt(np.mean(np.vstack([posture.errors for posture in coverage.left_out]) ** 2, axis=0))
    sentence = (
        f"Each pose predicted from the others: the 95 % bands contain {frequency} of {count} frequencies "
        f"({100 * frequency / count:.0f} %) and {damping} of {count} damping ratios ({100 * damping / count:.0f} %); "
        f"typical errors are {100 * worst[0]:.2g} % and {100 * worst[1]:.2g} %."
    )
    unreliable = [name for name, number in (("frequency", frequency), ("damping", damping)) if number < 0.85 * count]
    if unreliable:
        sentence += f" That is too few for the {' and the '.join(unreliable)}: do not trust these bands at other poses."
    return [sentence]


def _command(coverage: PostureCoverage, robot: str) -> str:
    joints = ",".join(f"{value:.4g}" for value in coverage.middle)
    return (
        "Command for lobes with their band at another pose (here the mean of the measured ones; --at X Y Z gives the "
        "position of a vertical tool), in the folder of this report: "
        f"millfrf robot lobes {robot} --learned {FILE} --joints {joints} --cutting CUT.toml "
        "--speeds LO HI N --max-depth M --out lobes.csv"
    )


def _table(coverage: PostureCoverage) -> Table:
    rows = []
    for pose in dict.fromkeys(coverage.poses):
        tests = [left_out for left_out, name in zip(coverage.left_out, coverage.poses, strict=True) if name == pose]
        inside = np.vstack([left_out.held for left_out in tests])
        errors = (
            np.sqrt(np.mean(np.vstack([left_out.errors for left_out in tests]) ** 2, axis=0))
            if len(inside)
            else (0.0, 0.0)
        )
        cells = (f"{inside[:, k].sum()} of {len(inside)}" for k in range(2))
        rows.append((pose, *cells, *(f"{100 * error:.2g}" for error in errors)))
    columns = ("pose", "frequencies in band", "damping in band", "frequency off by (%)", "damping off by (%)")
    return Table("Poses that were left out in turn, all sets of each", columns, tuple(rows))
