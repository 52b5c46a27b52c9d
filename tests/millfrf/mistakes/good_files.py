"""Good files of every kind, small and quick to make: what each mistake starts from."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from acquisition import record
from estimation import Frf, write_frf
from millfrf.core import HOUSING, TIP
from millfrf.cutting import MillingProcess
from modal_fit import ModalModel, write_modal_model
from replay_data import (
    SWEEP_IMMERSIONS,
    HammerCell,
    LinearSweep,
    MillingCell,
    default_structure,
    dynamometer,
    housing_accelerometers,
    select,
    tip_accelerometers,
)
from replay_data import table_one_model as tip_structure

RPM = math.pi / 30
RATE = 512.0
CUT = """[cutting]
teeth = 2
diameter_m = 0.0127
edge_angle_deg = 90.0
ktc_pa = 119e6
krc = 0.17
kac = 0.33
start_angle_deg = 90.0
exit_angle_deg = 180.0
feed_per_tooth_m = 0.00015
"""
PROCESS = MillingProcess(2, 12.7e-3, math.pi / 2, 119e6, 0.17, 0.33, math.pi / 2, math.pi, 0.15e-3)
PLAN = """[plan]
band_hz = [14.0, 24.0]
depth_m = 0.002
resolution_hz = 0.25
acceleration_noise = 1e-4
frf_error_m_per_n = 1e-8
immersion_widths_deg = [30, 45, 60]
"""
SESSION = """title = "sweep"
duration_s = 0.5
[device]
driver = "simulated"
speed = 50.0
"""
WIRED = """title = "sweep"
duration_s = 60.0
band_hz = [10.0, 400.0]
[device]
driver = "ni"
sample_rate_hz = 5120
[[channels]]
name = "fx"
quantity = "force"
unit = "N"
node = "TCP"
direction = "+X"
terminal = "cDAQ1Mod1/ai0"
units_per_volt = 100
[[channels]]
name = "ax"
quantity = "acceleration"
unit = "g"
node = "HOUSING"
direction = "+X"
terminal = "cDAQ1Mod2/ai0"
mv_per_unit = 100
"""
MAPPING = """sample_rate = 512.0
[[channels]]
name = "fx"
column = 1
quantity = "force"
unit = "N"
node = "TCP"
direction = "+X"
[[channels]]
name = "ax"
column = 2
quantity = "acceleration"
unit = "m/s^2"
node = "HOUSING"
direction = "+X"
"""
PATH = "x_m,y_m,z_m,rx_rad,ry_rad,rz_rad,fx_n,fy_n,fz_n\n" + "".join(
    f"{1.0 + 0.1 * i},0.0,0.8,3.14159,0,0,50,80,-20\n" for i in range(3)
)


def make(folder: Path) -> None:
    """Write every good file."""
    _recordings(folder)
    structure = default_structure()
    tip = tip_structure()
    tip = ModalModel(tip.poles, tip.right, tip.left, tip.responses, tip.excitations, band=(12.0, 60.0))
    write_modal_model(folder / "model_tip.json", tip)
    housing = select(structure, HOUSING, TIP)
    write_modal_model(folder / "model_housing.json", replace(housing, band=(10.0, 150.0)))
    write_modal_model(folder / "model_process.json", replace(first_modes(housing, 2), band=(13.0, 25.0)))
    lines = np.arange(4.0, 64.0, 0.25)
    write_frf(folder / "frf_tip.h5", hammered(select(structure, TIP, TIP), lines, 1))
    write_frf(folder / "frf_housing.h5", hammered(housing, lines, 2))
    for name, text in (
        ("cut.toml", CUT),
        ("plan.toml", CUT + PLAN),
        ("session.toml", SESSION),
        ("wired.toml", WIRED),
        ("map.toml", MAPPING),
        ("path.csv", PATH),
    ):
        (folder / name).write_text(text, encoding="utf-8")
    rng = np.random.default_rng(5)
    table = rng.standard_normal((200, 2))
    (folder / "table.csv").write_text("fx,ax\n" + "".join(f"{a:.6f},{b:.6f}\n" for a, b in table), encoding="utf-8")


def first_modes(model: ModalModel, count: int) -> ModalModel:
    """The lowest modes alone."""
    return replace(model, poles=model.poles[:count], right=model.right[:count], left=model.left[:count])


def hammered(model: ModalModel, lines: np.ndarray, seed: int) -> Frf:
    """A model's FRF with 0.1 % of noise and its coherence."""
    frf = model.frf(lines)
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal(frf.values.shape) + 1j * rng.standard_normal(frf.values.shape)
    scale = 1e-3 * np.abs(frf.values).max(axis=(1, 2), keepdims=True)
    coherence = np.full(frf.values.shape[:2], 0.999)
    return replace(frf, values=frf.values + scale * noise, multiple_coherence=coherence, band=None)


def _recordings(folder: Path) -> None:
    structure = default_structure()
    sensors = dynamometer(0.01) + housing_accelerometers(0.01)
    sweep = LinearSweep(450 * RPM, 690 * RPM, 20.0)
    for number, (name, (start, leave)) in enumerate(SWEEP_IMMERSIONS.items()):
        process = replace(PROCESS, start_angle=start * math.pi, exit_angle=leave * math.pi)
        cell = MillingCell(structure, process, 2e-3, sweep, 20.0, sample_rate=RATE, sensors=sensors, seed=number)
        record(cell, folder / f"{name}.h5")
    sensors = dynamometer(0.01) + tip_accelerometers(0.01)
    cell = MillingCell(
        structure, PROCESS, 1e-3, 800 * RPM, 12.0, sample_rate=RATE, sensors=sensors, seed=7, oversampling=8
    )
    record(cell, folder / "steady.h5")
    _hammer_tests(folder)


def _hammer_tests(folder: Path) -> None:
    """Three files with one hammer, ``tap_x.h5`` ``tap_y.h5`` ``tap_z.h5``: three taps each, on the tool tip."""
    for number, (force, place) in enumerate(zip(dynamometer(0.001, 2000.0), TIP, strict=True)):
        sensors = (replace(force, name="hammer"), *tip_accelerometers(0.001))
        cell = HammerCell(
            default_structure(),
            directions=[place],
            taps=3,
            spacing=2.5,
            sample_rate=2048.0,
            sensors=sensors,
            seed=number,
        )
        record(cell, folder / f"tap_{place[-1].lower()}.h5")
