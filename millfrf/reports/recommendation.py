"""Recommended cut of a report: from certified limits less their errors, then simulated in time."""

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

CONFIDENCE = 0.95  # probability of stability of the recommended cut
DRIFT = 0.02  # relative drift of the spindle speed


@dataclass(frozen=True)
class Recommendation:
    """The cut that a report recommends, with sentences for its section and warnings for the head of the page."""

    band: LimitBand | None = None  # 95 % interval of the limits; None: their errors are not known
    cut: RecommendedCut | None = None
    sentences: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def recommendation(checked: CheckedLobes) -> Recommendation:
    """Compute band and recommended cut of lobes whose structure and milling process are known."""
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
    settled, runs = _simulate(structure, process, cut)
    if settled is None:
        text = f"The recommended cut is withdrawn: the limits allow {_cut(cut)}, but in simulation {_result(runs[-1])}."
        return Recommendation(band, None, (text,), (text,))
    sentences = [_recommended(settled, name, checked), *_simulated(settled, cut, runs), *_left_out(known, lobes)]
    # so close to the largest depth, that depth ended the search and not a limit
    if settled.depth >= 0.999 * deepest:
        sentences.append(
            f"There is no limit up to the largest depth examined, {1e3 * deepest:g} mm; the cutter limits the depth."
        )
    warnings = _outside_band(structure, process, settled, name)
    return Recommendation(band, settled, tuple(sentences), warnings)


def _left_out(known: StabilityLobes, lobes: StabilityLobes) -> list[str]:
    """Describe the speeds at which the limits depend on dynamics outside the measured band."""
    count = int(np.isnan(known.depth_limits).sum() - np.isnan(lobes.depth_limits).sum())
    if not count:
        return []
    return [
        f"{count} of {len(lobes.spindle_speeds)} speeds are excluded from this choice: the chatter frequency or the "
        "tooth passing lies outside the band in which the structure was measured."
    ]


def simulable(model: ModalModel, process: MillingProcess) -> ModalModel:
    """Reduce a model to X, Y, Z of the tool for the simulated cut; keep its modes and its residual flexibility."""
    system = delay_system(model, process)
    residuals = Residuals(system.upper, np.zeros((3, 3))) if system.upper.any() else None
    return ModalModel(system.poles, system.right, system.left, TIP, TIP, residuals=residuals)


def _simulate(
    structure: ModalModel | Frf, process: MillingProcess, cut: RecommendedCut
) -> tuple[RecommendedCut | None, list[Settling]]:
    """Simulate a cut at decreasing depths until it is stable; return this cut or None, and the simulations."""
    if not isinstance(structure, ModalModel) or not process.is_plain or not process.feed_per_tooth > 0:
        return cut, []
    model, runs = simulable(structure, process), []
    for _ in range(4):
        runs.append(settle(model, process, cut.depth, cut.spindle_speed))
        if runs[-1].verdict == "decays":
            return cut, runs
        cut = lowered(cut, 0.9)
    return None, runs


def _cut(cut: RecommendedCut) -> str:
    return f"{1e3 * cut.depth:.2f} mm at {cut.spindle_speed * 30 / math.pi:.0f} rpm"


def _result(run: Settling) -> str:
    if run.verdict == "decays":
        return f"the deviation from a steady cut decays to {100 * run.share:.2g} % in {run.turns:.0f} turns"
    trend = "grows or stays" if run.verdict == "grows" else "has not settled"
    share = f"{100 * run.share:.2g} % of its first size after {run.turns:.0f} turns"
    return f"the deviation from a steady cut {trend}: {share}"


def _recommended(cut: RecommendedCut, name: str, checked: CheckedLobes) -> str:
    basis = f"certified limits of {name} less their errors, lowest within the drift"
    if cut.draws:
        basis += f", checked with {cut.draws} structures and coefficients drawn from their errors"
    known = (
        "with the errors of the cutting coefficients"
        if checked.process is not None and any(checked.process.coefficient_errors)
        else "the cutting file gives no errors of the coefficients (ktc_std_pa, krc_std, kac_std): not included"
    )
    return (
        f"{checked.file.path.name}: largest removal rate at {100 * CONFIDENCE:.0f} % confidence of stability, with "
        f"a speed drift of {100 * DRIFT:.0f} %: {_cut(cut)} ({basis}; {known})."
    )


def _simulated(cut: RecommendedCut, first: RecommendedCut, runs: list[Settling]) -> list[str]:
    if not runs:
        return ["This cut was not simulated in time: this requires a modal model, a plain cutter and a feed."]
    sentences = [f"Simulation of this cut: {_result(runs[-1])}."]
    if len(runs) > 1:
        sentences.insert(
            0, f"At the {_cut(first)} that the limits allow, {_result(runs[0])}; so the depth was lowered."
        )
    return sentences


def _outside_band(
    structure: ModalModel | Frf, process: MillingProcess, cut: RecommendedCut, name: str
) -> tuple[str, ...]:
    """Return a warning if the depth limit at the speed of the cut depends on dynamics outside the measured band."""
    lobes = certified_lobes(structure, process, np.array([cut.spindle_speed]), 3 * cut.depth)
    texts = check_band_of_lobes(structure, lobes, process)
    return tuple(f"recommended cut, {name}: {text}; the confidence does not include that error" for text in texts)
