"""The whole chain on a simulated robot, compared with the true values."""

import math
import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from acquisition import Source, record
from estimation import Frf
from millfrf.core import writing_whole_file, writing_whole_folder
from millfrf.core.progress import progress
from millfrf.core.provenance import made
from millfrf.core.terminal import Table, note, silently
from millfrf.cutting import MillingProcess, immersion_angles, write_cutting_process
from millfrf.figures import lobes_figure
from millfrf.reports.page import ReportOptions, write_report
from millfrf.stability import StabilityLobes, certified_lobes, read_lobes, write_lobes, zero_order
from millfrf.steps.calibrate import calibrate
from millfrf.steps.estimate import estimate
from millfrf.steps.fit import fit
from millfrf.steps.lobes import compute_lobes, speed_axis
from millfrf.steps.recording.simulated_device import SWEEP_DEPTH, SWEEP_RPM, SWEEP_SECONDS
from modal_fit import ModalModel, write_modal_model
from replay_data import (
    ACETAL_CUTTER,
    SWEEP_IMMERSIONS,
    HammerCell,
    LinearSweep,
    MillingCell,
    Settling,
    default_structure,
    hammer_sensors,
    milling_sensors,
    settle,
    tip_model,
)

RPM = math.pi / 30
# spindle speed, and radial depth over cutter diameter, of the low-immersion cut
SPEED_RPM, RADIAL_SHARE = 1080.0, 0.1
DEMO_TRAP_AXIS_RPM = np.linspace(960.0, 1200.0, 13)
MAX_DEPTH = 10e-3
BELOW = 0.9  # share of the certified limit at which the simulated cut must be stable


@dataclass(frozen=True)
class Trap:
    """A cut that is stable by the zero-order method, and its simulation on the true robot."""

    averaged: StabilityLobes  # zero-order limit of the identified model
    certified: StabilityLobes  # certified limit of the identified model
    true: StabilityLobes  # certified limit of the true model
    below: float  # m; simulated depth below the certified limit
    between: float  # m; simulated depth between certified and zero-order limit
    settled: Settling  # simulation below
    chattered: Settling  # simulation between


def low_immersion(cutter: MillingProcess) -> MillingProcess:
    """Return the process for down-milling of a tenth of the diameter."""
    start, leave = immersion_angles("down", RADIAL_SHARE * cutter.diameter, cutter.diameter)
    return replace(cutter, start_angle=start, exit_angle=leave)


def spring_trap(identified: ModalModel, true: ModalModel, cutter: MillingProcess) -> Trap:
    """Compute the limit with both methods; simulate the true robot below the lower limit and between both limits."""
    cut, speed = low_immersion(cutter), np.array([SPEED_RPM * RPM])
    averaged = zero_order(identified, cut, speed, MAX_DEPTH)
    certified = certified_lobes(identified, cut, speed, MAX_DEPTH)
    limits = float(certified.depth_limits[0]), float(averaged.depth_limits[0])
    below, between = BELOW * limits[0], math.sqrt(limits[0] * limits[1])
    runs = [settle(true, cut, depth, SPEED_RPM * RPM) for depth in (below, between)]
    return Trap(averaged, certified, certified_lobes(true, cut, speed, MAX_DEPTH), below, between, runs[0], runs[1])


def report_trap(folder: Path, identified: ModalModel, cutter: MillingProcess) -> Path:
    """Write the zero-order lobes of the cut, and the report that warns of these lobes."""
    cut, report = low_immersion(cutter), folder / "report_low_immersion.html"
    write_cutting_process(folder / "cut_low_immersion.toml", cut)
    lobes = folder / "lobes_low_immersion_zero_order.csv"
    made_of = made("lobes", [folder / "model_tip.json", folder / "cut_low_immersion.toml"], {"method": "zero-order"})
    write_lobes(lobes, zero_order(identified, cut, DEMO_TRAP_AXIS_RPM * RPM, MAX_DEPTH), provenance=made_of)
    files = [folder / "model_tip.json", folder / "cut_low_immersion.toml", lobes]
    write_report(report, files, ReportOptions("A cut for which averaged coefficients are unsafe"))
    return report


def trap_table(trap: Trap) -> Table:
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


KEPT_BAND = (5.0, 60.0)  # Hz, of the FRF file
# Hz; from the lowest tooth-passing frequency to its highest excited sixth harmonic. Limits depend on these harmonics: a
# fit of 15 to 23 Hz with the two close modes alone gives limits at 1200 rpm that are 12 to 16 % too low.
FIT_BAND = (15.2, 59.0)
SUBSPACE_BAND = (13.0, 60.0)  # Hz; records need no force on every line
COMPARED_RPM = (800, 900, 1200, 1600, 2000)
# files of the structures whose lobes are drawn
STRUCTURES = {"identified": "model_tip.json", "hammer": "frf_hammer_tip.h5", "true": "true_model_tip.json"}
# fewer speeds for an FRF, which takes longer
WHOLE_CHAIN_AXIS_RPM = {"identified": (600, 2400, 91), "hammer": (600, 2400, 19), "true": (600, 2400, 91)}
REPORT = "report.html"


@dataclass(frozen=True)
class DemoOptions:
    """Options of the demonstration."""

    out: Path  # folder of the files; created if missing
    noise: float = 0.01  # relative noise of every sensor
    seed: int = 0  # of noise and taps
    seconds: float = SWEEP_SECONDS  # s, of each sweep


@dataclass(frozen=True)
class DemoResult:
    """Results of the chain and true values."""

    identified: ModalModel  # at the tool tip
    true: ModalModel  # at the tool tip
    # certified lobes of ``identified``, ``hammer`` and ``true``, at :data:`COMPARED_RPM`
    lobes: dict[str, StabilityLobes]
    trap: Trap  # a cut with an unsafe zero-order limit
    report: Path  # HTML page
    seconds: float  # s; wall-clock time of the run


def run_demo(options: DemoOptions) -> DemoResult:
    started = time.perf_counter()
    with writing_whole_folder(options.out) as folder:
        identified, true, limits, trap = _run(folder, options)
    return DemoResult(identified, true, limits, trap, options.out / REPORT, time.perf_counter() - started)


def _run(folder: Path, options: DemoOptions) -> tuple[ModalModel, ModalModel, dict[str, StabilityLobes], Trap]:
    """Write all files of the demonstration; return both models at the tip, the limits and the low-immersion cut."""
    note(f"milling three {options.seconds:g} s speed sweeps, {SWEEP_RPM[0]:g} to {SWEEP_RPM[1]:g} rpm, and tapping ...")
    sweeps, hammer = _record_all(folder, options)
    note("estimating frequency response functions ...")
    with silently():
        estimate(*sweeps, band=KEPT_BAND, out=folder / "frf_in_process.h5")
        taps = partial(estimate, *hammer, segment=4.0, overlap=0.0, window="boxcar", band=(1.0, 200.0))
        tip = taps(responses=("tip_ax", "tip_ay", "tip_az"), out=folder / "frf_hammer_tip.h5").frf
        taps(responses=("ax", "ay", "az"), out=folder / "frf_hammer_housing.h5")
    note("fitting, and calibrating to the tool tip ...")
    identified = _identify(folder, sweeps)
    true = tip_model(default_structure())
    write_modal_model(folder / "true_model_tip.json", true)
    note("drawing lobes and report ...")
    write_cutting_process(folder / "cut.toml", ACETAL_CUTTER)
    structures: dict[str, Frf | ModalModel] = {"identified": identified, "hammer": tip, "true": true}
    for name, structure in structures.items():
        limits_of = compute_lobes(
            structure, ACETAL_CUTTER, speed_axis(*WHOLE_CHAIN_AXIS_RPM[name]), MAX_DEPTH, name=name
        )
        made_of = made("lobes", [folder / STRUCTURES[name], folder / "cut.toml"])
        write_lobes(folder / f"lobes_{name}.csv", limits_of, provenance=made_of)
    compared = np.array(COMPARED_RPM) * RPM
    limits = {
        name: certified_lobes(structure, ACETAL_CUTTER, compared, MAX_DEPTH) for name, structure in structures.items()
    }
    _draw_lobes(folder)
    _report(folder, sweeps)
    note("trying a cut that averaged coefficients call stable ...")
    trap = spring_trap(identified, true, ACETAL_CUTTER)
    report_trap(folder, identified, ACETAL_CUTTER)
    return identified, true, limits, trap


def comparison_tables(result: DemoResult) -> tuple[Table, Table, Table]:
    """Return tables of modes, depth limits and the cut with an unsafe zero-order limit."""
    rows = []
    for r in nearest_modes(result):
        true_frequency, true_zeta = result.true.natural_frequencies[r[0]], 100 * result.true.damping_ratios[r[0]]
        frequency, zeta = result.identified.natural_frequencies[r[1]], 100 * result.identified.damping_ratios[r[1]]
        rows.append(
            (
                str(r[0] + 1),
                f"{true_frequency:.3f}",
                f"{frequency:.3f}",
                f"{100 * (frequency / true_frequency - 1):+.2f} %",
                f"{true_zeta:.3f}",
                f"{zeta:.3f}",
                f"{100 * (zeta / true_zeta - 1):+.1f} %",
            )
        )
    columns = ("mode", "true fn (Hz)", "identified (Hz)", "error", "true zeta (%)", "identified (%)", "error ")
    modes = Table("Modes at the tool tip", columns, tuple(rows))
    true, milled, tapped = (1e3 * result.lobes[name].depth_limits for name in ("true", "identified", "hammer"))
    depths = tuple(
        (
            f"{rpm}",
            _limit(true[k]),
            _limit(milled[k]),
            _error(milled[k], true[k]),
            _limit(tapped[k]),
            _error(tapped[k], true[k]),
        )
        for k, rpm in enumerate(COMPARED_RPM)
    )
    headings = ("speed (rpm)", "true (mm)", "milled (mm)", "error", "tapped FRF (mm)", "error ")
    limits = Table("Depth limits, half-immersion down-milling", headings, depths)
    return modes, limits, trap_table(result.trap)


def _limit(depth: float) -> str:
    """Format a limit in mm, or state that it exceeds the largest depth."""
    return f"{depth:.3f}" if math.isfinite(depth) else f"> {1e3 * MAX_DEPTH:.0f}"


def _error(limit: float, true: float) -> str:
    """Format the relative error of a limit; state ``too low`` or ``too high`` if one of both depths is infinite."""
    if math.isinf(limit) or math.isinf(true):
        return "" if math.isinf(limit) and math.isinf(true) else ("too low" if math.isinf(true) else "too high")
    return f"{100 * (limit / true - 1):+.1f} %"


def nearest_modes(result: DemoResult) -> tuple[tuple[int, int], ...]:
    """Return, for each true mode in the fitted band, the identified mode with the nearest pole."""
    inside = [r for r, f in enumerate(result.true.natural_frequencies) if FIT_BAND[0] < f < FIT_BAND[1]]
    return tuple((r, int(np.argmin(np.abs(result.identified.poles - result.true.poles[r])))) for r in inside)


def _record_all(folder: Path, options: DemoOptions) -> tuple[list[Path], list[Path]]:
    (folder / "recordings").mkdir()
    structure, noise = default_structure(), options.noise
    sweep = LinearSweep(SWEEP_RPM[0] * RPM, SWEEP_RPM[1] * RPM, options.seconds)
    sweeps = []
    for number, (name, (start, exit_)) in enumerate(SWEEP_IMMERSIONS.items()):
        process = replace(ACETAL_CUTTER, start_angle=start * math.pi, exit_angle=exit_ * math.pi)
        cell = MillingCell(
            structure,
            process,
            SWEEP_DEPTH,
            sweep,
            options.seconds,
            sensors=milling_sensors(noise, noise),
            seed=10 * options.seed + number,
        )
        sweeps.append(_record(cell, folder / "recordings" / f"sweep_{name}.h5"))
    cell_of_taps = HammerCell(structure, sensors=hammer_sensors(noise, noise), seed=10 * options.seed + 9)
    return sweeps, [_record(cell_of_taps, folder / "recordings" / "hammer.h5")]


def _record(source: Source, path: Path) -> Path:
    with progress(f"recording {path.stem}", source.n_samples) as update:
        record(source, path, progress=update, provenance=made("demo", []))
    return path


def _identify(folder: Path, sweeps: list[Path]) -> ModalModel:
    """Fit a model to the FRF and a model to the recordings; transfer the model of the recordings to the tip."""
    with silently():
        fit(folder / "frf_in_process.h5", band=FIT_BAND, out=folder / "model_housing_polyreference.json")
        fit(*sweeps, band=SUBSPACE_BAND, out=folder / "model_housing.json")
        model, tip, sensor = (
            folder / f"{name}" for name in ("model_housing.json", "frf_hammer_tip.h5", "frf_hammer_housing.h5")
        )
        return calibrate(model, tip=tip, sensor=sensor, out=folder / "model_tip.json").model


def _draw_lobes(folder: Path) -> None:
    """Draw the depth limits from measured and from true dynamics, as in the README."""
    labels = {"identified": "measured in the cut", "true": "truth"}
    figure = lobes_figure({label: read_lobes(folder / f"lobes_{name}.csv") for name, label in labels.items()})
    with writing_whole_file(folder / "lobes.png") as temporary:
        figure.savefig(temporary, dpi=130, format="png")


def _report(folder: Path, sweeps: list[Path]) -> None:
    names = (
        "frf_in_process.h5",
        "frf_hammer_tip.h5",
        "model_housing.json",
        "model_housing_polyreference.json",
        "model_tip.json",
    )
    tables = ("lobes_identified.csv", "lobes_hammer.csv", "lobes_true.csv", "cut.toml")
    options = ReportOptions(
        "Simulated robot cell: in-process FRF and modal fit", reference=folder / "true_model_tip.json"
    )
    write_report(folder / REPORT, [*sweeps, *(folder / name for name in (*names, *tables))], options)
