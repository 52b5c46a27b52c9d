"""Recordings of a simulated campaign, with concealed effects and faults."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from acquisition import RecordingWriter
from millfrf.core import Real
from millfrf.cutting import MillingProcess
from millfrf.robot_model import modes_at
from replay_data import (
    SWEEP_IMMERSIONS,
    ConstantSpeed,
    LinearSweep,
    MillingCell,
    Sensor,
    dynamometer,
    housing_accelerometers,
    setup_text,
)

from .true_robot import LEVEL_TEST, Condition, PlannedRecording, TrueRobot, energy_shares, pose_name

SOFTENING = 0.035  # relative loss of stiffness of a joint from the first session to the last
LOW_MODES = 6  # modes that the recordings show


@dataclass(frozen=True)
class HiddenDrift:
    """Softening of one joint in one pose, as by local wear of its gear."""

    pose: int  # number of the pose, from 0
    joint: str  # frame of the joint
    factors: tuple[float, ...]  # (n_sessions,); factor on the joint's stiffness in each session

    def condition(self, planned: PlannedRecording) -> Condition:
        """Return the condition of the robot in a recording."""
        softer = {self.joint: self.factors[planned.session - 1]} if planned.pose == self.pose else {}
        return Condition(planned.temperature, softer)


def drawn_drift(true: TrueRobot, postures: Real, sessions: int, generator: np.random.Generator) -> HiddenDrift:
    """Draw the pose; choose the joint with the largest share of energy in one of its low modes."""
    pose = int(generator.integers(len(postures)))
    shares = energy_shares(true.robot, modes_at(true.robot, postures[pose]))[:LOW_MODES, :-1]
    joint = true.driven_joints()[int(np.argmax(shares.max(axis=0)))].frame
    softening = SOFTENING * np.arange(sessions) / (sessions - 1)
    return HiddenDrift(pose, joint, tuple(float(value) for value in 1 - softening))


TRUNCATED_SHARE = 0.55  # remaining share of a truncated file
SECTOR = 4096  # bytes of a bad sector
CLIPPED_AT = 0.5  # full scale of the clipped force over its largest value
CLIPPED = "fy"


def clipped_sensors(cell: MillingCell) -> tuple[Sensor, ...]:
    """Return the sensors with the range of one force channel reduced below the peaks of this force."""
    names = [sensor.name for sensor in cell.sensors]
    peak = float(np.abs(cell.samples()[:, names.index(CLIPPED)]).max())
    return tuple(
        replace(sensor, full_scale=round(CLIPPED_AT * peak, 1)) if sensor.name == CLIPPED else sensor
        for sensor in cell.sensors
    )


def spoil(path: Path, fault: str | None, cell: MillingCell) -> None:
    """Damage the file of a recording."""
    if fault == "no HDF5 file":
        names = ";".join(sensor.name for sensor in cell.sensors)
        np.savetxt(path, cell.samples(), fmt="%.4f", delimiter=";", header=names, comments="")
        return
    content = path.read_bytes()
    if fault == "truncated":
        path.write_bytes(content[: int(TRUNCATED_SHARE * len(content))])
    elif fault == "damaged block":
        middle = len(content) // 2 // SECTOR * SECTOR
        path.write_bytes(content[:middle] + bytes(SECTOR) + content[middle + SECTOR :])


RPM = math.pi / 30

# A two-fluted 20 mm end mill in aluminium, down-milling at half immersion
CUTTER = MillingProcess(
    teeth=2,
    diameter=20e-3,
    edge_angle=math.pi / 2,
    ktc=600e6,
    krc=0.3,
    kac=0.25,
    start_angle=math.pi / 2,
    exit_angle=math.pi,
    feed_per_tooth=0.1e-3,
    runout=10e-6,
)

TOOL = "end mill, 20 mm, 2 flutes"
DEPTH = 0.5e-3  # m, of the sweeps: well below the limits
SWEEP_RPM = (450.0, 690.0)  # the teeth pass at 15 to 23 Hz, and four harmonics reach 92 Hz
SLOT_RPM = 3300.0

# six modes lie below 95 Hz, and the fit keeps records up to 1.6 of its band: 512 Hz is enough for both. 16 s, with the
# noise below, give frequencies to about 0.1 %.
SECONDS, SAMPLE_RATE, OVERSAMPLING = 16.0, 512.0, 8
POROUS_SECONDS = 64.0  # one recording replaces three

# noise relative to each signal, as from servo drives, coolant and neighbouring machines
FORCE_NOISE, ACCELERATION_NOISE = 0.05, 0.3

# accelerometers of 5 g, as are taken for slow and small vibration
SENSORS = dynamometer(FORCE_NOISE) + housing_accelerometers(ACCELERATION_NOISE, full_scale=49.0)


@dataclass(frozen=True)
class Laboratory:
    """Common properties of the recordings of a campaign."""

    true: TrueRobot
    robot: str  # name of the robot file
    postures: Real  # (n_poses, n_driven), rad
    drift: HiddenDrift


def write_recording(laboratory: Laboratory, planned: PlannedRecording, folder: Path) -> None:
    """Simulate and write one recording; damage its file if planned."""
    nominal = cell = _cell(laboratory, planned)
    if planned.fault == "clipped":
        cell = _cell(laboratory, planned, clipped_sensors(cell))
    path = folder / f"{planned.name}.h5"
    with RecordingWriter(
        path, nominal.streams, title=cell.title, setup=cell.setup, recorded_at=planned.recorded_at
    ) as writer:
        cell.open()
        while (block := cell.read()) is not None:
            writer.append(block.stream, block.samples, block.first_sample)
            writer.append_clock_pair(block.stream, block.first_sample + len(block.samples), block.host_time)
        cell.close()
    spoil(path, planned.fault, cell)


def _cell(laboratory: Laboratory, planned: PlannedRecording, sensors: Sequence[Sensor] = SENSORS) -> MillingCell:
    structure = laboratory.true.structure(laboratory.postures[planned.pose], laboratory.drift.condition(planned))
    porous = planned.immersion == LEVEL_TEST
    start, leave = (0.0, 1.0) if porous else SWEEP_IMMERSIONS[planned.immersion]
    sweep = LinearSweep(SWEEP_RPM[0] * RPM, SWEEP_RPM[1] * RPM, SECONDS)
    slot = ConstantSpeed(SLOT_RPM * RPM)
    cell = MillingCell(
        structure,
        replace(CUTTER, start_angle=start * math.pi, exit_angle=leave * math.pi),
        DEPTH * planned.level,
        slot if porous else sweep,
        POROUS_SECONDS if porous else SECONDS,
        sample_rate=SAMPLE_RATE,
        material="porous" if porous else "homogeneous",
        sensors=sensors,
        seed=planned.seed,
        oversampling=OVERSAMPLING,
    )
    cell.title = f"{pose_name(planned.pose)}, {planned.immersion}, session {planned.session}"
    cell.setup = f"{_notes(laboratory, planned)}\n{cell.setup}"
    return cell


def _notes(laboratory: Laboratory, planned: PlannedRecording) -> str:
    """Return the setup text: robot, tool and conditions."""
    n_poses = len(laboratory.postures)
    posture_stated = (planned.pose + n_poses // 2) % n_poses if planned.fault == "wrong posture" else planned.pose
    return setup_text(
        {
            "robot": {
                "name": laboratory.robot,
                "pose": pose_name(planned.pose),
                "posture_deg": [round(float(angle), 3) for angle in np.degrees(laboratory.postures[posture_stated])],
            },
            "tool": {"name": TOOL},
            "conditions": {
                "session": planned.session,
                "temperature_c": planned.temperature,
                "level": planned.level,
                "immersion": planned.immersion,
            },
        }
    )
