"""Repair of faulty recordings before the search: clipping and foreign tones."""

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
from ..models.fitting import Fit, fit
from ..models.hypothesis import Hypothesis, predict_lines
from ..physics.library import library
from ..physics.measuring_chain import CLIPPING, UNMEASURED_EXCITATION
from ..physics.protocol import FaultPhysics
from .tones import Tone, find_tone, shown_signal, stands_out, tone_beside, tones_beyond, without_tone

LIMITS = np.linspace(0.25, 1.0, 76)
"""Limits that are tried, as shares of the largest value measured."""

ROUNDS = 12
"""Rounds of mending and refitting at most."""

SETTLED = 1e-3
"""Relative change of the error beside the limit at which mending stops."""

MEMORY = 4
"""Rounds from which the next is extrapolated."""


@dataclass(frozen=True)
class Clipping:
    """A response that cannot show more than a limit.

    Parameters
    ----------
    response
        Number of the clipped response among the responses, from 0.
    saturation
        Limit and sharpness of the channel, the limit in the unit of the response.
    gain
        Twice the logarithm of the likelihood that the limit gains.
    """

    response: int
    saturation: Saturation
    gain: float

    def of(self, signal: Real) -> Real:
        """What the channel shows of a signal (n,)."""
        return saturated(signal, self.saturation.limit, self.saturation.sharpness)


def find_clipping(fitted: Fit, lines: list[WindowedSpectrum], settings: FaultSettings = FAULTS) -> Clipping | None:
    """The response, if any, that follows its prediction only up to a limit.

    Parameters
    ----------
    fitted
        Fit whose prediction is compared with the responses.
    lines
        Recordings with their responses as measured.
    settings
        Thresholds of the tests for tones and clipping.
    """
    return _found([shown_signal(fitted, one) for one in lines], lines, settings)


def _found(predicted: list[Real], lines: list[WindowedSpectrum], settings: FaultSettings) -> Clipping | None:
    """The clearest limit of any response, its prediction in time known."""
    best: Clipping | None = None
    for p in range(lines[0].measured.shape[1]):
        measured, shown = _channel(predicted, lines, p)
        plain = float(np.sum((measured - shown) ** 2))
        for limit in float(np.abs(measured).max()) * LIMITS:
            pile = _held(measured, shown, limit, settings)
            if pile is None:
                continue
            clipped = float(np.sum((measured - np.clip(shown, -limit, limit)) ** 2))
            gain = len(measured) * float(np.log(plain / clipped))
            if gain > settings.limit_gain and (best is None or gain > best.gain):
                best = Clipping(p, Saturation(*pile), gain)
    return best


def _held(measured: Real, shown: Real, limit: float, settings: FaultSettings) -> tuple[float, float] | None:
    """Place and standard error of a limit; None where samples pass it, or those due beyond it do not stop there."""
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


def mended(
    fitted: Fit, lines: list[WindowedSpectrum], clipping: Clipping, settings: FaultSettings = FAULTS
) -> tuple[Fit, list[WindowedSpectrum], Clipping]:
    """Put back what the limit cut off, and refit, until both agree.

    Each round takes the cut part from the prediction of the round before. That prediction was fitted to a response
    that is too small, so the rounds converge slowly, and more slowly where more was cut. The next start is therefore
    extrapolated from the last few rounds (Anderson, J. ACM 12, 1965).

    Parameters
    ----------
    fitted
        Fit that was made without knowledge of the limit.
    lines
        Recordings as they were measured.
    clipping
        Limit that :func:`find_clipping` found.
    settings
        Thresholds of the tests for tones and clipping.

    Returns
    -------
    fitted, lines, clipping
        The fit, the mended recordings and the limit of the last round.
    """
    start, shown = fitted, [shown_signal(fitted, one) for one in lines]
    tried, reached, error = list[Real](), list[Real](), np.inf
    for _ in range(ROUNDS):
        tried.append(start.hypothesis.u)
        fitted = fit(_repaired(shown, lines, clipping), start.hypothesis, start.noises, iterations=4)
        reached.append(fitted.hypothesis.u)
        start, shown = fitted, [shown_signal(fitted, one) for one in lines]
        clipping = _again(shown, lines, clipping, settings)
        before, error = error, _error(shown, lines, clipping)
        if abs(before - error) < SETTLED * error:
            break
        ahead = replace(fitted, hypothesis=replace(fitted.hypothesis, u=_extrapolated(tried, reached)))
        farther = [shown_signal(ahead, one) for one in lines]
        if _error(farther, lines, clipping) < error:
            start, shown = ahead, farther
    repaired = _repaired(shown, lines, clipping)
    return fit(repaired, start.hypothesis, start.noises, iterations=4), repaired, clipping


def _extrapolated(tried: list[Real], reached: list[Real]) -> Real:
    """The numbers at which the rounds from ``tried`` to ``reached`` would end: their combination that changes least."""
    starts, ends = np.array(tried[-MEMORY:]), np.array(reached[-MEMORY:])
    if len(ends) < 2:
        return np.asarray(ends[-1])
    change = ends - starts
    weights = np.linalg.lstsq((change[:-1] - change[-1]).T, -change[-1], rcond=1e-8)[0]
    return np.asarray(ends[-1] + weights @ (ends[:-1] - ends[-1]))


def _error(predicted: list[Real], lines: list[WindowedSpectrum], clipping: Clipping) -> float:
    """Power of what the clipped prediction leaves of the response as measured."""
    measured, shown = _channel(predicted, lines, clipping.response)
    return float(np.sum((measured - clipping.of(shown)) ** 2))


def _repaired(predicted: list[Real], lines: list[WindowedSpectrum], clipping: Clipping) -> list[WindowedSpectrum]:
    """Recordings with what the limit cut off taken from the prediction."""
    p = clipping.response
    whole = []
    for one, signal in zip(lines, predicted, strict=True):
        response = one.recording.response.copy()
        response[:, p] += signal[:, p] - clipping.of(signal[:, p])
        whole.append(replace(one, recording=replace(one.recording, response=response), measured=one.cut(response)))
    return whole


def _again(
    predicted: list[Real], lines: list[WindowedSpectrum], clipping: Clipping, settings: FaultSettings
) -> Clipping:
    """The limit of the same channel as the better prediction shows it."""
    again = _found(predicted, lines, settings)
    found = again if again is not None and again.response == clipping.response else clipping
    sharp = replace(found.saturation, sharpness=np.inf)
    return replace(found, saturation=rounded(*_channel(predicted, lines, found.response), sharp))


def _channel(predicted: list[Real], lines: list[WindowedSpectrum], p: int) -> tuple[Real, Real]:
    """One response as measured and as predicted, all recordings, run-in left out."""
    measured = np.concatenate([one.recording.response[one.start :, p] for one in lines])
    return measured, np.concatenate([signal[one.start :, p] for one, signal in zip(lines, predicted, strict=True)])


def repair_faults(
    lines: list[WindowedSpectrum], base: Fit, settings: Settings
) -> tuple[list[WindowedSpectrum], Fit, list[AcceptedCause]]:
    """Take out tones and mend clipping, refitting each time.

    Parameters
    ----------
    lines
        Recordings as they were measured.
    base
        The fit without any cause.
    settings
        Thresholds of the diagnosis, those for faults among them.

    Returns
    -------
    lines, base, found
        Recordings as mended, the fit to them, and the faults as causes.
    """
    found: list[AcceptedCause] = []
    for _ in range(settings.faults.most_tones):
        tone = find_tone(base, lines, settings.faults)
        if tone is None or tone.gain < settings.evidence.least:
            break
        lines = [without_tone(base, one, tone) for one in lines]
        base = fit(lines, base.hypothesis, iterations=4)
        found.append(_tone_cause(tone, lines[0]))
    clipping = find_clipping(base, lines, settings.faults)
    if clipping is not None:
        base, lines, clipping = mended(base, lines, clipping, settings.faults)
        found.append(_clipping_cause(clipping, lines[0]))
    return lines, base, found


def with_tones_settled(
    fitted: Fit, lines: list[WindowedSpectrum], accepted: list[AcceptedCause], decay: float, settings: FaultSettings
) -> list[AcceptedCause]:
    """Accepted causes without tones that stood out only until the others were known, and with those above the band.

    Tones are told as the final fit leaves them. One whose amplitude differs much from recording to recording is not
    told: it follows the forces, as the harmonic of a joint does, or is chance in a band of noise.

    Parameters
    ----------
    fitted
        The fit with all causes.
    lines
        Recordings before tones were taken out.
    accepted
        Plain faults and causes.
    decay
        Decay rate of the slowest mode, 1/s.
    settings
        Thresholds of the tests for tones and clipping.
    """
    told: list[AcceptedCause] = []
    for cause in accepted:
        if cause.name != UNMEASURED_EXCITATION.name:
            told.append(cause)
            continue
        tone = tone_beside(fitted, lines, cause.parameters["frequency_hz"], cause.evidence)
        if stands_out(fitted, lines, tone.frequency, settings) and tone.is_steady(settings.most_varied, len(lines)):
            told.append(_tone_cause(tone, lines[0]))
    most = settings.most_tones - sum(cause.name == UNMEASURED_EXCITATION.name for cause in told)
    clipped = [cause.location["channel"] for cause in accepted if cause.name == CLIPPING.name]
    beyond = tones_beyond(fitted.hypothesis, lines, decay, most, settings, clipped)
    return told + [_tone_cause(tone, lines[0]) for tone in beyond]


def _tone_cause(tone: Tone, lines: WindowedSpectrum) -> AcceptedCause:
    names = lines.recording.channels[-len(tone.amplitudes) :]
    parameters = {"frequency_hz": tone.frequency}
    parameters |= {f"amplitude_{name}": float(value) for name, value in zip(names, tone.amplitudes, strict=True)}
    width = lines.recording.rate / len(lines.window)
    errors = {"frequency_hz": width * float(np.sqrt(6 / tone.gain)) / np.pi}
    known = [(name, float(one)) for name, one in zip(names, tone.spread, strict=True) if np.isfinite(one)]
    errors |= {f"amplitude_{name}": one for name, one in known}
    return AcceptedCause(UNMEASURED_EXCITATION.name, {"channels": list(names)}, parameters, errors, tone.gain)


def _clipping_cause(clipping: Clipping, lines: WindowedSpectrum) -> AcceptedCause:
    name = lines.recording.channels[clipping.response - lines.measured.shape[1]]
    found = clipping.saturation
    parameters, errors = {"limit": found.limit}, {"limit": found.error}
    if np.isfinite(found.sharpness):
        parameters["sharpness"], errors["sharpness"] = found.sharpness, found.sharpness_error
    return AcceptedCause(CLIPPING.name, {"channel": name}, parameters, errors, clipping.gain)


def with_faults(response: Real, recording: BandRecording, start: int, terms: Sequence[Mapping[str, Any]]) -> Real:
    """A predicted response with the faults of a recording: tones first, then limits.

    Parameters
    ----------
    response : (n_samples, n_responses)
        Predicted response without faults.
    recording
        The recording that has the faults.
    start
        First sample after the run-in.
    terms
        Causes as ``{name, location, parameters}``; those that are no faults are passed over.
    """
    known = library()
    faults = [(physics, term) for term in terms if isinstance(physics := known.get(term["name"]), FaultPhysics)]
    for physics, term in sorted(faults, key=lambda pair: pair[0].order):
        response = physics.shown(response, recording, start, term)
    return response


def residual_lines(hypothesis: Hypothesis, lines: WindowedSpectrum, faults: Sequence[AcceptedCause] = ()) -> Complex:
    """What a hypothesis, with the faults of a recording, leaves of it, (n_lines, n_responses).

    Parameters
    ----------
    hypothesis
        Hypothesis that predicts the response.
    lines
        Windowed lines of the recording.
    faults
        Tones and limits of the recording, which are put into the prediction.
    """
    predicted = predict_lines(hypothesis, lines)
    if not faults:
        return lines.measured - predicted.response
    signal = np.asarray(scipy.fft.irfft(predicted.spectrum, n=lines.padded, axis=0)[: len(lines.recording.force)])
    return lines.measured - lines.cut(
        with_faults(signal, lines.recording, lines.start, [asdict(one) for one in faults])
    )
