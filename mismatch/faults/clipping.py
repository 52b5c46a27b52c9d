"""A response that follows its prediction up to a limit and no farther: found, and mended."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation import WindowedSpectrum

from ..inference import FAULTS, FaultSettings
from ..joints import Saturation, rounded, saturated
from ..models import Fit, fit
from .tones import shown_signal

Real = NDArray[np.float64]

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
