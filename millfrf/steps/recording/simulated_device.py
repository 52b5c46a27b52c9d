"""The simulated device of a session: a robot cell that mills in the session's immersion while the spindle sweeps."""

import math
import os
from typing import Any

import numpy as np
import tomlkit

from acquisition import Block, EventAxis, Events, Paced, Session, SimulatedDevice, Source, SourceWrapper
from millfrf.cutting import MillingProcess, process_from_table
from replay_data import (
    ACETAL_CUTTER,
    ConstantSpeed,
    MillingCell,
    RepeatedSweep,
    SpeedProfile,
    cutting_table,
    default_structure,
    milling_sensors,
)

from ..plan import plan_from_file
from ..settings import RPM, SPEED_EVENTS

_ENGAGEMENT = ("start_angle_deg", "exit_angle_deg", "immersion", "radial_depth_m")

# Sweep of the demonstration: first and last spindle speed (rpm), duration (s), axial depth (m)
SWEEP_RPM, SWEEP_SECONDS, SWEEP_DEPTH = (450.0, 690.0), 60.0, 2e-3


def simulated_device(session: Session, path: str | os.PathLike[str]) -> Source:
    """Set the simulated cell up as a session describes it, in real time or faster.

    Cutter and coefficients are those of ``[cutting]``; values that are missing are those of the demonstration. The
    immersion is that of ``[cut]`` or ``[cutting]``, the depth that of ``[cut]`` or ``[plan]``.
    """
    device = session.device
    assert isinstance(device, SimulatedDevice)
    profile = _profile(session, device, path)
    process = _process(session, path)
    passing = process.teeth * profile.fastest / (2 * math.pi)
    finest = max(8192.0, 10 * passing)  # Hz; ten samples in a tooth passing resolve its force pulse
    cell = MillingCell(
        default_structure(),
        process,
        number_in(session.cut, "depth_m") or number_in(session.plan, "depth_m") or SWEEP_DEPTH,
        profile,
        session.duration_s or 3600.0,
        sample_rate=device.sample_rate_hz,
        sensors=milling_sensors(device.noise, device.noise),
        seed=device.seed,
        block_length=max(64, round(0.1 * device.sample_rate_hz)),
        oversampling=max(2, math.ceil(finest / device.sample_rate_hz)),
    )
    cell.setup = _setup(session, cell.setup)
    return Paced(WithSpindleSpeed(cell, profile, device.sample_rate_hz), device.speed)


def _setup(session: Session, simulated: str) -> str:
    """Add tool, pose and the further entries of the cut of a session to the set-up that the cell simulates.

    The cell states the engagement in ``[cutting]``, where a second form of it would contradict.
    """
    document = tomlkit.parse(simulated)
    cut = {key: value for key, value in session.cut.items() if key not in _ENGAGEMENT}
    for name, stated in {"tool": session.tool, "cut": cut, "pose": session.pose}.items():
        entries = {**stated, **document.get(name, {})}
        if entries:
            document[name] = entries
    return tomlkit.dumps(document)


def _profile(session: Session, device: SimulatedDevice, path: str | os.PathLike[str]) -> SpeedProfile:
    """Return the constant speed of the device, else the sweep of the device, of the plan, or of the demonstration."""
    if device.spindle_speed_rpm is not None:
        return ConstantSpeed(device.spindle_speed_rpm * RPM)
    speeds, seconds = tuple(speed * RPM for speed in SWEEP_RPM), session.duration_s or SWEEP_SECONDS
    if session.plan:
        plan = plan_from_file(path)[0]
        speeds, seconds = plan.spindle_speeds, plan.duration
    if device.sweep_rpm is not None:
        speeds = tuple(speed * RPM for speed in device.sweep_rpm)
    return RepeatedSweep(speeds[0], speeds[1], device.sweep_s or seconds)


def _process(session: Session, path: str | os.PathLike[str]) -> MillingProcess:
    """Return the milling process of the session; missing values are taken from the demonstration."""
    stated = {**session.cutting, **{key: session.cut[key] for key in _ENGAGEMENT if key in session.cut}}
    default: dict[str, Any] = cutting_table(ACETAL_CUTTER)
    if any(key in stated for key in _ENGAGEMENT):  # the engagement has several forms that exclude each other
        default = {key: value for key, value in default.items() if key not in _ENGAGEMENT}
    return process_from_table(default | stated, os.fspath(path))


def number_in(table: dict[str, Any], key: str) -> float:
    """Number of a TOML table, 0 where it is missing or no number."""
    value = table.get(key, 0)
    return float(value) if isinstance(value, int | float) else 0.0


class WithSpindleSpeed(SourceWrapper):
    """A simulated cell that also gives its spindle speed at the end of every block, as a drive on a bus does."""

    def __init__(self, cell: Source, profile: SpeedProfile, sample_rate: float) -> None:
        super().__init__(cell)
        self._profile, self._rate = profile, sample_rate
        self._next_speed: Events | None = None  # event that follows the last block
        self.event_series = {SPEED_EVENTS: EventAxis()}

    def open(self) -> None:
        """Start the cell from rest."""
        self._next_speed = None
        self._source.open()

    def read(self) -> Block | Events | None:
        """The next block, and after it the speed at its end."""
        if self._next_speed is not None:
            speed_event, self._next_speed = self._next_speed, None
            return speed_event
        block = self._source.read()
        if isinstance(block, Block):
            end = (block.first_sample + len(block.samples)) / self._rate
            around = self._profile.angle(np.array([end - 1e-3, end]))
            speed = float(np.diff(around)[0]) / 1e-3 / RPM
            self._next_speed = Events(SPEED_EVENTS, np.array([end]), np.array([speed]))
        return block

    def close(self) -> None:
        """Stop the cell."""
        self._source.close()
