"""A tap test in X and in Y with one accelerometer, from two recordings to depth limits in three steps.

Run it: `python examples/tip_taps.py [PICTURE.png]`. The simulated robot is tapped four times in each direction; its
cross terms are not measured. The limits are drawn beside those of the whole structure, cross terms included.
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from acquisition import record
from estimation import Frf, to_receptance
from millfrf.core import TIP
from millfrf.stability import (
    CONFIDENCE,
    DRIFT,
    RecommendedCut,
    StabilityLobes,
    certified_cut,
    certified_lobes,
    cross_term_effect,
    depth_errors,
)
from millfrf.steps.fit import fit
from millfrf.steps.lobes import lobes
from millfrf.steps.tap import tap
from modal_fit import ModalModel
from replay_data import ACETAL_CUTTER, HammerCell, default_structure, dynamometer, select, tip_accelerometers

BAND, SPEEDS, DEEPEST = (8.0, 120.0), (300.0, 1800.0, 120), 0.012
CUT = replace(ACETAL_CUTTER, kac=0.0)


def recordings(folder: Path) -> list[Path]:
    """Return ``x.h5`` and ``y.h5``: four taps each in one direction, with the accelerometer along it."""
    paths = []
    for axis in range(2):
        sensors = (dynamometer(0.001, 2000.0)[axis], tip_accelerometers(0.001)[axis])
        cell = HammerCell(
            default_structure(),
            directions=[TIP[axis]],
            taps=4,
            spacing=4.0,
            sample_rate=1024.0,
            sensors=sensors,
            seed=axis,
        )
        paths.append(folder / f"{'xy'[axis]}.h5")
        record(cell, paths[-1])
    return paths


def draw_frf(axes: Axes, frf: Frf, model: ModalModel) -> None:
    """Draw the direct terms, measured and fitted."""
    measured = to_receptance(frf)
    inside = measured.valid & (frf.frequencies >= BAND[0]) & (frf.frequencies <= BAND[1])
    lines = frf.frequencies[inside]
    for entry, colour in ((0, "C0"), (1, "C1")):
        axes.semilogy(lines, np.abs(measured.values[inside, entry, entry]), ".", ms=3, color=colour)
        fitted = np.abs(model.receptance(lines)[:, entry, entry])
        axes.semilogy(lines, fitted, color=colour, lw=1, label=f"{'XY'[entry]} / {'XY'[entry]}: taps and fit")
    axes.set(xlabel="frequency (Hz)", ylabel="receptance (m/N)", xlim=BAND)
    axes.legend(frameon=False, fontsize=8)


def advise(model: ModalModel, from_taps: StabilityLobes) -> RecommendedCut:
    """Return the cut that a report recommends: errors of the fit and cross terms, which nothing shows, are deducted."""
    errors = depth_errors(model, CUT, from_taps)
    return certified_cut(model, CUT, from_taps, errors, confidence=CONFIDENCE, drift=DRIFT, max_depth=DEEPEST)


def draw_limits(axes: Axes, from_taps: StabilityLobes, true: StabilityLobes, cut: RecommendedCut) -> None:
    """Draw limits of the direct terms, those of the structure with its cross terms, and the recommended cut."""
    rpm = from_taps.spindle_speeds_rpm
    for limits, style, label in ((from_taps, "C0-", "from the taps"), (true, "k--", "truth, with cross terms")):
        depth = np.where(np.isfinite(limits.depth_limits), limits.depth_limits, np.nan)
        axes.plot(rpm, 1e3 * depth, style, lw=1.2, label=label)
    axes.plot(cut.spindle_speed * 30 / np.pi, 1e3 * cut.depth, "C2o", label="recommended cut")
    axes.set(xlabel="spindle speed (rpm)", ylabel="depth limit (mm)", ylim=(0, 1e3 * DEEPEST))
    axes.legend(frameon=False, fontsize=8)


def main(picture: Path) -> None:
    """Tap, fit, compute limits, draw them, and print what the missing cross terms change."""
    with tempfile.TemporaryDirectory() as folder:
        frf = tap(*recordings(Path(folder))).frf
    model = fit(frf, band=BAND).model
    from_taps = lobes(model, CUT, speeds=SPEEDS, max_depth=DEEPEST)
    structure = select(default_structure(), TIP[:2], TIP[:2])
    true = certified_lobes(structure, CUT, from_taps.spindle_speeds, DEEPEST)
    cut = advise(model, from_taps)
    figure = Figure(figsize=(9, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    draw_frf(left, frf, model)
    draw_limits(right, from_taps, true, cut)
    figure.savefig(picture, dpi=150)
    print(f"not measured: {model.unmeasured}")
    effect = cross_term_effect(model, CUT, from_taps.spindle_speeds, DEEPEST)
    assert effect is not None
    print(f"{effect.share:.0%} of cross terms: limits {-effect.lowered:.1%} to {effect.raised:+.1%}")
    known = np.isfinite(from_taps.depth_limits) & np.isfinite(true.depth_limits)
    off = from_taps.depth_limits[known] / true.depth_limits[known] - 1
    verified = sum(word == "verified" for word in from_taps.status)
    limit = certified_lobes(structure, CUT, np.array([cut.spindle_speed]), DEEPEST).depth_limits[0]
    rpm = cut.spindle_speed * 30 / np.pi
    print(f"recommended: {1e3 * cut.depth:.2f} mm at {rpm:.0f} rpm, where the true limit is {1e3 * limit:.2f} mm")
    print(f"limits off by {off.min():.1%} to {off.max():+.1%} of the truth with cross terms; {verified} are verified")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("tip_taps.png"))
