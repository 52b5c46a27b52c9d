"""Modal models measured in eight postures, and what they say of a posture between and beyond them.

Run it: `python examples/robot_learned_postures.py [PICTURE.png]`. The robot that is measured is the KUKA that ships,
but its second joint is up to 20 % softer near the vertical, and its third up to 10 % over its angle: no constant of the
model explains that. Its modal models in eight postures are learned; along a movement of the second joint the lowest
frequencies are predicted with their 95 % band, which grows beyond the measured range. The last lines say which posture
to measure next.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from millfrf.robot_model import (
    LearnedPostures,
    SpatialRobot,
    choose_postures,
    learn_postures,
    measured_modes,
    modal_model_at,
    predict_posture,
    read_spatial_robot,
    with_joint_factor,
)
from modal_fit import ModalModel

Real = NDArray[np.float64]

LOW = np.array([-30.0, -25.0, 60.0, -40.0, 50.0, -30.0])
HIGH = np.array([30.0, 35.0, 115.0, 40.0, 100.0, 30.0])
"""Range of the measured postures, degrees."""

MIDDLE = np.array([5.0, 0.0, 90.0, 10.0, 75.0, 0.0])


@dataclass(frozen=True)
class Movement:
    """The two lowest frequencies (Hz) while the second joint moves: true, modelled, predicted, ends of the band."""

    angles: Real
    true: Real
    modelled: Real
    predicted: Real
    band: Real
    far: NDArray[np.bool_]


def measured_robot(robot: SpatialRobot, q: Real) -> ModalModel:
    """The robot as it is in a posture, up to 48 Hz."""
    second = 1 - 0.2 * np.exp(-((q[1] / 0.4) ** 2))
    third = 1 - 0.1 * np.cos(2 * q[2]) ** 2
    changed = with_joint_factor(with_joint_factor(robot, "2", float(second)), "3", float(third))
    return modal_model_at(changed, q, highest_frequency=48.0)


def learned_postures(robot: SpatialRobot, count: int = 8) -> LearnedPostures:
    """What is learned from models in some postures of the range."""
    postures = np.radians(np.random.default_rng(7).uniform(LOW, HIGH, (count, 6)))
    return learn_postures(
        robot, [measured_modes(f"posture {i}", q, measured_robot(robot, q)) for i, q in enumerate(postures, 1)]
    )


def movement(robot: SpatialRobot, learned: LearnedPostures, steps: int = 25) -> Movement:
    """Predictions while the second joint moves from -60 to 70 degrees and the others stand still."""
    angles = np.linspace(-60.0, 70.0, steps)
    rows, band, far = [], [], []
    for angle in angles:
        degrees = MIDDLE.copy()
        degrees[1] = angle
        q = np.radians(degrees)
        result = predict_posture(learned, q, samples=120)
        rows.append(
            [
                model.natural_frequencies[:2]
                for model in (measured_robot(robot, q), modal_model_at(robot, q), result.model)
            ]
        )
        band.append(result.frequency_band()[:, :2])
        far.append(result.far)
    true, modelled, predicted = np.array(rows).transpose(1, 0, 2)
    return Movement(angles, true, modelled, predicted, np.array(band).transpose(1, 0, 2), np.array(far))


def draw(path: Path, found: Movement, learned: LearnedPostures) -> None:
    """Draw one panel a mode; ticks at the bottom are the measured postures."""
    figure = Figure(figsize=(8.0, 5.8), layout="constrained")
    for mode, axes in enumerate(figure.subplots(2, 1, sharex=True)):
        axes.fill_between(found.angles, *found.band[:, :, mode], color="0.82", label="95 % band")
        axes.plot(found.angles, found.predicted[:, mode], color="C0", label="predicted")
        axes.plot(found.angles, found.modelled[:, mode], color="0.4", linestyle=":", label="model alone")
        axes.plot(found.angles, found.true[:, mode], color="k", linestyle="--", label="true")
        ticks = np.degrees([each.driven[1] for each in learned.measured])
        axes.plot(ticks, np.full(len(ticks), axes.get_ylim()[0]), "k|", markersize=12, label="measured postures")
        axes.set_ylabel(f"mode {mode + 1} (Hz)")
        axes.grid(True, color="0.92")
    axes.set_xlabel("angle of the second joint (degrees)")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside upper center", frameon=False, ncols=5)
    figure.savefig(path, dpi=150)


def main(picture: Path | None = None) -> Movement:
    """Print the errors inside the measured range and beyond it, and the next posture."""
    robot = read_spatial_robot("kuka_kr90_r3100").robot
    learned = learned_postures(robot)
    result = movement(robot, learned)
    inside = (result.angles > LOW[1]) & (result.angles < HIGH[1])
    for name, where in (("inside the measured range", inside), ("beyond it", ~inside)):
        modelled, predicted = (
            100 * np.abs(each[where] / result.true[where] - 1).max() for each in (result.modelled, result.predicted)
        )
        width = 50 * np.mean((result.band[1] - result.band[0])[where] / result.predicted[where])
        held = np.mean((result.band[0] <= result.true)[where] & (result.true <= result.band[1])[where])
        print(f"{name}: model up to {modelled:.1f} % off, predicted {predicted:.1f} %; band +- {width:.2f} %, ", end="")
        print(f"holds {100 * held:.0f} %")
    far = ", ".join(f"{angle:.0f}" for angle in result.angles[result.far]) or "none"
    print(f"far from every measured posture: {far} degrees")
    rng = np.random.default_rng(1)
    offered, targets = (np.radians(rng.uniform(LOW - 15, HIGH + 15, (count, 6))) for count in (20, 10))
    [chosen] = choose_postures(learned, offered, targets, 1)
    print(f"measure next: {', '.join(f'{angle:.0f}' for angle in np.degrees(chosen.driven))} degrees; ", end="")
    print(f"error of the lowest peaks {100 * chosen.before:.1f} -> {100 * chosen.after:.1f} %")
    if picture is not None:
        draw(picture, result, learned)
    return result


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
