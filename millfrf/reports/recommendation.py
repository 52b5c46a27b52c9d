"""The recommended cut of a report: from certified limits less their errors, then tried by simulation in time."""

import math
from dataclasses import dataclass

import numpy as np

from estimation import Frf
from millfrf.core import TIP, InputError
from millfrf.cutting import MillingProcess
from millfrf.gate import check_band_of_lobes, limits_inside_band
from millfrf.stability import (
    LimitBand,
    RecommendedCut,
    StabilityLobes,
    certified_cut,
    certified_lobes,
    delay_system,
    depth_errors,
    limit_band,
    lowered,
)
from modal_fit import ModalModel, Residuals
from replay_data import Settling, settle

from .lobes_check import CheckedLobes

CONFIDENCE, DRIFT = 0.95, 0.02
"""Probability of stability, and relative drift of the spindle's speed, of the recommended cut."""

LESS, TIMES = 0.9, 4
"""Share to which a cut that does not settle is lowered, and how often."""


NO_LIMIT = 0.999
"""Share of the largest depth from which it was that depth that ended the search, and no limit."""


@dataclass(frozen=True)
class Recommendation:
    """The cut that a report recommends, and the reasons.

    Parameters
    ----------
    band
        95 % interval of the limits; None where nothing is known of their errors.
    cut
        The recommended one; None where there is none.
    sentences
        Sentences for the section on stability.
    warnings
        Warnings for the head of the page.
    """

    band: LimitBand | None = None
    cut: RecommendedCut | None = None
    sentences: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def recommendation(checked: CheckedLobes) -> Recommendation:
    """Band and recommended cut of lobes whose structure and cut are known."""
    if checked.structure is None or checked.process is None or checked.certified is None:
        return Recommendation()
    file, structure = checked.structure
    name, process, lobes, deepest = file.path.name, checked.process, checked.certified, checked.max_depth
    try:
        errors = depth_errors(structure, process, lobes)
        band = limit_band(structure, process, lobes, 1.5 * deepest)
    except InputError as error:
        return Recommendation(sentences=(f"No band and no recommended cut: {error}.",))
    known = limits_inside_band(structure, lobes, process)
    try:
        cut = certified_cut(structure, process, known, errors, confidence=CONFIDENCE, drift=DRIFT, max_depth=deepest)
    except InputError as error:
        return Recommendation(band, None, (f"No recommended cut: {error}.", *_left_out(known, lobes)))
    tried, runs = _tried(structure, process, cut)
    if tried is None:
        told = f"The recommended cut is withdrawn: the limits allow {_cut(cut)}, but simulated {_ran(runs[-1])}."
        return Recommendation(band, None, (told,), (told,))
    sentences = [_recommended(tried, name, checked), *_simulated(tried, cut, runs), *_left_out(known, lobes)]
    if tried.depth >= NO_LIMIT * deepest:
        sentences.append(f"No limit was met up to the {1e3 * deepest:g} mm that were looked at; the cutter decides.")
    warnings = _outside_band(structure, process, tried, name)
    return Recommendation(band, tried, tuple(sentences), warnings)


def _left_out(known: StabilityLobes, lobes: StabilityLobes) -> list[str]:
    """What is said of speeds at which the limits do not rest on what was measured."""
    count = int(np.isnan(known.depth_limits).sum() - np.isnan(lobes.depth_limits).sum())
    if not count:
        return []
    return [
        f"{count} of {len(lobes.spindle_speeds)} speeds are left out of this choice: chatter, or the passing of the "
        "teeth, lies outside the band in which the structure was measured, and nothing is known there."
    ]


def simulable(model: ModalModel, process: MillingProcess) -> ModalModel:
    """The model at the tool's X, Y, Z as the simulated cut takes it: modes, and a flexibility where there is one."""
    system = delay_system(model, process)
    residuals = Residuals(system.upper, np.zeros((3, 3))) if system.upper.any() else None
    return ModalModel(system.poles, system.right, system.left, TIP, TIP, residuals=residuals)


def _tried(
    structure: ModalModel | Frf, process: MillingProcess, cut: RecommendedCut
) -> tuple[RecommendedCut | None, list[Settling]]:
    """The cut at a depth at which it settles, and each simulation; None where it does not at any depth tried."""
    if not isinstance(structure, ModalModel) or not process.is_plain or not process.feed_per_tooth > 0:
        return cut, []
    model, runs = simulable(structure, process), []
    for _ in range(TIMES):
        runs.append(settle(model, process, cut.depth, cut.spindle_speed))
        if runs[-1].verdict == "decays":
            return cut, runs
        cut = lowered(cut, LESS)
    return None, runs


def _cut(cut: RecommendedCut) -> str:
    return f"{1e3 * cut.depth:.2f} mm at {cut.spindle_speed * 30 / math.pi:.0f} rpm"


def _ran(run: Settling) -> str:
    if run.verdict == "decays":
        return f"the deviation from a steady cut decays to {100 * run.share:.2g} % in {run.turns:.0f} turns"
    does = "grows or stays" if run.verdict == "grows" else "has not settled"
    return (
        f"the deviation from a steady cut {does}: {100 * run.share:.2g} % of its first size after {run.turns:.0f} turns"
    )


def _recommended(cut: RecommendedCut, name: str, checked: CheckedLobes) -> str:
    basis = f"certified limits of {name} less their errors, computed inside the drift"
    if cut.draws:
        basis += f", tried with {cut.draws} structures and coefficients drawn from their errors"
    known = (
        "with the errors of the cutting coefficients"
        if checked.process is not None and any(checked.process.coefficient_errors)
        else "the cutting file gives no errors of the coefficients (ktc_std_pa, krc_std, kac_std): they are not in it"
    )
    return (
        f"{checked.file.path.name}: most material at {100 * CONFIDENCE:.0f} % confidence of stability, the speed "
        f"drifting by {100 * DRIFT:.0f} %: {_cut(cut)} ({basis}; {known})."
    )


def _simulated(cut: RecommendedCut, first: RecommendedCut, runs: list[Settling]) -> list[str]:
    if not runs:
        return ["This cut was not simulated in time: that needs a modal model, a plain cutter and a feed."]
    told = [f"Simulated at this cut: {_ran(runs[-1])}."]
    if len(runs) > 1:
        told.insert(0, f"At the {_cut(first)} that the limits allow, {_ran(runs[0])}; so the depth was lowered.")
    return told


def _outside_band(
    structure: ModalModel | Frf, process: MillingProcess, cut: RecommendedCut, name: str
) -> tuple[str, ...]:
    """Warnings where what decides at the cut's speed lies outside the band in which the structure is known."""
    lobes = certified_lobes(structure, process, np.array([cut.spindle_speed]), 3 * cut.depth)
    doubts = check_band_of_lobes(structure, lobes, process)
    return tuple(f"recommended cut, {name}: {doubt}; that error is not in the confidence" for doubt in doubts)
