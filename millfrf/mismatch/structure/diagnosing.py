"""The diagnosis of a structure: faults, a linear refit, one cause after the other, and a verdict that binds."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from estimation import BandRecording, WindowedSpectrum
from millfrf.core import Band, InputError
from millfrf.core.compilation import DIAGNOSIS, compile_kernels
from modal_fit import ModalModel

from ..behaviour.behaviour_of_modes import behaviour_of
from ..faults.clipping_repair import repair_faults
from ..inference.diagnosis import AcceptedCause, Diagnosis
from ..inference.search import Patience, Progress, Search, search
from ..inference.settings import EvidenceSettings, Settings
from ..location.location import located
from ..location.maps import SpindleSpeed
from ..location.residual_view import StructureDetails, StructureDiagnosis, residual_view
from ..models.fitting import Fit, fit
from ..models.hypothesis import Hypothesis
from ..models.misfit import known_noise, outdoes_noise, through_structure
from ..models.model_shape import ModelShape
from ..models.model_terms import counted_at_tip
from ..physics.library import is_fault, library, offered
from ..physics.measuring_chain import CLIPPING
from ..records.bands import ComparedBand, compared_band, compared_lines
from ..records.held_out_parts import noise_content, without_force_noise
from ..records.reading import in_deflections, without_delay
from ..residual.bursts import beyond_model
from ..residual.structured_residual import leftover
from .answer import Answer, answer_of, equivalents_of_answer
from .comparison import StructureComparison
from .confirmation import confirmed
from .freed_laws import freed_answer
from .held_out import recordings_of
from .implausible_modes import with_cause_of_odd_modes
from .prediction import OfferedModel, last_fit, offered_model
from .reported_causes import unknown_scales

FIRST_FIT = 30
"""Steps at most of the modal parameters: a nominal model may be far off."""

FEWEST_LINES = 24
"""Least number of lines of a recording that are compared."""

STAYED = "No mode moves once the causes that are told are part of the refit."
"""What is said of modes that move in a refit without the causes alone."""

MOSTLY = 0.5
"""Share of a force's power that must be left when its noise is taken out."""


def diagnose(
    model: ModalModel,
    recordings: Sequence[BandRecording],
    settings: Settings | None = None,
    progress: Progress | None = None,
    *,
    speeds: Mapping[str, SpindleSpeed] | None = None,
    band: Band | None = None,
) -> StructureDiagnosis:
    """Find what a model leaves out of recordings.

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
    # matrices are small: threads inside the linear algebra only get in each other's way
    with threadpool_limits(1, user_api="blas"):
        delay, (model, recordings) = model.delay, without_delay(in_deflections(model), recordings)
        bands = [compared_band(model, one.rate, band) for one in recordings]
        found = _diagnosed(
            model, recordings, bands, settings or Settings(), progress or (lambda text: None), speeds or {}
        )
    return replace(found, details=replace(found.details, delay=delay))


def _diagnosed(
    model: ModalModel,
    recordings: Sequence[BandRecording],
    bands: Sequence[ComparedBand],
    settings: Settings,
    progress: Progress,
    speeds: Mapping[str, SpindleSpeed],
) -> StructureDiagnosis:
    """The diagnosis, one step after the other."""
    decay = float((-model.poles.real).min())
    read = [compared_lines(one, band, decay) for one, band in zip(recordings, bands, strict=True)]
    lines, bands = [one for one, _ in read], [band for _, band in read]
    for one in lines:
        _refuse_empty(one)
    progress("modal parameters")
    shape = ModelShape(model, settings.lab)
    base = fit(lines, Hypothesis(shape, np.zeros(shape.size)), iterations=FIRST_FIT)
    if any(outdoes_noise(base.hypothesis, one) for one in lines):
        lines = [replace(one, noise=None) for one in lines]
        base = fit(lines, base.hypothesis, iterations=FIRST_FIT)
    measured, base = _with_true_forces(lines, base, settings.evidence)
    progress("tones and clipping")
    mended, base, faults = repair_faults(measured, base, settings)
    before = leftover(base.hypothesis, mended)
    causes, left_out = offered(settings.causes or library(), model)
    behaviour = behaviour_of(base.hypothesis, mended)
    patience = Patience(settings.search.longest)
    comparison = StructureComparison(
        mended, causes, _beside(faults, settings), before, behaviour, patience, _limits(faults, mended[0])
    )
    found, hurried = _searched(comparison, base, progress)
    progress("held-out recording")
    proof = confirmed(comparison, recordings_of(mended, measured, base.hypothesis), found, faults)
    both = proof.recordings
    progress("what is left")
    answer = answer_of(comparison, both, proof.found, proof.held_out, faults, decay)
    progress("form of the law")
    told_faults = [one for one in answer.causes if is_fault(one.name)]
    freed = freed_answer(answer, comparison, both, told_faults)
    last = last_fit(freed.answer, both, told_faults, settings.proof)
    answer = last.answer
    found = answer.found
    progress("where the mismatch sits")
    band = max(bands, key=lambda band: band.high)
    elsewhere = answer.held_out.linear, answer.held_out.improved
    unseen = both.held_out(measured)
    details = StructureDetails(base, answer.final, tuple(mended), tuple(measured), elsewhere, unseen, band)
    # faults that are not told may have been none: a resonance that was taken for a tone
    behaviour = behaviour_of(base.hypothesis, measured) if faults and answer.verdict == "unexplained" else behaviour
    behaviour = replace(behaviour, sentence=f"{behaviour.sentence} {STAYED}") if answer.stayed else behaviour
    view = residual_view(details, answer.verdict == "unexplained", recordings, settings.location)
    candidates = sorted([*found.candidates, *answer.rejected], key=lambda one: -one.evidence)
    return Diagnosis(
        "structure",
        answer.verdict,
        answer.causes,
        tuple(candidates),
        equivalents_of_answer(found, answer.causes, settings.evidence),
        answer.held_out.improvement,
        before,
        answer.left,
        located(view, speeds),
        replace(details, view=view, behaviour=behaviour, textbook=freed.textbook),
        doubts=(
            *beyond_model(base.hypothesis, mended),
            *answer.doubts,
            *([freed.doubt] if freed.doubt else []),
            *([hurried] if hurried else []),
            *unknown_scales(answer.causes),
        ),
        content={
            "compared_band": asdict(band),
            "not_asked_for": list(left_out),
            "behaviour": behaviour.content(),
            "free_form": freed.content(),
            "noise": _noise_of(answer.final, measured),
            "improved_model": _offered(answer, measured, last.sentence).content(),
        },
    )


def _searched(comparison: StructureComparison, base: Fit, progress: Progress) -> tuple[Search[Fit], str]:
    """Where the search for causes ends, and a word where it ended because it had lasted long enough."""
    found = search(comparison, base, progress)
    if comparison.patience.over:
        return _counted_at_tip(comparison, found), (
            f"The search for causes ended after {comparison.patience.seconds:.4g} s: a further cause may have been "
            "missed; `millfrf diagnose --search-time` lets it go on"
        )
    progress("causes behind odd modes")
    return _counted_at_tip(comparison, with_cause_of_odd_modes(comparison, found)), ""


def _counted_at_tip(comparison: StructureComparison, found: Search[Fit]) -> Search[Fit]:
    """The search whose last fit counts the deflections of joints inside in the tip's motion; it predicts the same."""
    last = found.current
    hypothesis = counted_at_tip(last.hypothesis)
    if all(one is other for one, other in zip(hypothesis.causes, last.hypothesis.causes, strict=True)):
        return found
    again = fit(comparison.lines, hypothesis, last.noises, iterations=0, held=True)
    return replace(found, steps=(*found.steps[:-1], again)) if np.isfinite(again.score) else found


def _limits(faults: Sequence[AcceptedCause], lines: WindowedSpectrum) -> dict[int, float]:
    """Evidence of each limit at which a channel clips, by the number of the response."""
    names = lines.recording.channels[-lines.measured.shape[1] :]
    found = [one for one in faults if one.name == CLIPPING.name]
    return {names.index(one.location["channel"]): one.evidence for one in found}


def _beside(faults: Sequence[AcceptedCause], settings: Settings) -> Settings:
    """Thresholds beside mended faults: what a channel clipped is put back nearly, and a small cause may mend that."""
    least = settings.evidence.beside_fault * sum(one.evidence for one in faults)
    evidence = replace(settings.evidence, least=max(settings.evidence.least, least))
    return replace(settings, evidence=evidence)


def _offered(answer: Answer, measured: list[WindowedSpectrum], last: str) -> OfferedModel:
    """Which model is offered to predict with, and what its last fit brings."""
    gain = answer.held_out.improvement
    offer = offered_model(answer.verdict, answer.final.hypothesis, measured, answer.causes, gain)
    return replace(offer, sentence=" ".join(one for one in (offer.sentence, last) if one))


def _noise_of(final: Fit, lines: list[WindowedSpectrum]) -> list[dict[str, Any]]:
    """What the file says of the noise of each recording."""
    found = []
    for one, inferred in zip(lines, final.noises, strict=True):
        covariance = known_noise(one, through_structure(final.hypothesis, one), inferred)
        found.append(noise_content(one, covariance))
    return found


def _refuse_empty(lines: WindowedSpectrum) -> None:
    """Refuse a recording whose spectrum has too few lines in the band to say anything, or nothing that drives."""
    count, recording = len(lines.frequencies), lines.recording
    if count < FEWEST_LINES:
        raise InputError(
            f"{recording.name} lasts {recording.duration:.3g} s: {count} lines in the band that is compared, "
            f"{FEWEST_LINES} are the least; record longer, or widen the band"
        )
    if not lines.force_here.any():
        raise InputError(
            f"{recording.name}: nothing drives the structure after the first {lines.start / recording.rate:.3g} s, "
            "which are left out as it was moving before; record with a quiet beginning (pre-trigger)"
        )


def _with_true_forces(
    lines: list[WindowedSpectrum], base: Fit, settings: EvidenceSettings
) -> tuple[list[WindowedSpectrum], Fit]:
    """Forces as measured, with the noise that the first fit found taken out, or with that of their quietest lines.

    The likelihood chooses, and must gain as much as a cause: hum on the responses hides how noisy the forces are, and
    forces may have no noise at all.
    """
    found = [(lines, base)]
    if all(one.noise is not None for one in lines):
        # how noisy the forces are is measured, and between their lines there is nothing to replace
        return found[0]
    estimated = [np.exp(noise.forces) for noise in base.noises]
    for variances in (estimated, [np.full(len(variance), np.inf) for variance in estimated]):
        weighed = [without_force_noise(one, variance) for one, variance in zip(lines, variances, strict=True)]
        if all(_mostly_kept(one, before) for one, before in zip(weighed, lines, strict=True)):
            found.append((weighed, fit(weighed, base.hypothesis, base.noises)))
    best = min(found, key=lambda pair: pair[1].score)
    return best if best[1].score < base.score - settings.least else found[0]


def _mostly_kept(lines: WindowedSpectrum, before: WindowedSpectrum) -> bool:
    """Whether most of every force's power is left: else its quietest lines were not those without force."""
    left, had = (np.sum(np.abs(one.force_here) ** 2, axis=0) for one in (lines, before))
    return bool((left > MOSTLY * had).all())
