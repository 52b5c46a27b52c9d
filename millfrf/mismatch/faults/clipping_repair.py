"""Repair of recordings with clipping or extraneous tones before the search for causes."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import scipy

from estimation import BandRecording, WindowedSpectrum
from millfrf.core import Complex, Real

from ..inference.diagnosis import AcceptedCause
from ..inference.settings import FAULTS, FaultSettings, Settings
from ..joints.joint_law import Saturation, rounded, saturated
from ..models.first_motion import predict_lines
from ..models.fitting import Fit, fit
from ..models.hypothesis import Hypothesis
from ..physics.library import library
from ..physics.protocol import FaultPhysics
from ..physics.recording_faults import CLIPPING, UNMEASURED_EXCITATION
from .measuring_chain import correct_skew
from .tones import Tone, find_tone, has_contrast, predicted_signal, tone_of_residual, tones_above_band, without_tone

LIMIT_SHARES = np.linspace(0.25, 1.0, 76)  # tested limits, as shares of the largest measured value

ROUNDS = 12  # most rounds of repair and refit

CONVERGED = 1e-3  # relative change of the error at which the repair has converged

MEMORY = 4  # number of previous rounds from which the start of the next round is extrapolated


@dataclass(frozen=True)
class Clipping:
    """A response channel with a limit that clips it."""

    response: int
    saturation: Saturation  # limit and sharpness of the channel, the limit in the unit of the response
    gain: float

    def of(self, signal: Real) -> Real:
        """Return the output of the channel for a signal (n,)."""
        return saturated(signal, self.saturation.limit, self.saturation.sharpness)


def find_clipping(fitted: Fit, lines: list[WindowedSpectrum], settings: FaultSettings = FAULTS) -> Clipping | None:
    """Return the response that follows its prediction only up to a limit; None if there is none."""
    return _clearest_limit([predicted_signal(fitted, recording) for recording in lines], lines, settings)


def _clearest_limit(predicted: list[Real], lines: list[WindowedSpectrum], settings: FaultSettings) -> Clipping | None:
    """Return the clearest limit of any response, from its predictions in time."""
    best: Clipping | None = None
    for p in range(lines[0].measured.shape[1]):
        measured, shown = _channel(predicted, lines, p)
        plain = float(np.sum((measured - shown) ** 2))
        for limit in float(np.abs(measured).max()) * LIMIT_SHARES:
            pile = _limit_estimate(measured, shown, limit, settings)
            if pile is None:
                continue
            clipped = float(np.sum((measured - np.clip(shown, -limit, limit)) ** 2))
            gain = len(measured) * float(np.log(plain / clipped))
            if gain > settings.limit_gain and (best is None or gain > best.gain):
                best = Clipping(p, Saturation(*pile), gain)
    return best


def _limit_estimate(measured: Real, shown: Real, limit: float, settings: FaultSettings) -> tuple[float, float] | None:
    """Return value and standard error of a limit; None if measured samples exceed it or do not accumulate at it."""
    beyond = np.abs(shown) > settings.beyond * limit
    if beyond.sum() < settings.least_beyond or np.quantile(np.abs(measured), 0.9995) > 1.2 * limit:
        return None
    due, pile = np.abs(shown[beyond]), measured[beyond] * np.sign(shown[beyond])
    if np.quantile(pile, 0.25) < 0.9 * limit or np.quantile(pile, 0.98) > 1.15 * limit:
        return None
    spread = due - due.mean()
    slope = float(np.sum(spread * pile) / np.sum(spread**2))
    if abs(slope) > settings.follows:
        return None
    return float(np.median(pile)), float(np.sqrt(np.pi / 2 / len(pile)) * pile.std())


def repair_clipping(
    fitted: Fit, lines: list[WindowedSpectrum], clipping: Clipping, settings: FaultSettings = FAULTS
) -> tuple[Fit, list[WindowedSpectrum], Clipping]:
    """Replace clipped samples by predictions and refit, round by round until convergence.

    Each round takes the clipped samples from the prediction of the previous round. This prediction was fitted to a
    response that was still too small, so that the rounds converge slowly. The next start is therefore extrapolated from
    the last few rounds (Anderson, J. ACM 12, 1965).
    The result is the fit, the repaired recordings and the limit of the last round.
    """
    start, shown = fitted, [predicted_signal(fitted, recording) for recording in lines]
    starts, ends, error = list[Real](), list[Real](), np.inf
    for _ in range(ROUNDS):
        starts.append(start.hypothesis.u)
        fitted = fit(_repaired(shown, lines, clipping), start.hypothesis, start.noises, iterations=4)
        ends.append(fitted.hypothesis.u)
        start, shown = fitted, [predicted_signal(fitted, recording) for recording in lines]
        clipping = _updated_limit(shown, lines, clipping, settings)
        before, error = error, _error(shown, lines, clipping)
        if abs(before - error) < CONVERGED * error:
            break
        extrapolated = replace(fitted, hypothesis=replace(fitted.hypothesis, u=_extrapolated(starts, ends)))
        extrapolated_signals = [predicted_signal(extrapolated, recording) for recording in lines]
        if _error(extrapolated_signals, lines, clipping) < error:
            start, shown = extrapolated, extrapolated_signals
    repaired = _repaired(shown, lines, clipping)
    return fit(repaired, start.hypothesis, start.noises, iterations=4), repaired, clipping


def _extrapolated(tried: list[Real], reached: list[Real]) -> Real:
    """Extrapolate the numbers to which the rounds converge.

    Each round begins with numbers ``tried`` and ends with numbers ``reached``. The result is the combination of the
    last rounds for which this change is smallest.
    """
    starts, ends = np.array(tried[-MEMORY:]), np.array(reached[-MEMORY:])
    if len(ends) < 2:
        return np.asarray(ends[-1])
    change = ends - starts
    weights = np.linalg.lstsq((change[:-1] - change[-1]).T, -change[-1], rcond=1e-8)[0]
    return np.asarray(ends[-1] + weights @ (ends[:-1] - ends[-1]))


def _error(predicted: list[Real], lines: list[WindowedSpectrum], clipping: Clipping) -> float:
    """Return the power of the measured response minus the clipped prediction."""
    measured, shown = _channel(predicted, lines, clipping.response)
    return float(np.sum((measured - clipping.of(shown)) ** 2))


def _repaired(predicted: list[Real], lines: list[WindowedSpectrum], clipping: Clipping) -> list[WindowedSpectrum]:
    """Return recordings with the clipped part taken from the prediction."""
    p = clipping.response
    result = []
    for recording, signal in zip(lines, predicted, strict=True):
        response = recording.recording.response.copy()
        response[:, p] += signal[:, p] - clipping.of(signal[:, p])
        result.append(
            replace(
                recording, recording=replace(recording.recording, response=response), measured=recording.cut(response)
            )
        )
    return result


def _updated_limit(
    predicted: list[Real], lines: list[WindowedSpectrum], clipping: Clipping, settings: FaultSettings
) -> Clipping:
    """Return the limit of the channel, estimated again from a better prediction."""
    updated = _clearest_limit(predicted, lines, settings)
    current = updated if updated is not None and updated.response == clipping.response else clipping
    sharp = replace(current.saturation, sharpness=np.inf)
    return replace(current, saturation=rounded(*_channel(predicted, lines, current.response), sharp))


def _channel(predicted: list[Real], lines: list[WindowedSpectrum], p: int) -> tuple[Real, Real]:
    """Return one response as measured and as predicted, of all recordings, without the run-in."""
    measured = np.concatenate([recording.recording.response[recording.start :, p] for recording in lines])
    return measured, np.concatenate(
        [signal[recording.start :, p] for recording, signal in zip(lines, predicted, strict=True)]
    )


def repair_faults(
    lines: list[WindowedSpectrum], base: Fit, settings: Settings
) -> tuple[list[WindowedSpectrum], Fit, list[AcceptedCause]]:
    """Correct the clock of the responses, remove tones and repair clipping, with a refit after each.

    The result is the repaired recordings, the fit to them, and the faults as causes.
    """
    lines, base, skews = correct_skew(lines, base, settings)
    faults = list(skews)
    for _ in range(settings.faults.most_tones):
        tone = find_tone(base, lines, settings.faults)
        if tone is None or tone.gain < settings.evidence.least:
            break
        lines = [without_tone(base, recording, tone) for recording in lines]
        base = fit(lines, base.hypothesis, iterations=4)
        faults.append(_tone_cause(tone, lines[0]))
    clipping = find_clipping(base, lines, settings.faults)
    if clipping is not None:
        base, lines, clipping = repair_clipping(base, lines, clipping, settings.faults)
        faults.append(_clipping_cause(clipping, lines[0]))
    return lines, base, faults


def with_final_tones(
    fitted: Fit, lines: list[WindowedSpectrum], accepted: list[AcceptedCause], decay: float, settings: FaultSettings
) -> list[AcceptedCause]:
    """Return the causes with the tones that remain under the final fit, and with tones above the band.

    A tone that no longer stands out under the final fit is dropped. A tone whose amplitude varies much between
    recordings is also dropped: it is caused by the forces, like a harmonic due to a joint, or by noise.

    ``decay``: decay rate of the slowest mode, 1/s.
    """
    reported: list[AcceptedCause] = []
    for cause in accepted:
        if cause.name != UNMEASURED_EXCITATION.name:
            reported.append(cause)
            continue
        tone = tone_of_residual(fitted, lines, cause.parameters["frequency_hz"], cause.evidence)
        if has_contrast(fitted, lines, tone.frequency, settings) and tone.is_steady(settings.most_varied, len(lines)):
            reported.append(_tone_cause(tone, lines[0]))
    largest_number = settings.most_tones - sum(cause.name == UNMEASURED_EXCITATION.name for cause in reported)
    clipped = [cause.location["channel"] for cause in accepted if cause.name == CLIPPING.name]
    tones_above = tones_above_band(fitted.hypothesis, lines, decay, largest_number, settings, clipped)
    return reported + [_tone_cause(tone, lines[0]) for tone in tones_above]


def _tone_cause(tone: Tone, lines: WindowedSpectrum) -> AcceptedCause:
    names = lines.recording.channels[-len(tone.amplitudes) :]
    parameters = {"frequency_hz": tone.frequency}
    parameters |= {f"amplitude_{name}": float(value) for name, value in zip(names, tone.amplitudes, strict=True)}
    width = lines.recording.rate / len(lines.window)
    errors = {"frequency_hz": width * float(np.sqrt(6 / tone.gain)) / np.pi}
    known = [(name, float(error)) for name, error in zip(names, tone.spread, strict=True) if np.isfinite(error)]
    errors |= {f"amplitude_{name}": error for name, error in known}
    return AcceptedCause(UNMEASURED_EXCITATION.name, {"channels": list(names)}, parameters, errors, tone.gain)


def _clipping_cause(clipping: Clipping, lines: WindowedSpectrum) -> AcceptedCause:
    name = lines.recording.channels[clipping.response - lines.measured.shape[1]]
    saturation = clipping.saturation
    parameters, errors = {"limit": saturation.limit}, {"limit": saturation.error}
    if np.isfinite(saturation.sharpness):
        parameters["sharpness"], errors["sharpness"] = saturation.sharpness, saturation.sharpness_error
    return AcceptedCause(CLIPPING.name, {"channel": name}, parameters, errors, clipping.gain)


def with_faults(response: Real, recording: BandRecording, start: int, terms: Sequence[Mapping[str, Any]]) -> Real:
    """Return a predicted response with the faults of a recording: tones first, then limits.

    ``response``: predicted response without faults, (n_samples, n_responses).
    """
    known = library()
    faults = [(physics, term) for term in terms if isinstance(physics := known.get(term["name"]), FaultPhysics)]
    for physics, term in sorted(faults, key=lambda pair: pair[0].order):
        response = physics.shown(response, recording, start, term)
    return response


def residual_lines(hypothesis: Hypothesis, lines: WindowedSpectrum, faults: Sequence[AcceptedCause] = ()) -> Complex:
    """Return the residual of a hypothesis with the faults of a recording, (n_lines, n_responses)."""
    predicted = predict_lines(hypothesis, lines)
    if not faults:
        return lines.measured - predicted.response
    signal = np.asarray(scipy.fft.irfft(predicted.spectrum, n=lines.padded, axis=0)[: len(lines.recording.force)])
    return lines.measured - lines.cut(
        with_faults(signal, lines.recording, lines.start, [asdict(fault) for fault in faults])
    )
