"""Simulated campaigns with hidden effects, without hardware."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from estimation import Frf, FrfCovariance, write_frf
from millfrf.core import HOUSING, TIP, InputError, process_pool, writing_whole_folder
from millfrf.core.compilation import CUTTING, SIMULATION
from millfrf.core.progress import progress
from millfrf.cutting import write_cutting_process
from millfrf.robot_model import named_posture, read_spatial_robot
from modal_fit import ModalModel, write_modal_model
from replay_data import select

from .recordings import CUTTER, Laboratory, drawn_drift, write_recording
from .true_robot import (
    LESS_LOSS_PER_KELVIN,
    REFERENCE_TEMPERATURE,
    SOFTER_PER_KELVIN,
    Condition,
    PlannedRecording,
    drawn_robot,
    drawn_schedule,
    pose_name,
    sessions_of,
    spread_postures,
)

LINES = np.arange(5.0, 150.0 + 0.125, 0.25)  # frequencies of the hammer FRFs, Hz: taps 4 s apart
HAMMER_NOISE = 0.01  # noise of an averaged hammer FRF over the RMS of its row
BAND = (8.0, 95.0)  # band of the models at rest, Hz
MODEL_ERRORS = (0.002, 0.04, 0.02)  # relative, of the models at rest: frequency, damping ratio, shape


def write_taps(laboratory: Laboratory, pose: int, folder: Path, seed: int) -> None:
    """Write the hammer FRFs ``<pose>_tip.h5`` and ``<pose>_housing.h5``, accelerance with covariance."""
    structure = laboratory.true.structure(laboratory.postures[pose], Condition(idle=True))
    generator = np.random.default_rng([seed, pose, 1])
    for place, responses in (("tip", TIP), ("housing", HOUSING)):
        model = select(structure, responses, TIP)
        write_frf(folder / f"{pose_name(pose)}_{place}.h5", _tapped(model, generator))


def _tapped(model: ModalModel, generator: np.random.Generator) -> Frf:
    omega = 2 * np.pi * LINES[:, None, None]
    exact = -(omega**2) * model.receptance(LINES)
    size = HAMMER_NOISE * np.sqrt(np.mean(np.abs(exact) ** 2, axis=(0, 2)))
    noise = generator.standard_normal((2, *exact.shape)) * size[:, None] / np.sqrt(2)
    n_lines, n_excitations = len(LINES), exact.shape[2]
    covariance = FrfCovariance(
        np.tile(np.diag(size**2).astype(complex), (n_lines, 1, 1)),
        np.tile(np.eye(n_excitations, dtype=complex), (n_lines, 1, 1)),
    )
    return Frf(
        LINES,
        exact + noise[0] + 1j * noise[1],
        model.responses,
        model.excitations,
        "accelerance",
        "m/s^2/N",
        np.ones(n_lines, dtype=bool),
        covariance=covariance,
        band=(float(LINES[0]), float(LINES[-1])),
    )


def write_idle_model(laboratory: Laboratory, pose: int, folder: Path, seed: int) -> None:
    """Write the model of the robot at rest at the housing, ``<pose>.json``, with typical errors of a fit."""
    structure = laboratory.true.structure(laboratory.postures[pose], Condition(idle=True))
    generator = np.random.default_rng([seed, pose, 2])
    model_at_housing = select(structure, HOUSING, TIP)
    low = model_at_housing.natural_frequencies < BAND[1]
    count = int(low.sum())
    natural = (
        2 * np.pi * model_at_housing.natural_frequencies[low] * (1 + MODEL_ERRORS[0] * generator.standard_normal(count))
    )
    ratios = model_at_housing.damping_ratios[low] * (1 + MODEL_ERRORS[1] * generator.standard_normal(count))
    shape = model_at_housing.right[low] * (
        1 + MODEL_ERRORS[2] * generator.standard_normal(model_at_housing.right[low].shape)
    )
    poles = natural * (-ratios + 1j * np.sqrt(1 - ratios**2))
    model = ModalModel(
        poles, shape, model_at_housing.left[low], model_at_housing.responses, model_at_housing.excitations
    )
    write_modal_model(folder / f"{pose_name(pose)}.json", replace(model, band=BAND))


CUT = "cut.toml"
CAMPAIGN = f"""# A simulated campaign: poses x immersions x sessions of a milling robot. What is hidden in it
# stands in concealed.json.
[campaign]
title = "Simulated campaign on a {{robot}}"
robot = "{{robot}}"

[[recordings]]
files = ["recordings/*.h5"]
pattern = "(?P<pose>P\\\\d+)_(?P<immersion>[a-z]+)_(?P<session>\\\\d+)"

[recordings.setup]
posture_deg = "robot.posture_deg"
temperature_c = "conditions.temperature_c"
level = "conditions.level"

# Recordings of one pose, session and level are stacked: three immersions make the forces independent.
[sets]
by = ["pose", "session", "level"]

[fit]
method = "subspace"
band_hz = [{BAND[0]}, {BAND[1]}]

[calibrate]
tip = "taps/{{{{pose}}}}_tip.h5"
sensor = "taps/{{{{pose}}}}_housing.h5"

[lobes]
cutting = "{CUT}"
speeds_rpm = [1200, 2400, 5]
max_depth_m = 0.02

[diagnose]
model = "idle/{{{{pose}}}}.json"
by = ["pose"]

[learn]

[report]
"""


def write_campaign_files(folder: Path, robot: str) -> None:
    """Write ``campaign.toml`` and the cutting process."""
    (folder / "campaign.toml").write_text(CAMPAIGN.format(robot=robot), encoding="utf-8")
    write_cutting_process(folder / CUT, CUTTER)


FORMAT = "millfrf.concealed_campaign"


def write_concealed(path: Path, laboratory: Laboratory, planned: Sequence[PlannedRecording], seed: int) -> None:
    """Write a JSON file with the concealed effects, the broken files, and the true modes of every pose."""
    true, drift = laboratory.true, laboratory.drift
    constants = {
        name: np.asarray(getattr(true, name)).tolist() for name in ("stiffening", "wave", "phase", "loss", "friction")
    }
    content: dict[str, Any] = {
        "format": FORMAT,
        "format_version": 1,
        "seed": seed,
        "robot": laboratory.robot,
        "joints": [joint.frame for joint in true.driven_joints()],
        "stiffness_at_light_load_nm_per_rad": [float(joint.stiffness[5]) for joint in true.driven_joints()],
        **constants,
        "drift": {
            "pose": pose_name(drift.pose),
            "joint": drift.joint,
            "stiffness_factor_in_each_session": list(drift.factors),
            "frequency_hz_in_each_session": [_softened(laboratory, factor) for factor in drift.factors],
        },
        "temperature": {
            "reference_c": REFERENCE_TEMPERATURE,
            "stiffness_lost_per_kelvin": SOFTER_PER_KELVIN,
            "loss_lost_per_kelvin": LESS_LOSS_PER_KELVIN,
        },
        "level": "no property of the robot depends on the level",
        "broken": [
            {"file": f"recordings/{recording.name}.h5", "fault": recording.fault}
            for recording in planned
            if recording.fault
        ],
        "poses": [_pose(laboratory, number) for number in range(len(laboratory.postures))],
        "recordings": [asdict(recording) for recording in planned],
    }
    path.write_text(json.dumps(content, indent=1), encoding="utf-8")


def _softened(laboratory: Laboratory, factor: float) -> list[float]:
    """Return the true frequencies (Hz) of the drifting pose at the reference temperature."""
    condition = Condition(joint_factors={laboratory.drift.joint: factor})
    frequencies = laboratory.true.structure(laboratory.postures[laboratory.drift.pose], condition).natural_frequencies
    return [float(value) for value in frequencies[frequencies < BAND[1]]]


def _pose(laboratory: Laboratory, number: int) -> dict[str, Any]:
    """Return the true modes of a pose inside the band, at the tool tip, at the reference temperature, without drift."""
    q = laboratory.postures[number]
    model = select(laboratory.true.structure(q, Condition()), TIP, TIP)
    low = model.natural_frequencies < BAND[1]
    return {
        "pose": pose_name(number),
        "posture_deg": np.degrees(q).round(3).tolist(),
        "frequency_hz": model.natural_frequencies[low].tolist(),
        "damping_ratio": model.damping_ratios[low].tolist(),
        "mass_normalised_shape": model.right.real[low].tolist(),
    }


ROBOT = "kuka_kr90_r3100"
WORKERS = 2


@dataclass(frozen=True)
class SimulatedCampaign:
    """Options of a simulated campaign."""

    out: Path  # new folder
    recordings: int = 200  # a multiple of the number of poses
    poses: int = 20
    seed: int = 0  # of all random numbers


def laboratory_of(options: SimulatedCampaign) -> tuple[Laboratory, list[PlannedRecording]]:
    """Draw robot, postures, drift and schedule."""
    if options.seed < 0:
        raise InputError(f"seed {options.seed} must be zero or more")
    sessions, _ = sessions_of(options.recordings, options.poses)
    case = read_spatial_robot(ROBOT)
    robot_seed, pose_seed, hidden_seed = np.random.SeedSequence(options.seed).spawn(3)
    true = drawn_robot(case.robot, np.random.default_rng(robot_seed))
    ready = named_posture(case, "ready")
    postures = spread_postures(case.robot.mechanism, ready, options.poses, np.random.default_rng(pose_seed))
    generator = np.random.default_rng(hidden_seed)
    drift = drawn_drift(true, postures, sessions, generator)
    planned = drawn_schedule(options.recordings, options.poses, drift.pose, generator)
    return Laboratory(true, ROBOT, postures, drift), planned


def make_campaign(options: SimulatedCampaign) -> None:
    """Make recordings, taps, models at rest, campaign.toml, cut.toml and concealed.json."""
    laboratory, planned = laboratory_of(options)
    with writing_whole_folder(options.out) as folder:
        for name in ("recordings", "taps", "idle"):
            (folder / name).mkdir()
        with progress("milling", len(planned)) as update, process_pool(WORKERS, (*CUTTING, *SIMULATION)) as pool:
            milled = pool.map(partial(write_recording, laboratory, folder=folder / "recordings"), planned)
            for number, _ in enumerate(milled, 1):
                update(number)
        for pose in range(options.poses):
            write_taps(laboratory, pose, folder / "taps", options.seed)
            write_idle_model(laboratory, pose, folder / "idle", options.seed)
        write_campaign_files(folder, laboratory.robot)
        write_concealed(folder / "concealed.json", laboratory, planned, options.seed)
