"""Step ``learn``: a tip model and cutting coefficients brought up to date by cuts in production."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from millfrf.core import InputError, counted, write_csv, write_json, writing_whole_folder
from millfrf.core.progress import progress
from millfrf.core.provenance import add_comment, add_to_json, origin
from millfrf.core.steps import File, Grid, Reads, Typed, Writes, step
from millfrf.core.terminal import Table, plain, say, say_written, show, tell, warn
from millfrf.cutting import MillingProcess, write_cutting_process
from millfrf.gate import (
    FileKind,
    check_depth,
    check_model,
    edge_end_warnings,
    kind_of,
    rigid_directions,
    terms_left_out,
)
from millfrf.reports.recommendation import NO_EFFECT, left_by_edge_ends, shown_depth
from millfrf.stability import (
    CONFIDENCE,
    DRIFT,
    BandedLimits,
    Learned,
    ProductionCut,
    RecommendedCut,
    edge_end_effect,
    learned_cut,
    learned_in_turn,
    learned_limits,
    prior_limits,
    read_cut_table,
    read_judged_cuts,
    with_edge_ends,
)
from modal_fit import ModalModel, write_modal_model

from .diagnose import refuse_file
from .given import CutGiven, ModelGiven, files_among, model_of, process_of
from .lobes import default_speeds, speed_axis
from .settings import RPM, STEPS

EVIDENCE, LIMITS, FIGURE, SUMMARY = ALWAYS = ("evidence.csv", "limits.csv", "lobes.png", "learned.json")
MODEL, CUT = "model.json", "cut.toml"  # written where no cut contradicts the model
FILES = (*ALWAYS, MODEL, CUT)
LIMIT_COLUMNS = (
    "spindle_speed_rpm",
    *(f"{when}_{part}_m" for when in ("before", "after") for part in ("limit", "low", "high")),
)


@dataclass(frozen=True)
class LearnResult:
    """What cuts taught, and the cut that follows.

    Parameters
    ----------
    learned
        The sample of structures, and what each cut changed.
    before, after
        Depth limits before and after, with their bands.
    advice
        Cut with the largest removal rate at 97.5 % confidence; None: none is advised.
    warnings
        Warnings, one sentence each.
    """

    learned: Learned
    before: BandedLimits
    after: BandedLimits
    advice: RecommendedCut | None
    warnings: tuple[str, ...]

    @property
    def model(self) -> ModalModel:
        """The model brought up to date; that of the prior where cuts contradict it."""
        return self.learned.prior.model if self.learned.contradictions else self.learned.updated()[0]

    @property
    def process(self) -> MillingProcess:
        """The cut with coefficients brought up to date; that of the prior where cuts contradict it."""
        return self.learned.prior.process if self.learned.contradictions else self.learned.updated()[1]


@step
def learn(
    model: ModelGiven,
    /,
    *cuts: Annotated[File, Reads("CUTS")],
    cutting: CutGiven,
    depths: Annotated[str | Sequence[float] | None, Typed("M,M,...", str)] = None,
    speeds: Grid | None = None,
    max_depth: Annotated[float, Typed("M")] | None = None,
    out: Annotated[File | None, Writes("DIR", needed=True, files=FILES)] = None,
) -> LearnResult:
    """Bring a tip model and cutting coefficients up to date by verdicts and chatter frequencies of cuts.

    Model and coefficients with their errors are the prior, each cut is data. A cut that contradicts the model learned
    from the others is named; then neither model nor coefficients are written, and no cut is advised. Give all cuts
    since the model was measured each time, with that model: a learned model as the next prior would count cuts twice.

    Parameters
    ----------
    model
        Modal model at the tool tip with its covariance, as fit and calibrate write it.
    cuts
        Tables of cuts (CSV: spindle_speed_rpm, depth_m, verdict, chatter_frequency_hz), or verdicts that chatter wrote,
        in the order in which they were made.
    cutting
        Cutter, engagement and force coefficients with their errors.
    depths : m
        Depth of each cut of the verdicts, in their order; tables state their own.
    speeds : rpm
        Lowest and highest spindle speed of the limits, and their number; without it 40 speeds as in lobes.
    max_depth : m
        Largest axial depth that is searched; without it one diameter of the cutter.
    out
        Folder for the evidence, the limits, their figure, and, without a contradiction, the model and the cut.

    Returns
    -------
    LearnResult
        What each cut changed, limits before and after, and the advised cut.

    Raises
    ------
    InputError
        No cuts, a model or a cut that cannot be used, or cuts that leave too few structures.

    Examples
    --------
    ::

        $ millfrf learn tip.json cuts.csv --cutting cut.toml --out learned
        $ millfrf learn tip.json chatter.json --cutting cut.toml --depths 0.001,0.002 --out learned
    """
    structure, name, stored = model_of(model)
    process, warnings = process_of(cutting)
    if out is not None:
        refuse_file(Path(out))
    given = _read(cuts, depths)
    depth = process.diameter if max_depth is None else max_depth
    axis = (*default_speeds(structure, process)[:2], STEPS.learned_speeds) if speeds is None else speeds
    warnings = [
        *stored, *warnings, *check_model(structure, name), *terms_left_out(structure, name),
        *check_depth(depth, process), *rigid_directions(structure), *_doubts(given, process),
    ]  # fmt: skip
    effect = edge_end_effect(structure, process, speed_axis(*axis), depth)
    warnings += edge_end_warnings(process, effect)
    given = with_edge_ends(structure, process, given, depth)
    result = _learned(structure, process, given, speed_axis(*axis), depth, warnings)
    if out is not None:
        options = {"depths_m": depths, "speeds_rpm": axis, "max_depth_m": depth}
        _write(Path(out), result, origin("learn", files_among(model, cutting, *cuts), options))
    warn(result.warnings)
    tell(lambda: _answer(result))
    show(_evidence_table(result.learned))
    for line in _lines(result):
        say(line)
    if out is not None:
        names = ALWAYS if result.learned.contradictions else FILES
        say_written([Path(out) / each for each in names])
    return result


def _read(paths: Sequence[File], depths: str | Sequence[float] | None) -> list[ProductionCut]:
    """Return the cuts of all files; the depths of verdicts are dealt out in their order."""
    if not paths:
        raise InputError("no cuts given; name a table of cuts, or verdicts that chatter wrote, after the model")
    try:
        left = [float(word) for word in (depths.split(",") if isinstance(depths, str) else depths or ())]
    except ValueError as error:
        raise InputError(f"depths {depths!r} are no numbers; give metres, such as --depths 0.001,0.002") from error
    result: list[ProductionCut] = []
    for path in paths:
        if Path(path).suffix.lower() == ".csv":
            result += read_cut_table(path)
            continue
        if (kind := kind_of(path)) != FileKind.CHATTER:
            raise InputError(f"{path} is a file of {kind}; give a table of cuts, or verdicts that chatter wrote")
        cuts = read_judged_cuts(path, left)
        result, left = [*result, *cuts], left[len(cuts) :]
    if left:
        raise InputError(f"{counted(len(left), 'depth')} more than cuts in the verdicts; tables state their own depths")
    return result


def _doubts(cuts: Sequence[ProductionCut], process: MillingProcess) -> list[str]:
    """Warnings on depths, and on verdicts that are no independent data."""
    doubts = [text for cut in cuts for text in check_depth(cut.depth, process, f"{cut.name}: depth")]
    places = [(round(cut.spindle_speed, 3), cut.depth, cut.immersion) for cut in cuts]
    if repeated := len(places) - len(set(places)):
        doubts.append(
            f"{counted(repeated, 'cut')} at the speed and depth of another: verdicts count as independent, though what "
            "makes one wrong may make the next one wrong, too"
        )
    return doubts


def _learned(
    structure: ModalModel,
    process: MillingProcess,
    cuts: Sequence[ProductionCut],
    speeds: np.ndarray,
    max_depth: float,
    warnings: list[str],
) -> LearnResult:
    with progress("learning from cuts", len(cuts)) as update:
        for learned in learned_in_turn(structure, process, cuts):
            update(len(learned.evidence))
    with progress("limits before and after"):
        before, after = (limits(learned, speeds, max_depth) for limits in (prior_limits, learned_limits))
        try:
            advice, doubts = _advised(learned, after)
        except InputError as error:
            advice, doubts = None, [str(error)]
    texts = (*warnings, *after.lobes.warnings, *learned.contradictions, *doubts)
    return LearnResult(learned, before, after, advice, tuple(dict.fromkeys(texts)))


def _advised(learned: Learned, limits: BandedLimits) -> tuple[RecommendedCut, list[str]]:
    """Return the advised cut less what the moving ends of edge forces take, and a sentence on what they take."""
    cut = learned_cut(learned, limits, confidence=CONFIDENCE, drift=DRIFT)
    share = left_by_edge_ends(*learned.updated(), cut, limits.max_depth)
    if share > NO_EFFECT:
        return cut, []
    text = f"{100 * (1 - share):.0f} % of the advised depth are deducted, as a vibration moves the ends of edge forces"
    return replace(cut, depth=share * cut.depth), [text]


def _write(folder: Path, result: LearnResult, made_of: dict[str, Any]) -> None:
    """Write the folder; of an earlier run no model may remain where now cuts contradict it."""
    from millfrf.figures import learned_figure, save_figure  # matplotlib loads slowly

    learned = result.learned
    if learned.contradictions and any((folder / name).exists() for name in (MODEL, CUT)):
        raise InputError(
            f"{learned.contradictions[0]}; {folder} holds {MODEL} of an earlier run, which cuts now contradict: give "
            "another --out, or delete it"
        )
    stated = {**made_of, "warnings": list(result.warnings)}
    with writing_whole_folder(folder) as unfinished:
        write_csv(unfinished / EVIDENCE, *_evidence_rows(learned), warnings=result.warnings, provenance=made_of)
        write_csv(unfinished / LIMITS, LIMIT_COLUMNS, _limit_rows(result), warnings=result.warnings, provenance=made_of)
        drawn = {"before": result.before} | ({} if learned.contradictions else {"learned": result.after})
        save_figure(learned_figure(drawn, learned.conclusive), unfinished / FIGURE)
        write_json(unfinished / SUMMARY, {"format": "millfrf.learned", "format_version": 1, **plain(_answer(result))})
        add_to_json(unfinished / SUMMARY, stated)
        if not learned.contradictions:
            write_modal_model(unfinished / MODEL, result.model)
            add_to_json(unfinished / MODEL, stated)
            comment = (
                "coefficients learned from cuts with model.json; limits.csv knows how the errors of both are correlated"
            )
            write_cutting_process(unfinished / CUT, result.process, [comment])
            add_comment(unfinished / CUT, stated)


def _evidence_rows(learned: Learned) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    """Headings and rows of the evidence: shifts are in standard errors of the prior."""
    headings = (
        "cut", "spindle_speed_rpm", "depth_m", "verdict", "chatter_frequency_hz", "expected", "expected_by_others",
        "other_line", "effective_draws", *(f"shift of {name}" for name in learned.parameters),
    )  # fmt: skip
    rows: list[tuple[Any, ...]] = [
        (
            each.cut.name, each.cut.spindle_speed / RPM, each.cut.depth, each.cut.verdict, each.cut.frequency,
            each.expected, each.expected_by_others, each.other_line, each.effective, *each.shifts,
        )
        for each in learned.evidence
    ]  # fmt: skip
    return headings, rows


def _limit_rows(result: LearnResult) -> list[tuple[float, ...]]:
    """Limits and bands at each speed; those after a contradiction are left out."""
    before, after = (
        np.array([limits.lobes.depth_limits, limits.band.low, limits.band.high])
        for limits in (result.before, result.after)
    )
    if result.learned.contradictions:
        after = np.full_like(after, np.nan)
    return [tuple(map(float, row)) for row in zip(result.before.lobes.spindle_speeds_rpm, *before, *after, strict=True)]


def _answer(result: LearnResult) -> dict[str, Any]:
    """The result as numbers."""
    learned, advice = result.learned, result.advice
    headings, rows = _evidence_rows(learned)
    return {
        "verdict": learned.verdict,
        "contradictions": list(learned.contradictions),
        "cuts": [dict(zip(headings, row, strict=True)) for row in rows],
        "errors_over_prior": dict(zip(learned.parameters, map(float, learned.narrowed), strict=True)),
        "effective_draws": learned.after.effective,
        "limits": [dict(zip(LIMIT_COLUMNS, row, strict=True)) for row in _limit_rows(result)],
        "advice": None
        if advice is None
        else {
            "spindle_speed_rpm": advice.spindle_speed / RPM,
            "depth_m": advice.depth,
            "confidence": advice.confidence,
            "drift": advice.drift,
        },
    }


def _evidence_table(learned: Learned) -> Table:
    """Each cut with how expected its verdict was, and the parameters that it moved most."""
    rows = []
    for each in learned.evidence:
        moved = np.argsort(-np.abs(np.nan_to_num(each.shifts)))[:2]
        stated = [f"{learned.parameters[k]} {each.shifts[k]:+.1f}" for k in moved if abs(each.shifts[k]) >= 0.1]
        cells = [f"{value:.2g}" if math.isfinite(value) else "" for value in (each.expected, each.expected_by_others)]
        rpm, depth = f"{each.cut.spindle_speed / RPM:.0f}", f"{1e3 * each.cut.depth:.3g}"
        rows.append((each.cut.name, rpm, depth, each.cut.verdict, *cells, ", ".join(stated) or "nothing"))
    columns = ("cut", "rpm", "depth (mm)", "verdict", "expected before", "by the others", "moved (prior errors)")
    return Table("What the cuts changed", columns, tuple(rows))


def _lines(result: LearnResult) -> list[str]:
    """Sentences on the verdict, on the parameters that are better known, and on the advised cut."""
    learned, advice = result.learned, result.advice
    if learned.contradictions:
        return [
            f"contradiction: no model, no coefficients and no advice; {counted(len(learned.contradictions), 'reason')}"
        ]
    known = np.argsort(np.nan_to_num(learned.narrowed, nan=np.inf))[:4]
    better = [f"{learned.parameters[k]} {learned.narrowed[k]:.2f}" for k in known if learned.narrowed[k] < 0.9]
    lines = [
        f"{counted(len(learned.conclusive), 'conclusive cut')} of {len(learned.evidence)}, "
        f"{learned.after.effective:.0f} effective structures; errors over those of the prior: "
        f"{', '.join(better) or 'no parameter is better known'}"
    ]
    if advice is not None:
        lines.append(
            f"largest removal rate at {100 * advice.confidence:g} % confidence of stability, with a speed drift of "
            f"{100 * advice.drift:.0f} %: {shown_depth(advice.depth)} at {advice.spindle_speed / RPM:.0f} rpm"
        )
    return lines
