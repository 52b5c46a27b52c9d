"""The demonstration's trap: a cut that averaged coefficients call stable and that doubles its period."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from millfrf.cutting import MillingProcess, immersion_angles, write_cutting_process
from millfrf.stability import StabilityLobes, certified_lobes, write_lobes, zero_order
from modal_fit import ModalModel
from replay_data import Settling, settle

from ..progress import Progress, silent
from ..provenance import made
from ..report import ReportOptions, write_report
from ..tables import Table

RPM = math.pi / 30
SPEED_RPM, RADIAL_SHARE = 1080.0, 0.1
"""Spindle speed, and radial depth over the cutter's diameter, of the cut that is tried."""

AXIS_RPM = np.linspace(960.0, 1200.0, 13)
MAX_DEPTH = 10e-3

BELOW = 0.9
"""Share of the certified limit at which the cut must settle."""


@dataclass(frozen=True)
class Trap:
    """A cut that zero-order calls stable, and its course in time on the true robot.

    Parameters
    ----------
    averaged, certified, true
        Limits at one speed: zero-order and certified ones of the identified model, certified ones of the truth.
    below, between
        Depths that were simulated, m: under the certified limit, and between it and the zero-order limit.
    settled, chattered
        What became of them.
    """

    averaged: StabilityLobes
    certified: StabilityLobes
    true: StabilityLobes
    below: float
    between: float
    settled: Settling
    chattered: Settling


def low_immersion(cutter: MillingProcess) -> MillingProcess:
    """The cutter down-milling a tenth of its diameter."""
    start, leave = immersion_angles("down", RADIAL_SHARE * cutter.diameter, cutter.diameter)
    return replace(cutter, start_angle=start, exit_angle=leave)


def spring_trap(identified: ModalModel, true: ModalModel, cutter: MillingProcess) -> Trap:
    """Ask both solvers for the limit, and simulate the true robot below and between."""
    cut, speed = low_immersion(cutter), np.array([SPEED_RPM * RPM])
    averaged = zero_order(identified, cut, speed, MAX_DEPTH)
    certified = certified_lobes(identified, cut, speed, MAX_DEPTH)
    limits = float(certified.depth_limits[0]), float(averaged.depth_limits[0])
    below, between = BELOW * limits[0], math.sqrt(limits[0] * limits[1])
    runs = [settle(true, cut, depth, SPEED_RPM * RPM) for depth in (below, between)]
    return Trap(averaged, certified, certified_lobes(true, cut, speed, MAX_DEPTH), below, between, runs[0], runs[1])


def report_trap(folder: Path, identified: ModalModel, cutter: MillingProcess, progress: Progress = silent) -> Path:
    """Zero-order lobes of the cut as somebody may hand them in, and the report that is not taken in by them."""
    cut, report = low_immersion(cutter), folder / "report_low_immersion.html"
    write_cutting_process(folder / "cut_low_immersion.toml", cut)
    lobes = folder / "lobes_low_immersion_zero_order.csv"
    made_of = made("lobes", [folder / "model_tip.json", folder / "cut_low_immersion.toml"], {"method": "zero-order"})
    write_lobes(lobes, zero_order(identified, cut, AXIS_RPM * RPM, MAX_DEPTH), provenance=made_of)
    files = [folder / "model_tip.json", folder / "cut_low_immersion.toml", lobes]
    write_report(report, files, ReportOptions("A cut for which averaged coefficients are unsafe"), progress)
    return report


def trap_table(trap: Trap) -> Table:
    """One line for each limit and for each simulation."""
    rows = (
        ("zero-order limit, milled model", _mm(trap.averaged.depth_limits[0]), "averaged coefficients"),
        ("certified limit, milled model", _mm(trap.certified.depth_limits[0]), _kind(trap.certified)),
        ("certified limit, truth", _mm(trap.true.depth_limits[0]), _kind(trap.true)),
        ("true robot simulated below it", _mm(trap.below), _ran(trap.settled)),
        ("true robot simulated between them", _mm(trap.between), _ran(trap.chattered)),
    )
    title = f"A cut that zero-order calls stable: down-milling, {RADIAL_SHARE:g} of the diameter, {SPEED_RPM:.0f} rpm"
    return Table(title, ("what", "depth (mm)", "how it ends"), rows)


def _mm(depth: float) -> str:
    return f"{1e3 * depth:.3f}"


def _kind(lobes: StabilityLobes) -> str:
    return f"{lobes.bifurcations[0]}, {lobes.status[0]}"


def _ran(run: Settling) -> str:
    if run.verdict == "decays":
        return f"settles: {100 * run.share:.2g} % left after {run.turns:.0f} turns"
    grown = "chatters" if run.verdict == "grows" else "does not settle"
    return f"{grown}: {100 * run.share:.3g} % of the first deviation after {run.turns:.0f} turns"
