"""Recordings that every test of the gate starts from: short milling sweeps of the simulated cell."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from acquisition import record
from millfrf.steps.recording.simulated_device import SWEEP_DEPTH
from replay_data import ACETAL_CUTTER, SWEEP_IMMERSIONS, LinearSweep, MillingCell, default_structure, milling_sensors

RPM = math.pi / 30
SECONDS = 24.0


@pytest.fixture(scope="session")
def sweeps(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The demonstration's three sweeps, 24 s each at 1024 Hz: ``central``, ``down`` and ``up``."""
    folder = tmp_path_factory.mktemp("sweeps")
    made = {}
    for number, (name, (start, exit_)) in enumerate(SWEEP_IMMERSIONS.items()):
        cell = MillingCell(
            default_structure(),
            replace(ACETAL_CUTTER, start_angle=start * math.pi, exit_angle=exit_ * math.pi),
            SWEEP_DEPTH,
            LinearSweep(450 * RPM, 690 * RPM, SECONDS),
            SECONDS,
            sample_rate=1024.0,
            sensors=milling_sensors(0.01, 0.01),
            seed=number,
            oversampling=8,
        )
        made[name] = folder / f"{name}.h5"
        record(cell, made[name])
    return made
