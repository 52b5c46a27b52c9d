"""Predictions after a diagnosis: final fit, improved model, receptance at a level."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from estimation import BandRecording, Frf, WindowedSpectrum, windowed_spectrum
from millfrf.core import Real
from millfrf.core.compilation import DIAGNOSIS, compile_kernels
from modal_fit import ModalModel

from ..faults.clipping_repair import residual_lines, with_faults
from ..inference.diagnosis import AcceptedCause, Improvement
from ..inference.settings import ProofSettings
from ..joints.joint_simulation import driven_force
from ..location.residual_view import StructureDiagnosis
from ..models.hypothesis import Hypothesis, predict_lines, surround
from ..models.model_terms import hypothesis_of, improved_model
from ..models.refinement import even_fit
from ..physics.library import is_fault
from ..records.held_out_parts import Recordings
from ..records.reading import band_of, in_deflections, without_delay
from ..residual.structured_residual import leftover
from .answer import Answer
from .held_out import HeldOut, scored

WORSE = 1.1
"""Error over that of the nominal model from which a model is worse than it on a recording."""


def improved_model_of(diagnosis: StructureDiagnosis) -> ModalModel:
    """The model with everything that was accepted; the nominal one where refitted modes alone predict no better.

    Parameters
    ----------
    diagnosis
        The diagnosis of a structure, with its fits.
    """
    details, final = diagnosis.details, diagnosis.details.final.hypothesis
    offer = offered_model(diagnosis.verdict, final, details.measured, diagnosis.physics, diagnosis.improvement)
    if offer.nominal:
        return replace(details.base.hypothesis.shape.nominal, delay=details.delay)
    faults = tuple(
        {"name": cause.name, "location": dict(cause.location), "parameters": dict(cause.parameters)}
        for cause in diagnosis.physics
        if is_fault(cause.name)
    )
    return replace(improved_model(final, faults), delay=details.delay)


@dataclass(frozen=True)
class PairOfErrors:
    """What two models leave of the same recording, as shares of its root mean square response.

    Parameters
    ----------
    where
        Recording, or part of one, in words.
    nominal, improved
        Errors of the nominal and of the improved model.
    """

    where: str
    nominal: float
    improved: float

    @property
    def ratio(self) -> float:
        """Error of the improved over that of the nominal model; infinite where it cannot be simulated."""
        ratio = self.improved / max(self.nominal, 1e-300)
        return ratio if np.isfinite(ratio) else np.inf

    def sentence(self, subject: str) -> str:
        """Both errors in words, the improved model's behind ``subject``.

        Examples
        --------
        >>> PairOfErrors("high", 0.916, 1.09).sentence("it leaves")
        'it leaves 109 % of high, the nominal model 91.6 %'
        """
        return f"{subject} {100 * self.improved:.3g} % of {self.where}, the nominal model {100 * self.nominal:.3g} %"


@dataclass(frozen=True)
class OfferedModel:
    """Which model a diagnosis offers to predict with, and how it does beside the nominal one.

    Parameters
    ----------
    nominal
        Whether it is the nominal model itself.
    recordings
        Errors of the nominal model, and of the final fit to all recordings, on each of them.
    sentence
        What is to be known before one predicts with it; empty: nothing.
    """

    nominal: bool
    recordings: tuple[PairOfErrors, ...]
    sentence: str

    def content(self) -> dict[str, Any]:
        """What the file of a diagnosis says of it."""
        rows = [{"recording": one.where, "nominal": one.nominal, "final": one.improved} for one in self.recordings]
        return {"model": "nominal" if self.nominal else "final", "sentence": self.sentence, "recordings": rows}


def offered_model(
    verdict: str,
    final: Hypothesis,
    measured: Sequence[WindowedSpectrum],
    causes: Sequence[AcceptedCause],
    gain: Improvement,
) -> OfferedModel:
    """Choose the model that is offered: no worse than the nominal one on any recording, or with a word about it.

    What was accepted is confirmed on data held out. Under ``unexplained`` nothing is, and modes refitted to levels that
    no linear model holds may be right at none. They are offered where they leave less of what was held out than the
    nominal model, and of no recording more than :data:`WORSE` times as much.

    Parameters
    ----------
    verdict
        Verdict of the diagnosis.
    final
        Hypothesis of the final fit.
    measured
        Recordings as they were measured.
    causes
        Causes that are told; faults among them are put into what ``final`` predicts.
    gain
        Errors on what was held out.
    """
    faults = [cause for cause in causes if is_fault(cause.name)]
    pairs = tuple(_pair(final, one, faults) for one in measured)
    worse, unseen = [one for one in pairs if one.ratio > WORSE], PairOfErrors(gain.where, gain.before, gain.after)
    if verdict != "unexplained":
        each = "; ".join(one.sentence("it leaves") for one in worse)
        return OfferedModel(False, pairs, f"The improved model is worse than the nominal one: {each}." if worse else "")
    worse += [unseen] if unseen.ratio >= 1 else []
    if worse:
        worst = max(worse, key=lambda one: one.ratio)
        refitted = "refitted modes with a force of free form leave" if final.laws else "refitted modes leave"
        said = f"The improved model is the nominal model: {worst.sentence(refitted)}."
        return OfferedModel(True, pairs, said)
    held = "a joint's force of free form" if final.laws else "no law"
    said = f"The improved model holds refitted modes and {held}: {unseen.sentence('they leave')}."
    return OfferedModel(False, pairs, said)


def _pair(final: Hypothesis, lines: WindowedSpectrum, faults: Sequence[AcceptedCause]) -> PairOfErrors:
    """Errors of the nominal model and of a hypothesis on a recording as it was measured."""
    rests = residual_lines(final.nominal, lines), residual_lines(final, lines, faults)
    power = float(np.sum(np.abs(lines.measured) ** 2))
    nominal, improved = (float(np.sqrt(np.sum(np.abs(rest) ** 2) / power)) for rest in rests)
    return PairOfErrors(lines.recording.name, nominal, improved)


@dataclass(frozen=True)
class Prediction:
    """Predicted beside measured responses.

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
    """Simulate a recording's forces through a model and its terms of physics, from the first sample to the last.

    The simulation begins at rest. What the structure did before is unknown, and rings in the run-in.
    A limit (``clipping``) is applied to its channel. A steady tone (``unmeasured_excitation``) has no known phase in
    another recording; its amplitude and phase are read from the recording at that one frequency.

    Raises
    ------
    FileFormatError
        Terms that cannot be read.
    InputError
        A recording that the model cannot be compared with.
    """
    compile_kernels(*DIAGNOSIS)
    model, (trial,) = without_delay(in_deflections(model), [trial])
    hypothesis = hypothesis_of(model)
    band = band_of(model, trial.rate)
    decay = float((-model.poles.real).min())
    lines = windowed_spectrum(trial, band, decay)
    whole = lines.with_whole_forces()
    response = whole.signal(predict_lines(hypothesis, whole).spectrum)
    response = with_faults(response, trial, lines.start, model.physics)
    measured, shown = (lines.cut(signal) for signal in (trial.response, response))
    rest, power = np.abs(measured - shown) ** 2, np.abs(measured) ** 2
    return Prediction(
        np.asarray(response),
        lines.start,
        np.sqrt(rest.sum(axis=0) / power.sum(axis=0)),
        float(np.sqrt(rest.sum() / power.sum())),
        band,
    )


STEPS = 20
"""Steps at most of the last fit."""

BEYOND_NOISE = 1.5
"""Error held out, over the noise, from which more than noise is left: below it no fit is better than the likeliest."""


@dataclass(frozen=True)
class LastFit:
    """An answer whose improved model is fitted last with every recording counted alike, or as it was.

    Parameters
    ----------
    answer
        The answer that predicts.
    sentence
        What the last fit brings, in words; empty where it was not taken.
    """

    answer: Answer
    sentence: str = ""


def last_fit(
    answer: Answer, recordings: Recordings, faults: Sequence[AcceptedCause], settings: ProofSettings
) -> LastFit:
    """Fit the laws of an answer once more by shares of the response, and keep that if it predicts better.

    Names, numbers and errors that are told stay those of the likelihood. The fit is kept where it lowers both errors
    held out: the one that is told, and that of all recordings together.

    Parameters
    ----------
    answer
        The answer with textbook laws or with free forms.
    recordings
        The recordings, mended and as measured.
    faults
        Faults of the recordings that are told.
    settings
        Thresholds of the proof on held-out blocks.
    """
    before, final = answer.held_out, answer.final
    gain = before.improvement
    if not final.hypothesis.laws or not recordings.tested or gain.after < BEYOND_NOISE * gain.noise_floor:
        return LastFit(answer)
    begun = replace(final, hypothesis=before.improved, noises=())
    elsewhere = even_fit(recordings.others(recordings.mended), begun, iterations=STEPS)
    if not np.isfinite(elsewhere.score):
        return LastFit(answer)
    there = scored(recordings, (before.linear, elsewhere.hypothesis), final.noises, faults, settings)
    if not there.leaves_less_than(before):
        return LastFit(answer)
    again = even_fit(recordings.mended, final, iterations=STEPS)
    if not np.isfinite(again.score):
        return LastFit(answer)
    left = leftover(again.hypothesis, recordings.mended)
    return LastFit(replace(answer, final=again, held_out=there, left=left), _in_words(before, there))


def _in_words(before: HeldOut, there: HeldOut) -> str:
    """What the last fit brings."""
    old, new = (100 * one.everywhere.after for one in (before, there))
    return (
        "The improved model is fitted last by least squares in which every recording counts alike: of what was held "
        f"out in all of them it leaves {new:.3g} % instead of {old:.3g} %. Its numbers differ from those that are told."
    )


def equivalent_receptance(hypothesis: Hypothesis, lines: WindowedSpectrum, frequencies: Real) -> Frf:
    """Receptance with the causes that belong to the structure, joints linearised for the motion of one recording.

    A joint's law counts as the spring and damper that come closest to its force, ``k = <g x> / <x^2>`` and
    ``c = <g v> / <v^2>`` (statistical linearisation: Roberts & Spanos, Random Vibration and Statistical Linearization,
    chapter 5). Faults of the measuring chain are no part of the structure.

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
        often = max(1, len(answer.deflection) // lines.padded)
        kept = slice(lines.start * often, (lines.start + len(lines.window)) * often)
        x, v = answer.deflection, answer.velocity
        g = driven_force(lines, x, v, cause.law(), often=often)[kept]
        stiffness, damping = (float(g @ y[kept]) / float(y[kept] @ y[kept]) for y in (x, v))
        added += (stiffness + s * damping)[:, None, None] * np.outer(path.push, path.along)
    whole = np.linalg.solve(np.eye(receptance.shape[1]) + receptance @ added, receptance)
    closed = np.asarray(whole[:, :n, :m], dtype=complex)
    valid = np.ones(len(frequencies), dtype=bool)
    return Frf(frequencies, closed, model.responses, model.excitations, "receptance", "m/N", valid)
