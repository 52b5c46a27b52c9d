"""Files of a cell as a shop leaves them: cuts in three immersions, taps at the tip, and the cutting file."""

import json
from dataclasses import replace
from math import pi
from pathlib import Path

import h5py
import numpy as np
from scipy.signal import resample_poly

from .in_time import mill, ring
from .judge import lowest_limit
from .robot_cell import Cell, Cut, Real

RATE = 1024.0  # samples a second of the recorder
FINER = 8  # steps of the simulation in a sample
SECONDS = 60.0  # duration of an identification cut
SHARE = 0.35  # depth of the identification cuts over the lowest limit within them: they are doubled until they ring
TAPS, SPACING = 5, 8.0  # taps in a direction, and the time between them (s)
CONTACT = (2.5e-3, 4e-3)  # s; contact of a hammer with a soft tip
BLOW = (300.0, 900.0)  # N; peak forces
FLOOR = (0.05, 5e-4)  # rms of the noise of a force (N) and an acceleration (m/s^2) without any signal

Column = tuple[str, str, str, str, str]
"""Name, quantity, unit, node and direction of a channel."""


def write_cell(cell: Cell, folder: Path, seed: int) -> float:
    """Write the recordings, taps and cutting file of a cell; return the depth of the identification cuts, m."""
    rng = np.random.default_rng([seed, 77])
    depth = _write_sweeps(cell, folder, rng)
    for direction in cell.tapped:
        _write_taps(cell, direction, folder / f"hit_{direction.lower()}.h5", rng)
    (folder / "cut.toml").write_text(cutting_text(cell.stated, cell.coefficient_error), encoding="utf-8")
    return depth


def immersions(cell: Cell) -> dict[str, Cut]:
    """Cuts of the three identification cuts, by name."""
    width = cell.widths
    arcs = {"central": (pi / 2 - width / 2, pi / 2 + width / 2), "down": (pi - width, pi), "up": (0.0, width)}
    return {name: replace(cell.cut, start=start, leave=leave) for name, (start, leave) in arcs.items()}


def _write_sweeps(cell: Cell, folder: Path, rng: np.random.Generator) -> float:
    """Mill in three immersions while the tooth passing sweeps, at a share of the lowest limit on the way."""
    passing = np.geomspace(*cell.sweep, 6)
    cuts = immersions(cell)
    limits = [
        lowest_limit(cell.in_cut, cut, 2 * pi * frequency / cut.teeth, 0.02)
        for cut in cuts.values()
        for frequency in passing
    ]
    depth = SHARE * min([*limits, 0.02])
    step = 1 / (RATE * FINER)
    t = step * np.arange(round(SECONDS * RATE * FINER))
    begin, end = (2 * pi * frequency / cell.cut.teeth for frequency in cell.sweep)
    turning = begin * t + (end - begin) * t**2 / (2 * SECONDS)
    columns = [(f"f{d}", "force", "N", "TCP", f"+{d.upper()}") for d in "xyz"]
    columns += [(f"a{d}", "acceleration", "m/s^2", "HOUSING", f"+{d.upper()}") for d in "xyz"]
    for name, cut in cuts.items():
        factors = 1 + cell.uneven * rng.standard_normal(997)
        depths = depth * np.minimum(1.0, t / 0.5)
        force, acceleration, _ = mill(cell.in_cut, cut, depths, turning, step, factors)
        _write(folder / f"cut_{name}.h5", RATE, _sensed([force, acceleration], cell.noise, rng), columns)
    return depth


def _write_taps(cell: Cell, direction: str, path: Path, rng: np.random.Generator) -> None:
    """Tap the tip of the robot at rest; record the hammer, and tip and housing in three directions."""
    rate = 2 * RATE
    step = 1 / (rate * FINER)
    force = np.zeros((round(TAPS * SPACING / step), 3))
    for k in range(TAPS):
        contact, begin = rng.uniform(*CONTACT), (k * SPACING + rng.uniform(0.9, 1.1)) / step
        n = round(contact / step)
        at = round(begin) + np.arange(n)
        force[at, "XYZ".index(direction)] += rng.uniform(*BLOW) * np.sin(pi * (np.arange(n) + 0.5) / n)
    tip, housing = ring(cell.at_rest, force, step)
    hammer = force[:, ["XYZ".index(direction)]]
    columns = [("hammer", "force", "N", "TCP", f"+{direction}")]
    columns += [(f"tip_{d}", "acceleration", "m/s^2", "TCP", f"+{d.upper()}") for d in "xyz"]
    columns += [(f"housing_{d}", "acceleration", "m/s^2", "HOUSING", f"+{d.upper()}") for d in "xyz"]
    _write(path, rate, _sensed([hammer, tip, housing], cell.noise, rng), columns)


def _sensed(signals: list[Real], noise: float, rng: np.random.Generator) -> Real:
    """Signals behind the recorder's filter, with white noise; the first is the force."""
    samples = []
    for number, signal in enumerate(signals):
        recorded = resample_poly(signal, 1, FINER, axis=0)
        level = np.maximum(noise * recorded.std(axis=0), FLOOR[min(number, 1)])
        samples.append(recorded + level * rng.standard_normal(recorded.shape))
    return np.hstack(samples)


def _write(path: Path, rate: float, samples: Real, columns: list[Column]) -> None:
    """Write a recording as docs/conventions.md describes."""
    keys = ("name", "quantity", "unit", "node", "direction")
    channels = [dict(zip(keys, column, strict=True)) for column in columns]
    with h5py.File(path, "w") as file:
        file.attrs.update({"format": "millfrf.recording", "format_version": 1, "title": path.stem, "complete": True})
        group = file.create_group("signals/main")
        group.attrs.update({"sample_rate": rate, "start_time": 0.0, "channels": json.dumps(channels)})
        group.create_dataset("samples", data=samples)


def cutting_text(cut: Cut, relative_error: float) -> str:
    """Cutting file with the standard errors of the coefficients."""
    values = {
        "teeth": cut.teeth,
        "diameter_m": cut.diameter,
        "ktc_pa": cut.ktc,
        "krc": cut.krc,
        "kac": cut.kac,
        "start_angle_deg": round(float(np.degrees(cut.start)), 6),
        "exit_angle_deg": round(float(np.degrees(cut.leave)), 6),
        "feed_per_tooth_m": cut.feed,
        "ktc_std_pa": relative_error * cut.ktc,
        "krc_std": relative_error * cut.krc,
        "kac_std": relative_error * cut.kac,
    }
    return "[cutting]\n" + "".join(f"{key} = {value:.12g}\n" for key, value in values.items())
