"""Postures that a campaign did not measure: do the bands of the learned posture model hold the truth?

Run it: `python benchmarks/campaign_postures.py FIRST LAST [POSES] [NEW] [LEFT_OUT] [SESSIONS]`, for example `0 3 20 24`
for campaigns of seeds 0 to 2, 20 measured poses and 24 new ones each. LEFT_OUT measured poses are left out one by one;
SESSIONS sessions are fitted. Every number comes through recordings: they are made, fitted set by set,
calibrated to the tip and learned from, as `millfrf campaign` does it. Models at the housing are kept in a folder
(MILLFRF_TRIALS, else the system's temporary one), so that a second run only calibrates, learns and predicts.
"""

import os
import sys
import tempfile
from itertools import groupby
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimation import read_frf
from millfrf.campaign.simulated.make import SimulatedCampaign, laboratory_of, make_campaign
from millfrf.campaign.simulated.recordings import Laboratory
from millfrf.campaign.simulated.true_robot import Condition, PlannedRecording, pose_name, spread_postures
from millfrf.core import InputError, MillfrfError
from millfrf.cutting import MillingProcess, read_cutting_process
from millfrf.robot_model import (
    LearnedPostures,
    learn_postures,
    measured_modes,
    named_posture,
    predict_posture,
    read_spatial_robot,
)
from millfrf.robot_model.posture_process.modal_basis import MeasuredModes, mode_pairs
from millfrf.stability import lowest_limits
from millfrf.steps.calibrate import calibrate
from millfrf.steps.fit import fit
from millfrf.steps.robot.learned import depth_band
from modal_fit import ModalModel, write_modal_model
from replay_data import tip_model

Real = NDArray[np.float64]

BAND = (8.0, 95.0)
MODES = 6
SPEEDS = np.array([1500.0, 2400.0]) * np.pi / 30
DEEPEST = 0.05
SAMPLES = 39
"""Draws of a depth limit: the smallest and the largest hold the next one with 38 / 40 = 95 %."""

Row = tuple[str, float, float, float]
"""What was predicted, and logarithms over the truth: middle, low end and high end of the band."""


def fitted_sets(folder: Path, laboratory: Laboratory, planned: list[PlannedRecording]) -> list[tuple[int, ModalModel]]:
    """Fit and calibrate every pose, session and level; the models at the tip with the numbers of their poses."""
    result = []
    (folder / "models").mkdir(exist_ok=True)
    key = lambda one: (one.pose, one.session, one.level)  # noqa: E731
    for (pose, session, level), group in groupby(sorted(planned, key=key), key):
        out = folder / "models" / f"{pose_name(pose)}_{session}_{level:g}.json"
        refused = out.with_suffix(".refused")
        if not out.is_file() and not refused.is_file():
            try:
                paths = [folder / "recordings" / f"{one.name}.h5" for one in group if one.fault is None]
                write_modal_model(out, fit(*paths, band=BAND).model)
            except (InputError, MillfrfError) as error:
                refused.write_text(str(error))
        if out.is_file():
            taps = [read_frf(folder / "taps" / f"{pose_name(pose)}_{place}.h5") for place in ("tip", "housing")]
            result.append((pose, calibrate(out, tip=taps[0], sensor=taps[1]).model))
    return result


def depths(model: ModalModel, process: MillingProcess) -> Real:
    """Depth limits of a model at the trial's speeds, m."""
    return np.minimum(lowest_limits(model, process, SPEEDS, DEEPEST).lowest().depth_limits, DEEPEST)


def compared(learned: LearnedPostures, q: Real, truth: ModalModel, process: MillingProcess | None) -> list[Row]:
    """Frequencies, damping ratios and depth limits of one posture beside the truth."""
    result = predict_posture(learned, q)
    model, frequency, damping = result.model, result.frequency_band(), result.damping_band()
    rows: list[Row] = []
    pairs = mode_pairs(
        truth.natural_frequencies[:MODES], truth.right.real[:MODES], model.natural_frequencies, model.right.real
    )
    for i, r in pairs:
        f, z = truth.natural_frequencies[i], truth.damping_ratios[i]
        rows.append(("frequency", *np.log(np.array([model.natural_frequencies[r], *frequency[:, r]]) / f).tolist()))
        rows.append(("damping", *np.log(np.array([model.damping_ratios[r], *damping[:, r]]) / z).tolist()))
    if process is not None:
        band = depth_band(result.draws, process, SPEEDS, DEEPEST, SAMPLES)
        for k, limit in enumerate(depths(truth, process)):
            ends = np.maximum([band.middle[k], band.low[k], band.high[k]], 1e-9)
            rows.append(("depth limit", *np.log(ends / limit).tolist()))
    return rows


def trial(seed: int, poses: int, new: int, left_out: int, sessions: int, limits: bool = True) -> dict[str, list[Row]]:
    """One campaign: rows of new postures, and of measured postures each left out with all its sets."""
    folder = Path(os.environ.get("MILLFRF_TRIALS", tempfile.gettempdir())) / f"campaign_postures_{seed}_{poses}"
    options = SimulatedCampaign(folder, 10 * poses, poses, seed)
    if not folder.is_dir():
        make_campaign(options)
    laboratory, planned = laboratory_of(options)
    process = read_cutting_process(folder / "cut.toml")
    chosen = [each for each in planned if each.session <= sessions]
    sets = fitted_sets(folder, laboratory, chosen)
    case = read_spatial_robot(laboratory.robot)
    measured = [
        (pose, measured_modes(f"{pose_name(pose)} {number}", laboratory.postures[pose], model))
        for number, (pose, model) in enumerate(sets)
    ]
    mean = Condition(float(np.mean([each.temperature for each in chosen])))
    learned = learn_postures(case.robot, [modes for _, modes in measured])
    print(f"seed {seed}: {len(sets)} sets, learned", file=sys.stderr, flush=True)
    fresh = spread_postures(case.robot.mechanism, named_posture(case, "ready"), new, np.random.default_rng([seed, 99]))
    result: dict[str, list[Row]] = {"new": [], "left out": []}
    for q in fresh:
        result["new"] += compared(
            learned, q, tip_model(laboratory.true.structure(q, mean)), process if limits else None
        )
    for pose in range(min(left_out, poses)):
        rest: list[MeasuredModes] = [modes for other, modes in measured if other != pose]
        truth = tip_model(laboratory.true.structure(laboratory.postures[pose], mean))
        result["left out"] += compared(learn_postures(case.robot, rest), laboratory.postures[pose], truth, None)
    return result


def main(first: int, last: int, poses: int = 20, new: int = 24, left_out: int = 0, sessions: int = 3) -> None:
    """Print coverage, error and width of the bands."""
    whole: dict[str, list[Row]] = {"new": [], "left out": []}
    for seed in range(first, last):
        for kind, rows in trial(seed, poses, new, left_out, sessions).items():
            whole[kind] += rows
            if rows:
                show(f"seed {seed}, {kind}", rows)
    for kind, rows in whole.items():
        if rows:
            show(f"all, {kind}", rows)


def show(title: str, rows: list[Row]) -> None:
    """Print one table."""
    print(f"{title}\n{'':14}{'number':>8}{'error (%)':>11}{'half band (%)':>15}{'coverage (%)':>14}")
    for quantity in ("frequency", "damping", "depth limit"):
        some = np.array([row[1:] for row in rows if row[0] == quantity])
        if len(some):
            inside = np.mean((some[:, 1] <= 0) & (some[:, 2] >= 0))
            width = np.median(some[:, 2] - some[:, 1]) / 2
            error = np.sqrt(np.mean(some[:, 0] ** 2))
            print(f"{quantity:14}{len(some):8d}{100 * error:11.2f}{100 * width:15.2f}{100 * inside:14.1f}", flush=True)
