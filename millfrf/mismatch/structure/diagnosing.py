"""The diagnosis of a structure: faults, a linear refit, one cause after the other, and the verdict."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from estimation import BandRecording, WindowedSpectrum
from millfrf.core import Band, Complex, InputError
from millfrf.core.compilation import DIAGNOSIS, compile_kernels
from modal_fit import ModalModel

from ..behaviour.behaviour_of_modes import Behaviour
from ..behaviour.behaviour_of_recordings import behaviour_of
from ..faults.clipping_repair import repair_faults, residual_lines
from ..faults.measuring_chain import Wiring, find_wiring
from ..inference.diagnosis import NAMELESS, AcceptedCause, Diagnosis
from ..inference.numerics import ratio_interval
from ..inference.search import Progress, Search
from ..inference.settings import EvidenceSettings, ProofSettings, Settings
from ..inference.work import MILLION, WorkLimit, counted_work
from ..location.location import located
from ..location.maps import SpindleSpeed
from ..location.residual_view import StructureDetails, StructureDiagnosis, residual_view
from ..models.fitting import Fit, fit, plain_fit
from ..models.hypothesis import Hypothesis
from ..models.misfit import fitted_noise, is_below_noise, known_noise, relative_residual_power, through_structure
from ..models.model_shape import ModelShape
from ..models.model_terms import counted_at_tip, improved_model
from ..models.settings import FITTING
from ..physics.library import is_fault, library, offered, rig_of
from ..physics.protocol import JointPhysics, Physics
from ..physics.recording_faults import CLIPPING, CLOCK_SKEW, REVERSED_CHANNEL, SWAPPED_CHANNELS
from ..records.bands import (
    ComparedBand,
    compared_band,
    compared_lines,
    compared_power,
    noise_content,
    without_force_noise,
)
from ..records.noise_model import KNOTS
from ..records.reading import in_deflections, without_delay
from ..screening.missing_force import MissingForce, missing_force
from .acceptance import simplest_forms
from .answer import Answer, answer_of, equivalents_of_answer
from .comparison import StructureComparison
from .freed_laws import freed_answer
from .held_out import block_powers, chance_of_no_gain, confirmed, recordings_of
from .held_out_in_turn import held_out_in_turn
from .implausible_modes import behaviour_given_drifts, with_cause_of_implausible_modes
from .laws_together import search_with_laws_together
from .noise_bounds import with_bounded_noise
from .prediction import OfferedModel, last_fit, offered_model
from .reported_causes import different_preloads, unknown_scales
from .structured_residual import MIN_SEGMENTS, remainder_of, response_outside_modes, unresolved_modes
from .structures_in_time import modes_in_time

FIRST_FIT = 30  # most steps of the first fit of the modal parameters, which may be far from the nominal ones

# sentence on modes that change with the level in a refit without the causes, but not in a refit with the causes
CONSTANT_MODES = "No mode changes with the level once the named causes are part of the refit."

MOST_OF_POWER = 0.5  # share of the power of forces and motion below which the compared band misses the drive

MIN_POWER_KEPT = 0.5  # least share of a force's power that must remain after its noise is removed


def diagnose(
    model: ModalModel,
    recordings: Sequence[BandRecording],
    settings: Settings | None = None,
    progress: Progress | None = None,
    *,
    speeds: Mapping[str, SpindleSpeed] | None = None,
    band: Band | None = None,
) -> StructureDiagnosis:
    """Find the physics that a model lacks in recordings.

    Parameters
    ----------
    model
        Modal model with the nominal receptances.
    recordings
        Forces and responses of the model's degrees of freedom, in any order.
    settings
        Thresholds and causes; None: the usual ones.
    progress
        Called with a short text when a new stage begins.
    speeds
        Spindle speed by the recording's name, where it is known.
    band
        Lowest and highest frequency that are compared, Hz; None: the band in which the model holds.

    Raises
    ------
    InputError
        Recordings that the model cannot be compared with.
    """
    compile_kernels(*DIAGNOSIS)
    # matrices are small: several threads of the linear algebra library would be slower than one
    with threadpool_limits(1, user_api="blas"):
        delay, (model, recordings) = model.delay, without_delay(in_deflections(model), recordings)
        bands = [compared_band(model, recording.rate, band) for recording in recordings]
        settings, progress = settings or Settings(), progress or (lambda text: None)
        compared = _compared(model, recordings, bands)
        progress("wiring of channels")
        wiring, evidence = _wiring(model, [lines for lines, _ in compared], settings)
        if wiring is not None:
            recordings = [wiring.recording(recording) for recording in recordings]
            compared = _compared(model, recordings, bands)
        diagnosis = _diagnosed(model, recordings, compared, settings, progress, speeds or {})
        if wiring is not None:
            diagnosis = _with_wiring(diagnosis, wiring, evidence, settings.proof)
    return replace(diagnosis, details=replace(diagnosis.details, delay=delay))


def _compared(
    model: ModalModel, recordings: Sequence[BandRecording], bands: Sequence[ComparedBand]
) -> list[tuple[WindowedSpectrum, ComparedBand]]:
    """Return the compared lines of each recording, and their band; raise InputError if there are too few."""
    decay = float((-model.poles.real).min())
    compared = [compared_lines(recording, band, decay) for recording, band in zip(recordings, bands, strict=True)]
    for lines, _ in compared:
        _require_content(lines, model)
    return compared


def _wiring(model: ModalModel, lines: Sequence[WindowedSpectrum], settings: Settings) -> tuple[Wiring | None, float]:
    """Return exchanged or reversed channels, and their evidence; None where the wiring is as stated."""
    names = {SWAPPED_CHANNELS.name, REVERSED_CHANNEL.name}
    if not names & set(settings.causes or names):
        return None, 0.0
    shape = ModelShape(model, settings.lab)
    without_noise = [replace(each, noise=None) for each in lines]
    return find_wiring(without_noise, Hypothesis(shape, np.zeros(shape.size)), settings.evidence, FIRST_FIT)


def _with_wiring(
    diagnosis: StructureDiagnosis, wiring: Wiring, evidence: float, settings: ProofSettings
) -> StructureDiagnosis:
    """Return a diagnosis of corrected recordings with the wiring as its first cause, and errors of the stated wiring.

    If the rest is unexplained, the wiring explains a part.
    """
    details, gain = replace(diagnosis.details, wiring=wiring), diagnosis.improvement
    improved = details.elsewhere[1]
    faults = [cause for cause in diagnosis.physics if is_fault(cause.name)]
    place = [each.recording.name for each in details.measured].index(gain.held_out)
    covariance = fitted_noise(
        details.held_out, through_structure(improved, details.held_out), details.final.noises[place]
    )
    before = details.nominal_residual(details.held_out)
    after = residual_lines(improved, details.held_out, faults)
    improvement = replace(
        gain,
        before=_share(before, details.held_out),
        p_value=chance_of_no_gain(details.held_out, covariance, before, after, settings),
        interval=ratio_interval(block_powers(details.held_out, before), block_powers(details.held_out, after)),
        against="nominal",
    )
    verdict = "explained" if diagnosis.verdict == "none" else diagnosis.verdict
    verdict = "partly explained" if verdict in NAMELESS else verdict
    physics = (*wiring.causes(wiring.inverse.recording(details.held_out.recording), evidence), *diagnosis.physics)
    offer = offered_model(verdict, details.final.hypothesis, details.measured, faults, improvement)
    pairs = tuple(
        replace(pair, nominal=_share(details.nominal_residual(lines), lines))
        for pair, lines in zip(offer.recordings, details.measured, strict=True)
    )
    nominal = {pair.where: pair.nominal for pair in pairs}
    in_turn = tuple(replace(error, before=nominal[error.name]) for error in diagnosis.held_out)
    offered = {**diagnosis.content["improved_model"], **replace(offer, recordings=pairs).content()}
    content = {**diagnosis.content, "improved_model": offered}
    return replace(
        diagnosis,
        verdict=verdict,
        physics=physics,
        improvement=improvement,
        held_out=in_turn,
        details=details,
        content=content,
    )


def _share(residual: Complex, lines: WindowedSpectrum) -> float:
    """Return the root mean square of residual lines over that of the response."""
    return float(np.linalg.norm(residual) / np.linalg.norm(lines.measured))


def _diagnosed(
    model: ModalModel,
    recordings: Sequence[BandRecording],
    compared: Sequence[tuple[WindowedSpectrum, ComparedBand]],
    settings: Settings,
    progress: Progress,
    speeds: Mapping[str, SpindleSpeed],
) -> StructureDiagnosis:
    """Run the stages of the diagnosis in order and return the result."""
    decay = float((-model.poles.real).min())
    lines, bands = [recording for recording, _ in compared], [band for _, band in compared]
    progress("modal parameters")
    shape = ModelShape(model, settings.lab)
    base = _fit_of_modes(lines, Hypothesis(shape, np.zeros(shape.size)), settings.verdict.most_of_response)
    if any(is_below_noise(base.hypothesis, recording) for recording in lines):
        lines = [replace(recording, noise=None) for recording in lines]
        base = fit(lines, base.hypothesis, iterations=FIRST_FIT)
    measured, base = _with_true_forces(lines, base, settings.evidence)
    progress("tones and clipping")
    repaired, base, faults = repair_faults(measured, base, settings)
    before = remainder_of(base.hypothesis, repaired)
    causes, left_out = offered(settings.causes or library(), model, recordings)
    behaviour = behaviour_of(base.hypothesis, repaired)
    comparison = StructureComparison(
        repaired,
        causes,
        _with_fault_evidence(faults, settings),
        before,
        behaviour,
        limits=_limit_evidence(faults, repaired[0]),
    )
    search_result, unfinished = _search_causes(comparison, base, progress)
    progress("held-out recording")
    proof = confirmed(comparison, recordings_of(repaired, measured, base.hypothesis), search_result, faults)
    recordings_of_proof = proof.recordings
    progress("residual")
    answer = answer_of(comparison, recordings_of_proof, proof.search, proof.held_out, faults, decay)
    progress("form of the law")
    reported_faults = [cause for cause in answer.causes if is_fault(cause.name)]
    freed_result = freed_answer(answer, comparison, recordings_of_proof, reported_faults)
    last_result = last_fit(freed_result.answer, recordings_of_proof, reported_faults, settings.proof)
    answer = replace(last_result.answer, final=with_bounded_noise(last_result.answer.final, repaired))
    search_result = answer.search
    progress("each recording held out in turn")
    in_turn = held_out_in_turn(answer, recordings_of_proof, reported_faults)
    answer = in_turn.answer
    progress("where the mismatch sits")
    band, shares, outside = _band_and_power(lines, bands)
    elsewhere = answer.held_out.linear, answer.held_out.improved
    unseen = recordings_of_proof.held_out(measured)
    details = StructureDetails(base, answer.final, tuple(repaired), tuple(measured), elsewhere, unseen, band)
    # faults that are not reported may be wrong, for instance a resonance taken for a tone
    behaviour = behaviour_of(base.hypothesis, measured) if faults and answer.verdict in NAMELESS else behaviour
    behaviour = _reported_behaviour(behaviour, answer)
    details = replace(details, missing=_missing_force(details, causes, settings))
    view = residual_view(details, answer.verdict in NAMELESS, recordings, settings.location)
    return Diagnosis(
        "structure",
        answer.verdict,
        answer.causes,
        tuple(sorted([*search_result.candidates, *answer.rejected], key=lambda candidate: -candidate.evidence)),
        equivalents_of_answer(search_result, answer.causes, settings.evidence),
        answer.held_out.improvement,
        before,
        answer.left,
        located(view, speeds),
        replace(details, view=view, behaviour=behaviour, textbook=freed_result.textbook),
        in_turn.errors,
        doubts=(
            *outside,
            *_nothing_held_out(details),
            *unresolved_modes(base.hypothesis, repaired),
            *response_outside_modes(base.hypothesis, repaired),
            *answer.doubts,
            *filter(None, (in_turn.doubt, freed_result.doubt, unfinished)),
            *unknown_scales(answer.causes, rig_of(answer.final.hypothesis.model)),
            *different_preloads(answer.final.hypothesis),
        ),
        content={
            "compared_band": {"low": band.low, "high": band.high, "why": band.why},
            "compared_power": {"forces": shares[0], "motion": shares[1]},
            "not_asked_for": list(left_out),
            "behaviour": behaviour.content(),
            "free_form": freed_result.content(),
            "modes_in_time": modes_in_time(improved_model(answer.final.hypothesis)),
            "missing_force": details.missing.content() if details.missing is not None else None,
            "another_structure": answer.another_structure,
            "noise": _noise_entries(answer.final, measured),
            "improved_model": _with_offered_model(answer, measured, last_result.sentence).content(),
        },
    )


def _reported_behaviour(behaviour: Behaviour, answer: Answer) -> Behaviour:
    """Return the behaviour by level, with what the named causes say of it."""
    behaviour = behaviour_given_drifts(behaviour, answer.final.hypothesis)
    return replace(behaviour, sentence=f"{behaviour.sentence} {CONSTANT_MODES}") if answer.stayed else behaviour


def _nothing_held_out(details: StructureDetails) -> tuple[str, ...]:
    """Return a warning if no data could be held out."""
    if details.tested:
        return ()
    name = details.recordings[0].recording.name
    return (
        f"{name} is the only recording, and too short to hold a part of it out: errors are those of the fit, and no "
        "other data confirm the verdict; give two recordings or more",
    )


def _missing_force(details: StructureDetails, causes: Mapping[str, Physics], settings: Settings) -> MissingForce | None:
    """Return the force of one joint that the model with the reported linear causes lacks; None without joint laws."""
    laws = [cause for cause in causes.values() if isinstance(cause, JointPhysics)]
    if not laws:
        return None
    lines, start, final = list(details.recordings), details.base, details.final.hypothesis
    linear = tuple(cause for cause in final.causes if cause.axis is None)
    if linear:
        start = fit(lines, replace(final, causes=linear))
    try:
        return missing_force(lines, start, laws, settings.screening)
    except np.linalg.LinAlgError:  # the response of a trial is not finite: the force cannot be determined
        return None


def _fit_of_modes(lines: list[WindowedSpectrum], nominal: Hypothesis, largest: float) -> Fit:
    """Fit modal parameters alone; if much is left of a recording, start again by plain least squares.

    From a nominal model that is far off, for instance by the sign of a channel, a fit may end where it takes most of
    the response for noise, although other modes predict it.
    """
    fitted = fit(lines, nominal, iterations=FIRST_FIT)
    if _predicts(fitted, lines, largest):
        return fitted
    plain = plain_fit(lines, nominal, iterations=FIRST_FIT, exact=FITTING.restart_error)
    refitted = fit(lines, plain.hypothesis, iterations=FIRST_FIT)
    # where other modes predict as little, the structure is not linear, and the nominal modes are the better start
    return refitted if refitted.score < fitted.score and _predicts(refitted, lines, largest) else fitted


def _predicts(fitted: Fit, lines: list[WindowedSpectrum], largest: float) -> bool:
    """Return whether a fit leaves at most the share ``largest`` of the response of each recording."""
    return all(np.mean(relative_residual_power(fitted.hypothesis, recording)) <= largest**2 for recording in lines)


def _band_and_power(
    lines: Sequence[WindowedSpectrum], bands: Sequence[ComparedBand]
) -> tuple[ComparedBand, tuple[float, float], tuple[str, ...]]:
    """Return the widest compared band, the least shares of the power in it, and a doubt if most of the power is not."""
    band = max(bands, key=lambda band: band.high)
    force, motion = (min(shares) for shares in zip(*map(compared_power, lines), strict=True))
    held = f"{100 * force:.3g} % of the power of the forces and {100 * motion:.3g} % of that of the motion"
    outside = f"the compared band holds only {held}: the recordings are driven outside it; give --band LOW HIGH"
    doubts = (outside,) if max(force, motion) < MOST_OF_POWER else ()
    return replace(band, why=f"{band.why}; at least {held}"), (force, motion), doubts


def _search_causes(comparison: StructureComparison, base: Fit, progress: Progress) -> tuple[Search[Fit], str]:
    """Search for causes, and return a sentence if the search ended because its largest work was done."""
    with counted_work() as work:
        limited = replace(comparison, limit=WorkLimit(comparison.settings.search.most_work, work))
        search_result = search_with_laws_together(limited, base, progress)
        if limited.limit.reached:
            return _in_final_form(comparison, search_result), (
                f"The search for causes ended after a work of {work.values / MILLION:.4g} million values: a further "
                "cause may have been missed; a larger --search-work than "
                f"{limited.limit.millions:.4g} lets it go on"
            )
        progress("causes of implausible modes")
        return _in_final_form(comparison, with_cause_of_implausible_modes(limited, search_result)), ""


def _in_final_form(comparison: StructureComparison, search_result: Search[Fit]) -> Search[Fit]:
    """Return the search with the last fit in its simplest forms and with joint deflections referred to the tip.

    The reference of deflections changes no prediction.
    """
    last = simplest_forms(search_result.current, comparison.lines, comparison.settings.evidence.as_good)
    hypothesis = counted_at_tip(last.hypothesis)
    if any(cause is not other for cause, other in zip(hypothesis.causes, last.hypothesis.causes, strict=True)):
        again = fit(comparison.lines, hypothesis, last.noises, iterations=0, fixed_noise=True)
        last = again if np.isfinite(again.score) else last
    return replace(search_result, steps=(*search_result.steps[:-1], last))


def _limit_evidence(faults: Sequence[AcceptedCause], lines: WindowedSpectrum) -> dict[int, float]:
    """Return the evidence of the limit of each clipped channel, by the index of the response."""
    names = lines.recording.channels[-lines.measured.shape[1] :]
    clipped = [fault for fault in faults if fault.name == CLIPPING.name]
    return {names.index(fault.location["channel"]): fault.evidence for fault in clipped}


def _with_fault_evidence(faults: Sequence[AcceptedCause], settings: Settings) -> Settings:
    """Return the settings with evidence thresholds adapted to the repaired faults.

    Repaired samples are not exact, and a small cause may only describe their errors; a corrected clock is exact.
    """
    inexact = [fault.evidence for fault in faults if fault.name != CLOCK_SKEW.name]
    least = settings.evidence.beside_fault * sum(inexact)
    evidence = replace(settings.evidence, least=max(settings.evidence.least, least))
    return replace(settings, evidence=evidence)


def _with_offered_model(answer: Answer, measured: list[WindowedSpectrum], last: str) -> OfferedModel:
    """Return the model offered for predictions, with a sentence on its last fit."""
    gain = answer.held_out.improvement
    offer = offered_model(answer.verdict, answer.final.hypothesis, measured, answer.causes, gain)
    return replace(offer, sentence=" ".join(sentence for sentence in (offer.sentence, last) if sentence))


def _noise_entries(final: Fit, lines: list[WindowedSpectrum]) -> list[dict[str, Any]]:
    """Return the entry of the file on the noise of each recording."""
    entries = []
    for recording, inferred in zip(lines, final.noises, strict=True):
        covariance = known_noise(recording, through_structure(final.hypothesis, recording), inferred)
        entries.append(noise_content(recording, covariance))
    return entries


def _require_content(lines: WindowedSpectrum, model: ModalModel) -> None:
    """Raise InputError for a recording without excitation, that is too short, or with too few lines in the band.

    The level of the signal is followed over segments, each of which must hold half a period of the slowest mode in the
    band. Half of the real numbers that are compared, two for each line and response, must remain after those that the
    recording itself needs: its noise (at ``KNOTS`` frequencies for each response, and that of each force) and its first
    motion (two for each mode that still rings).
    """
    count, recording = len(lines.frequencies), lines.recording
    responses = lines.measured.shape[1]
    own = responses * KNOTS + lines.force_here.shape[1] + 2 * int(np.sum(lines.rings(model.poles)))
    least = -(-own // responses)
    if count < least:
        raise InputError(
            f"{recording.name} lasts {recording.duration:.3g} s: {count} lines in the band that is compared, {least} "
            "are the least that determine its noise and its first motion; record "
            f"{np.ceil(recording.duration * least / max(count, 1)):.0f} s or more, or widen the band with "
            "--band LOW HIGH"
        )
    inside = model.natural_frequencies[model.natural_frequencies >= lines.frequencies[0]]
    periods, lowest = 0.5 * MIN_SEGMENTS, float(inside.min(initial=lines.frequencies[-1]))
    if recording.duration < periods / lowest:
        raise InputError(
            f"{recording.name} lasts {recording.duration:.3g} s, {recording.duration * lowest:.2g} periods of the "
            f"slowest mode in the band; {periods:g} are the least, record {1.1 * periods / lowest:.2g} s or more"
        )
    if not lines.force_here.any():
        raise InputError(
            f"{recording.name}: nothing drives the structure after the first {lines.start / recording.rate:.3g} s, "
            "which are left out because it was in motion when the recording began; record with a quiet beginning "
            "(pre-trigger)"
        )


def _with_true_forces(
    lines: list[WindowedSpectrum], base: Fit, settings: EvidenceSettings
) -> tuple[list[WindowedSpectrum], Fit]:
    """Return the recordings as measured, or with the noise of the forces removed, and the fit to these recordings.

    The noise level of the forces is taken from the first fit or from the quietest lines of the forces. Noise is removed
    only if the score gains as much as a cause needs, because the forces may have no noise at all.
    """
    options = [(lines, base)]
    if all(recording.noise is not None for recording in lines):
        # the noise of the forces was measured, and the forces have no power between their lines
        return options[0]
    estimated = [np.exp(noise.forces) for noise in base.noises]
    for variances in (estimated, [np.full(len(variance), np.inf) for variance in estimated]):
        filtered = [
            without_force_noise(recording, variance) for recording, variance in zip(lines, variances, strict=True)
        ]
        if all(_keeps_most_power(candidate, before) for candidate, before in zip(filtered, lines, strict=True)):
            options.append((filtered, fit(filtered, base.hypothesis, base.noises)))
    best = min(options, key=lambda pair: pair[1].score)
    return best if best[1].score < base.score - settings.least else options[0]


def _keeps_most_power(lines: WindowedSpectrum, before: WindowedSpectrum) -> bool:
    """Return whether at least ``MIN_POWER_KEPT`` of the power of each force remains after its noise was removed."""
    left, had = (np.sum(np.abs(recordings.force_here) ** 2, axis=0) for recordings in (lines, before))
    return bool((left > MIN_POWER_KEPT * had).all())
