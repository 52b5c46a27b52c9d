"""Recommended cut of a report: from certified limits less their errors, then simulated in time."""

import math
from dataclasses import dataclass

import numpy as np

from estimation import Frf
from millfrf.core import TIP, InputError, Real
from millfrf.cutting import MillingProcess
from millfrf.gate import LOWEST_MODE_REMEDY, check_band_of_lobes, highest_needed, returned_power_sentences
from millfrf.stability import (
    CONFIDENCE,
    DRIFT,
    LimitBand,
    RecommendedCut,
    UnmeasuredDynamics,
    certified_cut,
    certified_lobes,
    delay_system,
    depth_errors,
    edge_end_effect,
    largest_unmeasured_part,
    limit_band,
    lowered,
    simulate_cut,
    unmeasured_dynamics,
)
from modal_fit import ModalModel, Residuals
from replay_data import Settling, settle

from .lobes_check import CheckedLobes, known_errors

NO_EFFECT = 0.995  # share of the depth from which modes outside the band are not mentioned
CHANGE_NOT_RESOLVED = (
    "No recommended cut: the diagnosis found a stiffness that changes during its recordings, and the limit at their "
    "beginning or end is not resolved; give lobes at other speeds."
)

LITTLE_LEFT = 0.1  # share of the depth below which the page begins with what was not measured
SMALL_EFFECT = 0.9  # share of the depth from which modes outside the band are not named at the head of the page


@dataclass(frozen=True)
class _SimulatedCut:
    """Result of the simulation of a cut in time."""

    stable: bool
    text: str


@dataclass(frozen=True)
class Recommendation:
    """The cut that a report recommends, with sentences for its section and warnings for the head of the page."""

    band: LimitBand | None = None  # 95 % interval of the limits; None: their errors are not known
    cut: RecommendedCut | None = None
    sentences: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    headline: tuple[str, ...] = ()  # sentences for the head of the page


def recommendation(checked: CheckedLobes) -> Recommendation:
    """Compute band and recommended cut of lobes whose structure and milling process are known."""
    if checked.structure is None or checked.process is None or checked.certified is None:
        return Recommendation()
    file, structure = checked.structure
    name, process, lobes, deepest = file.path.name, checked.process, checked.certified, checked.max_depth
    if returned := returned_power_sentences(structure):
        text = f"No cut is recommended, and no limit is to be trusted: in {name}, {'; '.join(returned)}."
        return _none_recommended(None, text, doubtful=True)
    try:
        errors = depth_errors(structure, process, lobes)
        band = limit_band(structure, process, lobes, 1.5 * deepest)
    except InputError as error:
        return _none_recommended(None, f"No band and no recommended cut: {error}.")
    try:
        cut = certified_cut(structure, process, lobes, errors, confidence=CONFIDENCE, drift=DRIFT, max_depth=deepest)
    except InputError as error:
        reasons = check_band_of_lobes(structure, lobes, process)
        return _none_recommended(band, f"No recommended cut: {'; '.join([str(error), *reasons])}.")
    share = left_by_edge_ends(structure, process, cut, 1.5 * deepest)
    softened = _left_by_change(structure, process, cut, 1.5 * deepest)
    if not softened > 0:
        return _none_recommended(band, CHANGE_NOT_RESOLVED)
    cut = lowered(cut, share * softened)
    if contradiction := _contradicted(checked, process, cut):
        return _none_recommended(band, contradiction, doubtful=True)
    settled, runs = _simulate(structure, process, cut)
    if settled is None:
        text = f"The recommended cut is withdrawn: the limits allow {_cut(cut)}, but in simulation {runs[-1].text}."
        return _none_recommended(band, text, doubtful=True)
    deducted = _deducted(structure, process, settled)
    further = [*_edges_in_words(share), *_change_in_words(softened), *_statement_in_words(structure)]
    sentences = [_recommended(settled, name, checked), *_simulated(cut, runs), *deducted, *further]
    unlimited = []
    # so close to the largest depth, that depth ended the search and not a limit
    if settled.depth >= 0.999 * deepest:
        unlimited = [f"No limit was found up to {shown_depth(deepest)}, the largest depth examined."]
    sentences += unlimited
    large = deducted if settled.unmeasured_share <= SMALL_EFFECT else ()
    headline = (_advised(settled, structure, process), *unlimited, *large, *further)
    return Recommendation(band, settled, tuple(sentences), _coefficient_doubt(process), headline)


def _within_drift(cut: RecommendedCut) -> Real:
    """Return five spindle speeds, rad/s, within the drift of a cut."""
    return np.asarray(cut.spindle_speed * (1 + DRIFT * np.linspace(-1, 1, 5)))


def left_by_edge_ends(
    structure: ModalModel | Frf, process: MillingProcess, cut: RecommendedCut, deepest: float
) -> float:
    """Return the share of the depth that edge forces leave because a vibration moves their ends."""
    effect = edge_end_effect(structure, process, _within_drift(cut), deepest)
    return 1.0 if effect is None else 1.0 - effect.lowered


def _edges_in_words(share: float) -> list[str]:
    if share > NO_EFFECT:
        return []
    return [
        "The chip begins or ends at zero thickness, where a vibration moves the end of the edge force and lowers the "
        f"limit: {100 * (1 - share):.0f} % of the depth are deducted."
    ]


def _left_by_change(structure: ModalModel | Frf, process: MillingProcess, cut: RecommendedCut, deepest: float) -> float:
    """Return the share of the depth that a stiffness leaves which changes during the recordings of a diagnosis.

    It is 0 where a limit at the beginning or the end is not resolved.
    """
    if not (isinstance(structure, ModalModel) and structure.physics):
        return 1.0
    from millfrf.mismatch import structures_in_time  # lazy: few models hold terms of a diagnosis

    ends = structures_in_time(structure)
    if not ends:
        return 1.0
    lobes = [certified_lobes(each, process, _within_drift(cut), deepest) for each in (structure, *ends)]
    own, *others = (float(np.minimum(np.nan_to_num(each.depth_limits, nan=0.0), deepest).min()) for each in lobes)
    return min(1.0, *(limit / own for limit in others)) if own > 0 else 0.0


def _change_in_words(share: float) -> list[str]:
    if share > NO_EFFECT:
        return []
    return [
        "The diagnosis found a stiffness that changes during its recordings: the limit is lowest at their beginning or "
        f"end, and {100 * (1 - share):.0f} % of the depth are deducted."
    ]


def _statement_in_words(structure: ModalModel | Frf) -> list[str]:
    lowest = structure.lowest_mode if isinstance(structure, ModalModel) else None
    if lowest is None:
        return []
    return [f"No mode below {lowest:g} Hz is allowed for, as was stated at the fit; nothing in the report checks this."]


def _none_recommended(band: LimitBand | None, reason: str, *, doubtful: bool = False) -> Recommendation:
    """Recommend no cut; the reason is a warning, too, if it makes the limits doubtful."""
    return Recommendation(band, None, (reason,), (reason,) if doubtful else (), (reason,))


def _deducted(structure: ModalModel | Frf, process: MillingProcess, cut: RecommendedCut) -> list[str]:
    """State what modes outside the measured band take from the depth, and what to measure to know better."""
    unmeasured = unmeasured_dynamics(structure)
    if unmeasured is None or cut.unmeasured_share > NO_EFFECT:
        return []
    low, high = unmeasured.band
    cross = "" if unmeasured.cross_terms is None else " and cross terms that were not measured"
    below = f"; of modes below, inertance up to {unmeasured.inertance:.2g} / kg" if unmeasured.inertance else ""
    text = (
        f"Modes outside the {low:.4g} to {high:.4g} Hz in which the structure was measured (flexibility up to "
        f"{unmeasured.flexibility:.2g} m/N{below}, damping from {100 * unmeasured.damping:g} % on){cross} are "
        f"deducted: they leave {100 * cut.unmeasured_share:.0f} % of the depth."
    )
    if cut.unmeasured_share > SMALL_EFFECT:
        return [text, "To allow a larger depth, hit each direction and measure the other, too."] if cross else [text]
    return [text, *_remedy(structure, process, cut, unmeasured)]


def _remedy(
    structure: ModalModel | Frf, process: MillingProcess, cut: RecommendedCut, unmeasured: UnmeasuredDynamics
) -> list[str]:
    """Name what to measure so that the unmeasured dynamics that take most of the depth take less."""
    depth, passing = cut.depth / cut.unmeasured_share, process.teeth * cut.spindle_speed / (2 * math.pi)
    part, frequency = largest_unmeasured_part(structure, process, unmeasured, cut.spindle_speed, depth)
    better = "hit harder and more often, or record longer"
    each = "hit each direction and measure the other, too"
    if part == "cross":
        return [f"To allow a larger depth, {each}."]
    if part == "several":
        first = f"{each}; {better}" if unmeasured.cross_terms is not None else better
        return [f"No single part of them takes most: to allow a larger depth, {first}."]
    if part == "below":
        return [
            f"Most of it is taken by modes below {unmeasured.band[0]:.4g} Hz, at {frequency:.3g} Hz, which the noise "
            f"of the measurement does not exclude: to allow a larger depth, {better}, and fit from a lower frequency "
            f"on, {LOWEST_MODE_REMEDY}."
        ]
    if part == "inside":
        return [
            f"Most of it is taken by the error of what the fit adds for modes outside the band, at {frequency:.3g} Hz: "
            f"to allow a larger depth, {better}, or fit a band in which the FRF stands out of its noise."
        ]
    needed = highest_needed(passing)
    if needed <= unmeasured.band[1] or process.is_turning:
        return []
    remedy = f"to allow a larger depth, measure up to {needed:.3g} Hz (tap the tip)"
    return [f"The teeth pass at {passing:.4g} Hz: {remedy}."]


def _contradicted(checked: CheckedLobes, process: MillingProcess, cut: RecommendedCut) -> str | None:
    """Return a sentence if the FRF to which the model was fitted has a limit below the depth of the cut."""
    if checked.frf is None:
        return None
    lobes = certified_lobes(checked.frf.frf, process, np.array([cut.spindle_speed]), 1.5 * cut.depth)
    limit = float(lobes.depth_limits[0] + 2 * known_errors(checked.frf.frf, process, lobes)[0])
    if not limit < cut.depth:
        return None
    return (
        f"The recommended cut is withdrawn: the model allows {_cut(cut)}, but {checked.frf.file.path.name}, to which "
        f"it was fitted, has a limit of {shown_depth(float(lobes.depth_limits[0]))} there; the fit misses a mode, "
        "or the FRF errs there: compare both, then fit or measure again."
    )


def simulable(model: ModalModel, process: MillingProcess) -> ModalModel:
    """Reduce a model to X, Y, Z of the tool for the simulated cut; keep its modes and its residual flexibility."""
    system = delay_system(model, process)
    residuals = Residuals(system.upper, np.zeros((3, 3))) if system.upper.any() else None
    return ModalModel(system.poles, system.right, system.left, TIP, TIP, residuals=residuals)


def _simulate(
    structure: ModalModel | Frf, process: MillingProcess, cut: RecommendedCut
) -> tuple[RecommendedCut | None, list[_SimulatedCut]]:
    """Simulate a milling cut at decreasing depths until it is stable; return this cut or None, and the simulations."""
    if not isinstance(structure, ModalModel) or not process.feed_per_tooth > 0 or process.is_turning:
        return cut, []
    runs = list[_SimulatedCut]()
    for _ in range(4):
        try:
            runs.append(_in_time(structure, process, cut))
        except InputError:  # too long to simulate
            return cut, runs
        if runs[-1].stable:
            return cut, runs
        cut = lowered(cut, 0.9)
    return None, runs


def _in_time(model: ModalModel, process: MillingProcess, cut: RecommendedCut) -> _SimulatedCut:
    if process.is_plain:
        run = settle(simulable(model, process), process, cut.depth, cut.spindle_speed)
        return _SimulatedCut(run.verdict == "decays", _result(run))
    simulated = simulate_cut(model, process, cut.spindle_speed, cut.depth)
    return _SimulatedCut(simulated.repeats, simulated.outcome)


def shown_depth(depth: float) -> str:
    """Return a depth (m) in mm with three significant digits, rounded down: a cut at the depth shown is stable, too.

    Examples
    --------
    >>> shown_depth(0.50496e-3), shown_depth(12.0e-3), shown_depth(9.999e-3)
    ('0.504 mm', '12.0 mm', '9.99 mm')
    """
    if not (depth > 0 and math.isfinite(depth)):
        return f"{1e3 * depth:.3g} mm"
    digits = 2 - math.floor(math.log10(1e3 * depth))
    # 12 mm in binary may lie just below 12
    down = math.floor(1e3 * depth * 10.0**digits * (1 + 1e-12)) / 10.0**digits
    return f"{down:.{max(digits, 0)}f} mm"


def _cut(cut: RecommendedCut) -> str:
    return f"{shown_depth(cut.depth)} at {cut.spindle_speed * 30 / math.pi:.0f} rpm"


def _result(run: Settling) -> str:
    if run.verdict == "decays":
        return f"the deviation from a steady cut decays to {100 * run.share:.2g} % in {run.turns:.0f} turns"
    trend = "grows or stays" if run.verdict == "grows" else "has not settled"
    share = f"{100 * run.share:.2g} % of its first size after {run.turns:.0f} turns"
    return f"the deviation from a steady cut {trend}: {share}"


def _advised(cut: RecommendedCut, structure: ModalModel | Frf, process: MillingProcess) -> str:
    unknown = [] if structure.covariance is not None else ["the dynamics"]
    unknown += [] if any(process.coefficient_errors) else ["the cutting coefficients"]
    exact = f", if {' and '.join(unknown)} are exact" if unknown else ""
    first = ""
    if cut.unmeasured_share < LITTLE_LEFT:
        taken = 100 * (1 - cut.unmeasured_share)
        first = f"Measure more before you cut: what was not measured takes {taken:.0f} % of the depth. "
    return (
        f"{first}Cut {shown_depth(cut.depth)} deep at {cut.spindle_speed * 30 / math.pi:.0f} rpm: stable with "
        f"{100 * CONFIDENCE:g} % confidence, also where the speed drifts by {100 * DRIFT:.0f} %{exact}."
    )


def _recommended(cut: RecommendedCut, name: str, checked: CheckedLobes) -> str:
    basis = f"certified limits of {name} less their errors, lowest within the drift"
    if cut.draws:
        basis += f", checked with {cut.draws} draws of structure and coefficients from the errors that they state"
    return (
        f"{checked.file.path.name}: largest removal rate at {100 * CONFIDENCE:g} % confidence of stability, with "
        f"a speed drift of {100 * DRIFT:.0f} %: {_cut(cut)} ({basis})."
    )


def _coefficient_doubt(process: MillingProcess) -> tuple[str, ...]:
    """State that errors of the cutting coefficients are not known; nothing if they are."""
    if any(process.coefficient_errors):
        return ()
    return (
        "the cutting file gives no errors of the coefficients, and the confidence does not include them: add "
        "ktc_std_pa, krc_std and kac_std",
    )


def _simulated(first: RecommendedCut, runs: list[_SimulatedCut]) -> list[str]:
    if not runs:
        return ["This cut was not simulated in time: this requires a modal model, a feed, and not too many steps."]
    sentences = [f"Simulation of this cut: {runs[-1].text}."]
    if len(runs) > 1:
        sentences.insert(0, f"At the {_cut(first)} that the limits allow, {runs[0].text}; so the depth was lowered.")
    return sentences
