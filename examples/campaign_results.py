"""The report of a campaign: twelve poses of the KUKA in four sessions, one of which drifts, and how to read it.

Run it: `python examples/campaign_results.py [FOLDER]`. The sets are made, not measured: modal models of the robot that
ships, with the scatter of a new set-up and with error bars as a fit states them. In pose P07 the second joint softens
from session to session, in all poses damping grows with temperature, and one set was recorded with the table unclamped.
Table, maps and report are written into the folder, and the verdict is printed.
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from millfrf.campaign.results.sets import MeasuredSet
from millfrf.campaign.results.summary import write_summary
from millfrf.cutting import MillingProcess
from millfrf.robot_model import (
    SpatialRobot,
    learn_postures,
    measured_modes,
    modal_model_at,
    read_spatial_robot,
    with_joint_factor,
    write_learned_postures,
)
from millfrf.stability import write_lobes, zero_order
from modal_fit import ModalModel, ModeErrors, write_modal_model

Real = NDArray[np.float64]

ROBOT = "kuka_kr90_r3100"
SLOT = MillingProcess(2, 0.02, np.pi / 2, 700e6, 0.3, 0.1, 0.0, np.pi, 1e-4)
SPEEDS = np.linspace(2000, 9000, 15) * np.pi / 30

LOW = np.array([-30.0, -25.0, 60.0, -40.0, 50.0, -30.0])
HIGH = np.array([30.0, 35.0, 115.0, 40.0, 100.0, 30.0])
"""Range of the poses, degrees."""

POSES, SESSIONS = 12, 4
SCATTER = np.array([0.001, 0.03])
"""Relative scatter of frequency and damping between two set-ups of one pose."""

ERROR_BARS = np.array([0.0004, 0.012])
"""What the fits state: less, as fits do."""

DRIFT, UNCLAMPED = "P07", ("P03", 3)


def measured_model(robot: SpatialRobot, q: Real, softer: float, warmer: float, rng: np.random.Generator) -> ModalModel:
    """What a fit gives in a pose: modes up to 45 Hz with scatter and stated errors.

    Parameters
    ----------
    robot
        Robot as it ships.
    q : (6,), rad
        Joint values of the pose.
    softer
        Share by which the second joint is softer.
    warmer : K
        Temperature above that of the first session; damping grows by 3 % a kelvin.
    rng
        Generator of the scatter.
    """
    model = modal_model_at(with_joint_factor(robot, "2", 1 - softer), q, highest_frequency=45.0)
    count = len(model.poles)
    scattered = np.exp(SCATTER * rng.normal(size=(count, 2)))
    natural = 2 * np.pi * model.natural_frequencies * scattered[:, 0]
    damping = model.damping_ratios * scattered[:, 1] * (1 + 0.03 * warmer)
    stated = ERROR_BARS * np.stack([natural / (2 * np.pi), damping], axis=1)
    nothing = np.zeros((count, 2))
    return replace(
        model,
        poles=-damping * natural + 1j * natural * np.sqrt(1 - damping**2),
        band=(5.0, 60.0),
        errors=ModeErrors(stated, np.full((count, 2), np.nan), nothing, nothing),
    )


def measured_sets(folder: Path, robot: SpatialRobot) -> tuple[list[MeasuredSet], list[ModalModel]]:
    """Write models and lobes of all poses and sessions, and give the sets with their models."""
    rng = np.random.default_rng(4)
    poses = np.radians(LOW + (HIGH - LOW) * rng.random((POSES, 6)))
    sets, models = [], []
    for p, q in enumerate(poses):
        for session in range(1, SESSIONS + 1):
            pose, warmer = f"P{p + 1:02d}", 1.5 * (session % 3) + rng.normal(0, 0.3)
            softer = 0.012 * (session - 1) if pose == DRIFT else 0.06 if (pose, session) == UNCLAMPED else 0.0
            model = measured_model(robot, q, softer, warmer, rng)
            files = folder / f"{pose}_{session}.json", folder / f"{pose}_{session}.csv"
            write_modal_model(files[0], model)
            write_lobes(files[1], zero_order(model, SLOT, SPEEDS, 0.02))
            labels: dict[str, str | float] = {"pose": pose, "session": float(session), "temperature_c": 20 + warmer}
            time = 1.79e9 + 7 * 86400.0 * session + 1800.0 * p
            names = tuple(f"{pose}_{session}_{number}.h5" for number in (1, 2))
            name = f"{pose} session={session}"
            sets.append(MeasuredSet(name, labels, tuple(q), time, names, files[0], files[1], None, ()))
            models.append(model)
    return sets, models


def main(folder: Path) -> None:
    """Make the sets, write the summary, print the verdict."""
    robot = read_spatial_robot(ROBOT).robot
    files = folder / "sets"
    files.mkdir(parents=True, exist_ok=True)
    sets, models = measured_sets(files, robot)
    learned = files / "postures.json"
    measured = [
        measured_modes(each.name, np.array(each.posture), model) for each, model in zip(sets, models, strict=True)
    ]
    write_learned_postures(learned, learn_postures(robot, measured[::SESSIONS]))
    lost = ["P13_1_1.h5: the file is cut off after 12 s; recover it with 'millfrf recover'"]
    for sentence in write_summary(folder, "KUKA KR 90, made", sets, robot=ROBOT, learned=learned, failures=lost):
        print(sentence)
    print(f"wrote {folder / 'report.html'}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp()))
