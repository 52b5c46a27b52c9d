"""Tests whether a residual is the prediction with a gain or a delay that changes during or between recordings."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real, listed

from ..models.first_motion import predict_lines, solved
from ..models.hypothesis import Hypothesis
from ..models.settings import RESIDUAL
from .structured_residual import prediction_and_residual

PARTS = 8  # parts of a recording, each with a gain and a lag of its own

SHIFTS = np.linspace(0.1, 0.9, 33)  # shifts of the prediction in time, as shares of the recording

FADED = 0.1  # share of the recording that fades in and out


@dataclass(frozen=True)
class ChangeInTime:
    """Response whose gain or lag against the model changes during a recording."""

    recording: str
    response: str
    share: float  # share of the residual power that the changes explain beyond chance
    spread: float  # that share in standard deviations of chance


def sentences_of(changes: Sequence["ChangeInTime | ChangeBetween"]) -> tuple[str, ...]:
    """Return warnings for the reader of a diagnosis: one for each response that changes in time, and each other one."""
    during: dict[str, list[ChangeInTime]] = {}
    for change in changes:
        if isinstance(change, ChangeInTime):
            during.setdefault(change.response, []).append(change)
    between = (change.sentence for change in changes if isinstance(change, ChangeBetween))
    return (*(_sentence_in_time(response, alike) for response, alike in during.items()), *between)


def _sentence_in_time(response: str, changes: Sequence[ChangeInTime]) -> str:
    low, high = (f"{100 * end([change.share for change in changes]):.0f}" for end in (min, max))
    share, names = low if low == high else f"{low} to {high}", listed([change.recording for change in changes])
    return (
        f"{share} % of the residual of {response} in {names} is the predicted response with a gain and a delay that "
        f"change during the recording (at least {min(change.spread for change in changes):.0f} standard deviations "
        "beyond chance): look for lost samples, an amplifier that drifts or a structure that warms up"
    )


def changes_in_time(
    hypothesis: Hypothesis, recordings: Sequence[WindowedSpectrum], most: float
) -> tuple[ChangeInTime, ...]:
    r"""Return the responses whose gain or lag changes during a recording by more than chance.

    In part k of a recording, the residual r follows the predicted response y of the compared band,

    .. math:: r(t) = a_k\,y(t) + b_k\,\hat y(t) + \text{noise}

    with the Hilbert transform of y, so that a is an error of the gain and b a lag. The statistic is the power that this
    explains beyond the same a and b in all parts, as errors of a linear model do not change. Noise that passes through
    lightly damped modes resembles a prediction by chance; shifts of the prediction in time show how much. A single
    steady tone is the same after each shift, so that no change of its gain is significant.

    Parameters
    ----------
    hypothesis, recordings
        Model and windowed spectra.
    most
        Share of the residual power beyond chance from which a change is returned.
    """
    changes = []
    for lines in recordings:
        predicted, residual = (_in_band(signal, lines) for signal in prediction_and_residual(hypothesis, lines))
        for p, channel in enumerate(lines.recording.responses):
            rest, shown = residual[:, p], predicted[:, p]
            late = scipy.fft.irfft(-1j * scipy.fft.rfft(shown), n=len(shown))
            explained = _explained(rest, shown, late)
            shifts = (SHIFTS * len(rest)).astype(int)
            by_chance = np.array([_explained(rest, np.roll(shown, k), np.roll(late, k)) for k in shifts])
            share, scatter = explained - float(by_chance.mean()), float(by_chance.std(ddof=1))
            if share > most and share > RESIDUAL.change_errors * scatter:
                changes.append(ChangeInTime(lines.recording.name, channel.name, share, share / scatter))
    return tuple(changes)


# Least share of a residual that gains or delays of each recording explain. What a joint's law does to the prediction of
# each level explains less, as it changes the shape of the response and not its size alone (dry friction: an eighth).
LEAST_BETWEEN = 0.25

UNCHANGED = 0.05  # largest share of the residual of the other responses that gains of their own explain

ALIKE = 0.1  # delays of all responses are one delay if they agree to this share of their largest difference


@dataclass(frozen=True)
class ChangeBetween:
    """Gain of one response, or delay of all, that differs from recording to recording."""

    response: str  # response whose gain differs; empty: the delay of all responses
    changes: tuple[tuple[str, float], ...]  # each recording with its gain less 1, or its delay after the earliest, s
    share: float  # share of the residual power that the changes explain

    @property
    def sentence(self) -> str:
        """Warning for the reader of a diagnosis."""
        if self.response:
            gains = ", ".join(f"{100 * gain:+.2g} % in {name}" for name, gain in self.changes)
            return (
                f"{100 * self.share:.0f} % of the residual of {self.response} is a gain of this channel that differs "
                f"between the recordings ({gains}, against the model): look for a sensor, a range or a mounting that "
                "was changed between them"
            )
        delays = ", ".join(f"{1e3 * delay:.2g} ms in {name}" for name, delay in self.changes)
        return (
            f"{100 * self.share:.0f} % of the residual is a delay of all responses that differs between the recordings "
            f"({delays}, after the earliest): look for another filter, trigger or clock, or align the recordings"
        )


def changes_between(hypothesis: Hypothesis, recordings: Sequence[WindowedSpectrum]) -> tuple[ChangeBetween, ...]:
    r"""Return the response whose gain, or the delay of all responses, that differs between recordings.

    In recording k, the residual follows the predicted response y of the compared band as
    :math:`r(t) = a_k\,y(t) - \tau_k\,\dot y(t) + \text{noise}`. A structure that is not linear changes several
    responses, each by another gain and lag; a sensor changes one, and a trigger delays all of them alike. A mode that
    moves from recording to recording does so, too, where no other is near: poles of each recording are the rival, and
    must leave twice the power. Delays are first order: short against a period of the highest line that matters.

    Parameters
    ----------
    hypothesis, recordings
        Model and windowed spectra.
    """
    names = [channel.name for channel in recordings[0].recording.responses]
    if len(recordings) < 2 or len(names) < 2:
        return ()
    sums, power = np.zeros((5, len(recordings), len(names))), np.zeros(len(names))
    for k, lines in enumerate(recordings):
        shown, rest = (_in_band(signal, lines) for signal in prediction_and_residual(hypothesis, lines))
        rate = np.gradient(shown, 1 / lines.recording.rate, axis=0)
        products = np.stack([shown**2, shown * rate, rate**2, shown * rest, rate * rest])
        size = np.maximum(np.sum(shown**2, axis=0), 1e-300)  # loud recordings count as much as quiet ones
        sums[:, k], power = products.sum(axis=1) / size, power + np.sum(rest**2, axis=0) / size
    shares = (_power(sums).sum(axis=0) - _power(sums.sum(axis=1))) / np.maximum(power, 1e-300)
    (yy, yv, vv), right = sums[:3], np.moveaxis(sums[3:], 0, -1)[..., None]
    matrices = np.stack([np.stack([yy, yv], axis=-1), np.stack([yv, vv], axis=-1)], axis=-2)
    gains, rates = np.moveaxis((np.linalg.pinv(matrices) @ right)[..., 0], -1, 0)
    recorded = [lines.recording.name for lines in recordings]
    if not (shares > LEAST_BETWEEN).any() or not _leave_less_than_modes(hypothesis, recordings, shares > LEAST_BETWEEN):
        return ()
    largest, delays = int(np.argmax(shares)), rates.max(axis=0) - rates
    if shares[largest] > LEAST_BETWEEN and np.delete(shares, largest).max() < UNCHANGED:
        own = tuple(zip(recorded, gains[:, largest].tolist(), strict=True))
        return (ChangeBetween(names[largest], own, float(shares[largest])),)
    if shares.min() > LEAST_BETWEEN and np.ptp(delays, axis=1).max() < ALIKE * delays.max():
        common = tuple(zip(recorded, delays.mean(axis=1).tolist(), strict=True))
        return (ChangeBetween("", common, float(shares.mean())),)
    return ()


def _leave_less_than_modes(
    hypothesis: Hypothesis, recordings: Sequence[WindowedSpectrum], chosen: NDArray[np.bool_]
) -> bool:
    """Return whether gains and delays of the chosen responses leave half of what poles of each recording leave."""
    by_channels, by_poles = np.zeros(len(chosen)), np.zeros(len(chosen))
    shape = hypothesis.shape
    poles = (np.arange(shape.nominal_modes)[:, None] * shape.per_mode + np.arange(2)).ravel()
    for lines in recordings:
        shown = predict_lines(hypothesis, lines).response
        size = np.sqrt(np.mean(np.abs(lines.measured) ** 2, axis=0))
        rest = (lines.measured - shown) / size
        moved = shape.jacobian(hypothesis.u, lines.frequencies, lines.force_here)[..., poles]
        slopes = moved * (lines.kinematic / size)[..., None]
        by_poles += np.sum(np.abs(rest - _followed(slopes, rest[..., None])[..., 0]) ** 2, axis=0)
        own = np.stack([shown, 2j * np.pi * lines.frequencies[:, None] * shown], axis=-1) / size[:, None]
        for p in range(len(chosen)):
            left = rest[:, [p]] - _followed(own[:, [p]], rest[:, [p], None])[..., 0]
            by_channels[p] += np.sum(np.abs(left) ** 2)
    return bool((by_channels[chosen] < by_poles[chosen] / 2).all())


def _followed(slopes: Complex, rest: Complex) -> Complex:
    """Return the combination of slopes with real numbers that is closest to lines, (n_lines, n_responses, 1)."""
    scale = np.maximum(np.sqrt(np.sum(np.abs(slopes) ** 2, axis=(0, 1))), 1e-300)
    return np.asarray((slopes / scale) @ solved(slopes / scale, rest))


def _in_band(signal: Real, lines: WindowedSpectrum) -> Real:
    """Return a signal (n, n_responses) in the compared band, faded at its ends."""
    count = len(signal)
    spectrum = scipy.fft.rfft(signal * scipy.signal.windows.tukey(count, FADED)[:, None], axis=0)
    frequencies = scipy.fft.rfftfreq(count, 1 / lines.recording.rate)
    spectrum[(frequencies < lines.frequencies[0]) | (frequencies > lines.frequencies[-1])] = 0
    return np.asarray(scipy.fft.irfft(spectrum, n=count, axis=0))


def _explained(rest: Real, shown: Real, late: Real) -> float:
    """Return the share of the power of the residual that numbers of each part explain beyond common numbers."""
    first = np.linspace(0, len(rest), PARTS, endpoint=False).astype(int)
    products = np.stack([shown**2, shown * late, late**2, shown * rest, late * rest])
    sums = np.add.reduceat(products, first, axis=1)
    return float(_power(sums).sum() - _power(sums.sum(axis=1))) / max(float(rest @ rest), 1e-300)


def _power(sums: Real) -> Real:
    """Return the power that a combination of prediction and Hilbert transform explains.

    ``sums`` holds ``y^2``, ``y h``, ``h^2``, ``y r`` and ``h r``, (5, ...).
    """
    yy, yh, hh, yr, hr = sums
    determinant = yy * hh - yh**2
    explained = yr**2 * hh - 2 * yr * hr * yh + hr**2 * yy
    # a part without a prediction, such as the silence after a blow, explains nothing
    return np.asarray(np.where(determinant > 1e-12 * yy * hh, explained / np.maximum(determinant, 1e-300), 0.0))
