"""Every recording held out in turn from the final hypothesis: where its prediction is worst."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from estimation import WindowedSpectrum

from ..faults.clipping_repair import residual_lines
from ..inference.diagnosis import AcceptedCause, HeldOutError
from ..inference.search import in_processes
from ..models.fitting import Fit, fit
from ..models.misfit import known_noise, through_structure
from ..records.bands import Recordings
from .answer import Answer
from .held_out import DIVERGED_ERROR, HeldOut

STEPS = 8  # most steps of a fit without one recording, which starts from the fit to all

LEAST_RECORDINGS = 3  # of two recordings, the other one alone does not determine a law of the level


@dataclass(frozen=True)
class InTurn:
    """A result, and its errors on each recording when this recording is held out."""

    answer: Answer  # ``partly explained`` instead of ``explained`` if the causes fail on a recording
    errors: tuple[HeldOutError, ...]
    doubt: str = ""  # on which recording the causes fail; empty if on none


def held_out_in_turn(answer: Answer, recordings: Recordings, faults: Sequence[AcceptedCause]) -> InTurn:
    """Hold out each recording in turn; causes that predict one worse than the nominal model explain a part at most."""
    errors = errors_in_turn(answer, recordings, faults)
    doubt = worse_than_nominal(errors)
    if doubt and answer.verdict == "explained":
        answer = replace(answer, verdict="partly explained")
    return InTurn(answer, errors, doubt)


def errors_in_turn(answer: Answer, recordings: Recordings, faults: Sequence[AcceptedCause]) -> tuple[HeldOutError, ...]:
    """Fit the final hypothesis again without each recording in turn, and return its errors on that recording.

    The errors on the recording that the diagnosis held out are those of its own held-out fit. The result is empty if
    no cause is reported or if there are fewer than three recordings.
    """
    repaired, measured, final = recordings.repaired, recordings.measured, answer.final
    if not answer.causes or len(repaired) < LEAST_RECORDINGS:
        return ()
    if recordings.own_numbers:
        parts = recordings.held_out_elsewhere(measured)
        fitted = replace(final, hypothesis=answer.held_out.improved)
        errors = {k: _error(part, fitted, k, faults) for k, part in parts.items()}
        errors[recordings.held_out_place] = _own_error(answer.held_out)
        return tuple(errors[k] for k in sorted(errors))
    places = [k for k in range(len(repaired)) if k != recordings.held_out_place]
    fits = in_processes([partial(_fit_without, repaired, final, k) for k in places])
    errors = {
        k: _error(measured[k], replace(final, hypothesis=fitted.hypothesis), k, faults)
        for k, fitted in zip(places, fits, strict=True)
    }
    errors[recordings.held_out_place] = _own_error(answer.held_out)
    return tuple(errors[k] for k in sorted(errors))


def _fit_without(lines: list[WindowedSpectrum], final: Fit, place: int) -> Fit:
    """Fit the final hypothesis to all recordings except one; it stays unchanged if the simulation diverges."""
    others = [recording for k, recording in enumerate(lines) if k != place]
    noises = tuple(noise for k, noise in enumerate(final.noises) if k != place)
    fitted = fit(others, final.hypothesis, noises, iterations=STEPS)
    return fitted if np.isfinite(fitted.score) else final


def _error(lines: WindowedSpectrum, fitted: Fit, place: int, faults: Sequence[AcceptedCause]) -> HeldOutError:
    """Return the errors of the nominal model and of a fit on a recording, and the noise of the recording."""
    hypothesis = fitted.hypothesis
    power = float(np.sum(np.abs(lines.measured) ** 2))
    residuals = residual_lines(hypothesis.nominal, lines), residual_lines(hypothesis, lines, faults)
    before, after = (float(np.sqrt(np.sum(np.abs(residual) ** 2) / power)) for residual in residuals)
    noise = known_noise(lines, through_structure(hypothesis, lines), fitted.noises[place])
    floor = float(np.sqrt(np.trace(noise, axis1=1, axis2=2).real.sum() / power))
    return HeldOutError(lines.recording.name, before, after if np.isfinite(after) else DIVERGED_ERROR, floor)


def _own_error(held_out: HeldOut) -> HeldOutError:
    gain = held_out.improvement
    return HeldOutError(gain.held_out, gain.before, gain.after, gain.noise_floor)


def worse_than_nominal(errors: Sequence[HeldOutError]) -> str:
    """Return a sentence on the recording that the causes predict worse than the nominal model, or an empty text."""
    worse = [error for error in errors if error.after > error.before]
    if not worse:
        return ""
    worst = max(worse, key=lambda error: error.after / max(error.before, 1e-300))
    return (
        f"fitted without {worst.name}, the causes leave {100 * worst.after:.3g} % of it, the nominal model "
        f"{100 * worst.before:.3g} %: they do not hold there, so the answer is incomplete"
    )
