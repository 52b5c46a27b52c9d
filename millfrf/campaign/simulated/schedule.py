"""What is recorded when: poses, immersions, sessions, temperatures; and what is hidden in it."""

import datetime
from dataclasses import dataclass
from itertools import product

import numpy as np

from millfrf.core import InputError
from replay_data import SWEEP_IMMERSIONS

LEVEL_TEST = "porous"
"""A slot in porous material at another level: its random forces are independent in one recording."""

FULL_LEVEL, OTHER_LEVEL = 1.0, 0.5
"""Depth of cut over that of the sweeps."""

FAULTS = ("truncated", "no HDF5 file", "damaged block", "clipped", "wrong posture")
"""What is wrong with the broken files: see :mod:`millfrf.campaign.simulated.faults`."""

FIRST_DAY = datetime.datetime(2026, 3, 2, 8, tzinfo=datetime.UTC)
DAYS_BETWEEN, MINUTES_A_POSE, MINUTES_A_RECORDING = 7, 20, 4
MEAN_TEMPERATURES, WARMER_BY_EVENING = (17.0, 26.0), 5.0
"""Mean of a day, degrees Celsius, and how much a hall and a robot warm up in eight hours."""

LEAST_POSES, LEAST_A_POSE = len(FAULTS) + 1, 6


@dataclass(frozen=True)
class PlannedRecording:
    """One recording of the campaign.

    Parameters
    ----------
    name
        Name of the file, without its suffix.
    pose
        Number of the pose, from 0.
    immersion
        One of :data:`replay_data.SWEEP_IMMERSIONS`, or :data:`LEVEL_TEST`.
    session
        Number of the session, from 1.
    level
        Depth of cut over that of the sweeps.
    temperature : degrees Celsius
        Temperature at the time.
    recorded_at
        Time of the recording, ISO 8601, UTC.
    seed
        Seed of noise and pores.
    fault
        One of :data:`FAULTS`, or None.
    """

    name: str
    pose: int
    immersion: str
    session: int
    level: float
    temperature: float
    recorded_at: str
    seed: int
    fault: str | None


def pose_name(number: int) -> str:
    """Name of a pose, from its number, from 0.

    Examples
    --------
    >>> pose_name(6)
    'P07'
    """
    return f"P{number + 1:02d}"


def sessions_of(recordings: int, poses: int) -> tuple[int, int]:
    """How many sessions of three immersions, and recordings at another level, each pose has.

    Raises
    ------
    InputError
        Numbers that do not divide, or too few.

    Examples
    --------
    >>> sessions_of(200, 20)
    (3, 1)
    """
    if poses < LEAST_POSES:
        raise InputError(f"{poses} poses are too few for {len(FAULTS)} broken files and a drift: give {LEAST_POSES}")
    each, rest = divmod(recordings, poses)
    if rest or each < LEAST_A_POSE:
        raise InputError(
            f"{recordings} recordings in {poses} poses: give a multiple of the poses, {LEAST_A_POSE} or more a pose, "
            f"for example {10 * poses}"
        )
    return divmod(each, len(SWEEP_IMMERSIONS))


def drawn_schedule(
    recordings: int, poses: int, drifting: int, generator: np.random.Generator
) -> list[PlannedRecording]:
    """Draw days, orders and temperatures; put the faults into five poses other than the drifting one.

    Parameters
    ----------
    recordings, poses
        Numbers of recordings and poses.
    drifting
        Number of the pose with the drift, which keeps whole files.
    generator
        Random generator that draws it all.
    """
    sessions, others = sessions_of(recordings, poses)
    spoilt = generator.choice([p for p in range(poses) if p != drifting], len(FAULTS), replace=False).tolist()
    places = {
        (pose, int(generator.integers(1, sessions + 1)), str(generator.choice(list(SWEEP_IMMERSIONS)))): fault
        for pose, fault in zip(spoilt, FAULTS, strict=True)
    }
    planned: list[PlannedRecording] = []
    for session in range(1, sessions + 1):
        mean = generator.uniform(*MEAN_TEMPERATURES)
        tests = list(product(SWEEP_IMMERSIONS, [FULL_LEVEL]))
        if session == sessions:
            tests += [(LEVEL_TEST, OTHER_LEVEL)] * others
        for turn, pose in enumerate(generator.permutation(poses).tolist()):
            for number, (immersion, level) in enumerate(tests):
                minutes = MINUTES_A_POSE * turn + MINUTES_A_RECORDING * number
                when = FIRST_DAY + datetime.timedelta(days=DAYS_BETWEEN * (session - 1), minutes=minutes)
                again = f"_{number - len(SWEEP_IMMERSIONS) + 1}" if number > len(SWEEP_IMMERSIONS) else ""
                planned.append(
                    PlannedRecording(
                        f"{pose_name(pose)}_{immersion}_{session}{again}",
                        pose,
                        immersion,
                        session,
                        level,
                        round(mean + WARMER_BY_EVENING * minutes / 480, 1),
                        when.isoformat(timespec="seconds"),
                        int(generator.integers(1 << 31)),
                        places.get((pose, session, immersion)),
                    )
                )
    return planned
