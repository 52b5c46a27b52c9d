"""Predictions after a diagnosis: final fit, improved model, and receptance at a level."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from estimation import BandRecording, Frf, WindowedSpectrum
from millfrf.core import Real
from millfrf.core.compilation import DIAGNOSIS, compile_kernels
from modal_fit import ModalModel

from ..faults.clipping_repair import residual_lines, with_faults
from ..faults.measuring_chain import stated_wiring
from ..inference.diagnosis import NAMELESS, AcceptedCause, Candidate, Improvement
from ..inference.settings import ProofSettings
from ..joints.joint_law import driven_force
from ..location.residual_view import StructureDiagnosis
from ..models.first_motion import predict_lines
from ..models.fitting import even_fit
from ..models.hypothesis import Hypothesis, surround
from ..models.model_terms import hypothesis_of, improved_model
from ..physics.library import is_fault
from ..records.bands import Recordings, compared_band, compared_lines
from ..records.reading import in_deflections, without_delay
from .answer import Answer
from .held_out import HeldOut, scored
from .structured_residual import remainder_of

CLEARLY_WORSE = 1.1  # ratio to the error of the nominal model above which a model is clearly worse on a recording


def improved_model_of(diagnosis: StructureDiagnosis) -> ModalModel:
    """Return the model with all accepted causes; the nominal model if refitted modes alone predict no better.

    Parameters
    ----------
    diagnosis
        The diagnosis of a structure, with its fits.
    """
    details, final = diagnosis.details, diagnosis.details.final.hypothesis
    offer = offered_model(diagnosis.verdict, final, details.measured, diagnosis.physics, diagnosis.improvement)
    faults = tuple(
        {"name": cause.name, "location": dict(cause.location), "parameters": dict(cause.parameters)}
        for cause in diagnosis.physics
        if is_fault(cause.name)
    )
    if offer.nominal or details.refused:
        return replace(details.base.hypothesis.shape.nominal, physics=faults, delay=details.delay)
    return replace(improved_model(final, faults), delay=details.delay)


def with_refused_model(diagnosis: StructureDiagnosis, reason: str) -> StructureDiagnosis:
    """Return a diagnosis whose improved model fails a check of models: it explains nothing, and is not offered.

    Parameters
    ----------
    diagnosis
        The diagnosis of a structure, with its fits.
    reason
        Why the improved model cannot be a structure, as a sentence without a full stop.
    """
    sentence = f"The improved model is the nominal model: {reason}."
    offered = {**diagnosis.content.get("improved_model", {}), "model": "nominal", "sentence": sentence}
    rejected = tuple(Candidate(cause.name, cause.evidence, "rejected", cause.location) for cause in diagnosis.physics)
    return replace(
        diagnosis,
        verdict="none" if diagnosis.verdict == "none" else "unexplained",
        physics=(),
        candidates=(*rejected, *diagnosis.candidates),
        equivalents=(),
        doubts=(f"the model with refitted modes and causes is no structure: {reason}", *diagnosis.doubts),
        content={**diagnosis.content, "improved_model": offered},
        details=replace(diagnosis.details, refused=reason),
    )


@dataclass(frozen=True)
class ErrorPair:
    """Errors of two models on the same recording, as shares of its root mean square response."""

    where: str  # recording, or part of one, as text
    nominal: float
    improved: float

    @property
    def ratio(self) -> float:
        """Ratio of the errors, improved over nominal model; infinite if the simulation of the improved one diverges."""
        ratio = self.improved / max(self.nominal, 1e-300)
        return ratio if np.isfinite(ratio) else np.inf

    def sentence(self, subject: str) -> str:
        """Return a sentence with both errors; ``subject`` names the improved model and contains the verb.

        Examples
        --------
        >>> ErrorPair("high", 0.916, 1.09).sentence("it leaves")
        'it leaves 109 % of high, the nominal model 91.6 %'
        """
        return f"{subject} {100 * self.improved:.3g} % of {self.where}, the nominal model {100 * self.nominal:.3g} %"


@dataclass(frozen=True)
class OfferedModel:
    """Model that a diagnosis offers for predictions, compared with the nominal one."""

    nominal: bool  # whether it is the nominal model itself
    recordings: tuple[ErrorPair, ...]
    sentence: str  # what a user must know before a prediction; empty if nothing

    def content(self) -> dict[str, Any]:
        """Return the entry for the file of a diagnosis."""
        rows = [
            {"recording": recording.where, "nominal": recording.nominal, "final": recording.improved}
            for recording in self.recordings
        ]
        return {"model": "nominal" if self.nominal else "final", "sentence": self.sentence, "recordings": rows}


def offered_model(
    verdict: str,
    final: Hypothesis,
    measured: Sequence[WindowedSpectrum],
    causes: Sequence[AcceptedCause],
    gain: Improvement,
) -> OfferedModel:
    """Choose the model that is offered for predictions, the improved or the nominal one.

    Accepted causes were confirmed by held-out data, and their model is offered, with a warning if it is worse than the
    nominal model on a recording. Under ``unlisted`` a force of free form remains, under ``unexplained`` only refitted
    modes. They are offered if their held-out error is smaller than the error of the nominal model, and on no recording
    more than :data:`CLEARLY_WORSE` times it.
    """
    faults = [cause for cause in causes if is_fault(cause.name)]
    pairs = tuple(_pair(final, recording, faults) for recording in measured)
    worse, held_out_pair = (
        [pair for pair in pairs if pair.ratio > CLEARLY_WORSE],
        ErrorPair(gain.where, gain.before, gain.after),
    )
    if verdict not in NAMELESS:
        sentences = "; ".join(pair.sentence("it leaves") for pair in worse)
        return OfferedModel(
            False, pairs, f"The improved model is worse than the nominal one: {sentences}." if worse else ""
        )
    worse += [held_out_pair] if held_out_pair.ratio >= 1 else []
    if worse:
        worst = max(worse, key=lambda pair: pair.ratio)
        refitted = "refitted modes with a force of free form leave" if final.laws else "refitted modes leave"
        sentence = f"The improved model is the nominal model: {worst.sentence(refitted)}."
        return OfferedModel(True, pairs, sentence)
    contents = "a joint's force of free form" if final.laws else "no law"
    sentence = f"The improved model holds refitted modes and {contents}: {held_out_pair.sentence('they leave')}."
    return OfferedModel(False, pairs, sentence)


def _pair(final: Hypothesis, lines: WindowedSpectrum, faults: Sequence[AcceptedCause]) -> ErrorPair:
    """Return the errors of the nominal model and of a hypothesis on a recording as measured."""
    residuals = residual_lines(final.nominal, lines), residual_lines(final, lines, faults)
    power = float(np.sum(np.abs(lines.measured) ** 2))
    nominal, improved = (float(np.sqrt(np.sum(np.abs(residual) ** 2) / power)) for residual in residuals)
    return ErrorPair(lines.recording.name, nominal, improved)


@dataclass(frozen=True)
class Prediction:
    """Predicted responses, compared with measured ones.

    Parameters
    ----------
    response : (n_samples, n_responses)
        Predicted responses in the measured quantities, with frequencies up to half the sampling rate.
    run_in
        Samples at the beginning in which the structure's unknown first motion still rings.
    error : (n_responses,)
        Root mean square of measured minus predicted over that of measured, in the model's band after the run-in.
    total_error
        Error of all responses together; each line of the band counts by its power.
    band
        Lowest and highest frequency that are compared, Hz.
    """

    response: Real
    run_in: int
    error: Real
    total_error: float
    band: tuple[float, float]


def predict(model: ModalModel, trial: BandRecording) -> Prediction:
    """Simulate the response of a model with its terms of physics to the forces of a recording.

    The unknown earlier motion of the structure decays in the run-in; if the recording is too short for that, it is
    estimated from the measured response. A limit (``clipping``) is applied to its channel. The phase of a steady tone
    (``unmeasured_excitation``) in another recording is unknown, so that amplitude and phase are read from the recording
    at that frequency.

    Raises
    ------
    FileFormatError
        Terms that cannot be read.
    InputError
        A recording that the model cannot be compared with.
    """
    compile_kernels(*DIAGNOSIS)
    model, (trial,) = without_delay(in_deflections(model), [trial])
    hypothesis, wiring = hypothesis_of(model), stated_wiring(trial, model.physics)
    recorded, trial = trial, wiring.recording(trial)
    lines, band = compared_lines(trial, compared_band(model, trial.rate), float((-model.poles.real).min()))
    lines_of_all_forces = lines.with_whole_forces()
    response = lines_of_all_forces.signal(predict_lines(hypothesis, lines_of_all_forces).spectrum)
    response = wiring.inverse.responses.corrected(with_faults(response, trial, lines.start, model.physics))
    measured, shown = (lines.cut(signal) for signal in (recorded.response, response))
    residual_power, power = np.abs(measured - shown) ** 2, np.abs(measured) ** 2
    return Prediction(
        np.asarray(response),
        lines.start,
        np.sqrt(residual_power.sum(axis=0) / power.sum(axis=0)),
        float(np.sqrt(residual_power.sum() / power.sum())),
        band.edges,
    )


STEPS = 20  # steps at most of the last fit

# ratio of held-out error to noise below which the residual is noise, and no last fit is tried
BEYOND_NOISE = 1.5


@dataclass(frozen=True)
class LastFit:
    """A result whose improved model was fitted once more with equal weights of all recordings, or is unchanged."""

    answer: Answer
    sentence: str = ""  # what the last fit changes; empty if it was not taken


def last_fit(
    answer: Answer, recordings: Recordings, faults: Sequence[AcceptedCause], settings: ProofSettings
) -> LastFit:
    """Fit the laws of a result once more with equal weights of all recordings; keep this fit if it predicts better.

    It is kept if it lowers both held-out errors, the reported one and the error over all recordings. The reported
    names, numbers and standard errors remain the maximum likelihood estimates.
    """
    before, final = answer.held_out, answer.final
    gain = before.improvement
    if not final.hypothesis.laws or not recordings.tested or gain.after < BEYOND_NOISE * gain.noise_floor:
        return LastFit(answer)
    start = replace(final, hypothesis=before.improved, noises=())
    refitted = even_fit(recordings.others(recordings.repaired), start, iterations=STEPS)
    if not np.isfinite(refitted.score):
        return LastFit(answer)
    errors = scored(recordings, (before.linear, refitted.hypothesis), final.noises, faults, settings)
    if not errors.leaves_less_than(before):
        return LastFit(answer)
    final_refit = even_fit(recordings.repaired, final, iterations=STEPS)
    if not np.isfinite(final_refit.score):
        return LastFit(answer)
    left = remainder_of(final_refit.hypothesis, recordings.repaired)
    return LastFit(replace(answer, final=final_refit, held_out=errors, left=left), _last_fit_sentence(before, errors))


def _last_fit_sentence(before: HeldOut, after: HeldOut) -> str:
    """Describe what the last fit changes."""
    old, new = (100 * held_out.everywhere.after for held_out in (before, after))
    return (
        "The improved model comes from a last least-squares fit in which every recording has equal weight: over all "
        f"held-out data it leaves {new:.3g} % instead of {old:.3g} %. Its numbers differ from the reported ones."
    )


def equivalent_receptance(hypothesis: Hypothesis, lines: WindowedSpectrum, frequencies: Real) -> Frf:
    """Return the receptance of the structure with its causes; joints are linearised for the motion of one recording.

    The law of a joint is replaced by the spring and damper closest to its force, ``k = <g x> / <x^2>`` and ``c = <g v>
    / <v^2>`` (statistical linearisation: Roberts & Spanos, Random Vibration and Statistical Linearization, chapter 5).
    Faults of the measuring chain do not belong to the structure.

    Parameters
    ----------
    hypothesis
        Hypothesis with its modes and causes as fitted.
    lines
        Recording whose motion counts.
    frequencies : (n,), Hz
        Frequencies at which the receptances are computed.

    Returns
    -------
    Frf
        Receptances, m/N.
    """
    model, reach = hypothesis.model, hypothesis.reach
    n, m = len(model.responses), len(model.excitations)
    receptance = reach.model.receptance(frequencies)
    added = np.zeros(receptance.swapaxes(1, 2).shape, dtype=complex)
    feedback = surround(hypothesis, frequencies).feedback
    if feedback is not None:
        added[:, :m, :n] += feedback
    s = 2j * np.pi * frequencies
    answers = predict_lines(hypothesis, lines).joints
    for cause, path, answer in zip(hypothesis.laws, reach.paths, answers, strict=True):
        oversampling = max(1, len(answer.deflection) // lines.padded)
        samples = slice(lines.start * oversampling, (lines.start + len(lines.window)) * oversampling)
        x, v = answer.deflection, answer.velocity
        g = driven_force(lines, x, v, cause.law(lines.recording), often=oversampling)[samples]
        stiffness, damping = (float(g @ y[samples]) / float(y[samples] @ y[samples]) for y in (x, v))
        added += (stiffness + s * damping)[:, None, None] * np.outer(path.push, path.along)
    closed_loop = np.linalg.solve(np.eye(receptance.shape[1]) + receptance @ added, receptance)
    closed = np.asarray(closed_loop[:, :n, :m], dtype=complex)
    valid = np.ones(len(frequencies), dtype=bool)
    return Frf(frequencies, closed, model.responses, model.excitations, "receptance", "m/N", valid)
