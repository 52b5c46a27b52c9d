"""`make_campaign`: a campaign as a laboratory would have it, without hardware."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from millfrf.core import InputError, process_pool, writing_whole_folder
from millfrf.robot_model import named_posture, read_spatial_robot

from ...progress import Progress, silent
from .at_rest import write_idle_model, write_taps
from .campaign_files import write_campaign_files
from .concealed import write_concealed
from .hidden import drawn_drift
from .recordings import Laboratory, write_recording
from .schedule import PlannedRecording, drawn_schedule, sessions_of
from .true_robot import drawn_robot
from .work_area import spread_postures

ROBOT = "kuka_kr90_r3100"
WORKERS = 2


@dataclass(frozen=True)
class SimulatedCampaign:
    """Options of a simulated campaign.

    Parameters
    ----------
    out
        Folder that is made; nothing is written elsewhere.
    recordings, poses
        Number of recordings, a multiple of the number of poses.
    seed
        Seed of everything that is drawn.
    """

    out: Path
    recordings: int = 200
    poses: int = 20
    seed: int = 0


def laboratory_of(options: SimulatedCampaign) -> tuple[Laboratory, list[PlannedRecording]]:
    """Draw robot, postures, drift and schedule.

    Raises
    ------
    InputError
        Numbers that cannot be.
    """
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


def make_campaign(options: SimulatedCampaign, progress: Progress = silent) -> None:
    """Make recordings, taps, models at rest, campaign.toml, cut.toml and concealed.json.

    Raises
    ------
    InputError
        Numbers that cannot be, or a folder that cannot be made.
    """
    laboratory, planned = laboratory_of(options)
    with writing_whole_folder(options.out) as folder:
        for name in ("recordings", "taps", "idle"):
            (folder / name).mkdir()
        with progress("milling", len(planned)) as update, process_pool(WORKERS) as pool:
            milled = pool.map(partial(write_recording, laboratory, folder=folder / "recordings"), planned)
            for number, _ in enumerate(milled, 1):
                update(number)
        for pose in range(options.poses):
            write_taps(laboratory, pose, folder / "taps", options.seed)
            write_idle_model(laboratory, pose, folder / "idle", options.seed)
        write_campaign_files(folder, laboratory.robot)
        write_concealed(folder / "concealed.json", laboratory, planned, options.seed)
