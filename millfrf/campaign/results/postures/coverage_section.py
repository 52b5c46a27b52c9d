"""The section on the posture model, with the command that answers at a pose that was not measured."""

from pathlib import Path

import numpy as np

from millfrf.figures import save_figure

from ....report import Section, picture_of
from ....tables import Table
from .coverage import Contradiction, PostureCoverage
from .coverage_figure import draw_coverage

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
