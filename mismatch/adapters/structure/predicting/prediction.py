"""The model that a diagnosis offers to predict with, and the responses that a model gives for a recording's forces."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation import BandRecording, WindowedSpectrum, windowed_spectrum
from modal_fit import ModalModel

from ....faults import residual_lines, with_faults
from ....inference import AcceptedCause, Improvement
from ....location import StructureDiagnosis
from ....models import Hypothesis, hypothesis_of, improved_model, predict_lines
from ....physics import is_fault
from ....records import band_of, in_deflections, without_delay

Real = NDArray[np.float64]

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
