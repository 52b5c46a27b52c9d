"""From recordings to stability lobes in Python: mill a simulated robot, estimate, fit, draw the limit.

Run it: `python examples/from_recordings_to_lobes.py`. With recordings of your own, leave out `mill` and
give their names to `limits`.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np

from acquisition import Recording, record
from estimation import cross_spectra, h1, settings_for, sum_tests
from millfrf.stability import StabilityLobes, certified_lobes
from modal_fit import ModalModel, fit_polyreference
from replay_data import (
    ACETAL_CUTTER,
    SWEEP_IMMERSIONS,
    LinearSweep,
    MillingCell,
    dynamometer,
    table_one_model,
    tip_accelerometers,
)

RPM = pi / 30
CUTTER = replace(ACETAL_CUTTER, runout=0.0)

FITTED = (15.2, 45.0)
"""Hz. Limits depend on the FRF at the chatter frequency and at harmonics of the tooth passing beside it (18 + 27 Hz at
800 rpm). A model of 15.2 to 22.5 Hz, where both modes lie, has limits that are off by up to 47 %, this one by 2 %."""

SEGMENT = 16.0
"""s. Shorter segments leak more: 8 s make the damping of the first mode 1.5 % too large, and one limit 3.6 %."""


def mill(folder: Path, seconds: float) -> list[Path]:
    """Three speed sweeps, 450 to 690 rpm, each in another immersion so that the forces are independent."""
    files = []
    sweep = LinearSweep(450 * RPM, 690 * RPM, seconds)
    for number, (start, exit_) in enumerate(SWEEP_IMMERSIONS.values()):
        process = replace(CUTTER, start_angle=start * pi, exit_angle=exit_ * pi)
        sensors = dynamometer() + tip_accelerometers()
        cell = MillingCell(table_one_model(), process, 2e-3, sweep, seconds, sensors=sensors, seed=number)
        files.append(folder / f"sweep_{number}.h5")
        record(cell, files[-1])
    return files


def limits(files: Sequence[Path]) -> tuple[ModalModel, StabilityLobes]:
    """Modal model and depth limits from recordings of one set-up."""
    tests = []
    for file in files:
        with Recording(file) as recording:
            settings = settings_for(recording.stream().sample_rate, SEGMENT)
            tests.append(cross_spectra(recording, settings))
    fit = fit_polyreference(h1(sum_tests(tests)), FITTED)
    for warning in fit.warnings:
        print("warning:", warning)
    return fit.model, certified_lobes(fit.model, CUTTER, np.linspace(600, 2400, 100) * RPM, 10e-3)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        model, lobes = limits(mill(Path(folder), 60.0))
    for frequency, zeta in zip(model.natural_frequencies, model.damping_ratios, strict=True):
        print(f"mode at {frequency:.3f} Hz, damping {100 * zeta:.2f} %")
    lowest = int(np.argmin(lobes.depth_limits))
    print(f"lowest limit {1e3 * lobes.depth_limits[lowest]:.2f} mm at {lobes.spindle_speeds_rpm[lowest]:.0f} rpm")


if __name__ == "__main__":
    main()
