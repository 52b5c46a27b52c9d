"""Tests whether a residual is noise: whether it follows the signal or repeats with the forces."""

import numpy as np
import scipy

from estimation import WindowedSpectrum, repeat_of
from millfrf.core import Real
from millfrf.core.compilation import compiled

from ..inference.diagnosis import Remainder
from ..models.hypothesis import Hypothesis, predict_lines
from ..models.misfit import shares_left, through_structure

RUNG_OUT = 5.0
"""Time constants of the slowest mode after which noise that rings in it is forgotten."""

MOST = 0.25
"""Share of a residual's power that must repeat before it counts: a small error of a refit repeats too."""


def repeated_share(hypothesis: Hypothesis, lines: WindowedSpectrum) -> Real:
    """Share of each response's residual power that repeats with the forces, (n_responses,); 0 below :data:`MOST`.

    The residual r of the compared band is multiplied with itself one period T of the forces later:
    ``share = <r(t) r(t + T)> / <r^2>``; noise does not repeat, and a linear or nonlinear omission does.

    Parameters
    ----------
    hypothesis
        Hypothesis that predicts the response.
    lines
        Windowed lines of one recording. All shares are 0 where its forces do not repeat.
    """
    nothing = np.zeros(lines.measured.shape[1])
    decay = float((-hypothesis.model.poles.real).min())
    lag = repeat_of(lines.recording.force, int(RUNG_OUT / decay * lines.recording.rate), len(lines.window) // 2)
    if lag is None:
        return nothing
    spectrum = np.zeros((len(lines.window) // 2 + 1, len(nothing)), dtype=complex)
    spectrum[lines.band] = lines.measured - predict_lines(hypothesis, lines).response
    rest = scipy.fft.irfft(spectrum, n=len(lines.window), axis=0)
    first, later = rest[:-lag], rest[lag:]
    power = np.mean(first**2 + later**2, axis=0) / 2
    share = np.mean(first * later, axis=0) / np.maximum(power, 1e-300)
    return np.asarray(np.where(share > MOST, share, 0.0))


def share_of_response(hypothesis: Hypothesis, lines: list[WindowedSpectrum]) -> float:
    """Root mean square of the residual as a share of the response's, over all channels and recordings.

    ``sqrt(mean_i sum_k |Y_ik - P_ik|^2 / sum_k |Y_ik|^2)`` over channels i of all recordings and lines k.

    Parameters
    ----------
    hypothesis
        What predicts the recordings.
    lines
        Windowed lines of the recordings.
    """
    return float(np.sqrt(np.mean([shares_left(hypothesis, one) for one in lines])))


def shown_and_left(hypothesis: Hypothesis, one: WindowedSpectrum) -> tuple[Real, Real]:
    """The predicted response and the residual, (n, n_responses) each, in the responses' units.

    The run-in is left out, and the last half second, in which the padding ends.

    Parameters
    ----------
    hypothesis
        What predicts the recording.
    one
        Windowed lines of the recording.
    """
    n = len(one.recording.force)
    shown = scipy.fft.irfft(predict_lines(hypothesis, one).spectrum, n=one.padded, axis=0)[:n]
    kept = slice(one.start, n - int(one.recording.rate) // 2)
    return np.asarray(shown[kept]), np.asarray((one.recording.response - shown)[kept])


@compiled(
    "(float64[:,::1], float64[:,::1], int64)",
)
def moving_power(rest: Real, shown: Real, bins: int) -> float:
    """Power of a residual that the prediction's power accounts for, in blocks of neighbouring bins.

    ``P_rest = a + b P_same cell + c P_all frequencies`` with a, b, c >= 0 by weighted least squares; cells of noise
    scatter like their level, so each is weighed by it, once from the mean and twice from the last fit.

    Parameters
    ----------
    rest, shown : (n_bins, n_segments)
        Power of the residual and of the prediction in cells of time and frequency.
    bins
        Number of neighbouring bins that share one noise level.
    """
    count = rest.shape[1]
    together = np.zeros(count)
    for k in range(len(shown)):
        together += shown[k] / len(shown)
    broad = max(together.mean(), 1e-300)
    moving = 0.0
    for start in range(0, len(rest), bins):
        stop = min(start + bins, len(rest))
        level = max(rest[start:stop].mean(), 1e-300)
        same = max(shown[start:stop].mean(), 1e-300)
        factors = np.array([level, 0.0, 0.0])
        flat = True
        for _ in range(3):
            matrix, target, column = np.zeros((3, 3)), np.zeros(3), np.ones(3)
            for k in range(start, stop):
                for t in range(count):
                    column[1], column[2] = shown[k, t] / same, together[t] / broad
                    expected = level if flat else max(float(np.sum(column * factors)), 0.1 * level)
                    for i in range(3):
                        target[i] += column[i] * rest[k, t] / expected**2
                        for j in range(3):
                            matrix[i, j] += column[i] * column[j] / expected**2
            factors = _not_negative(matrix, target)
            flat = False
        moving += (stop - start) * count * (factors[1] + factors[2])
    return moving


@compiled
def _not_negative(matrix: Real, target: Real) -> Real:
    """Least squares with factors of at least zero, from three normal equations: the best of all subsets."""
    best, lowest = np.zeros(3), 0.0
    for subset in range(1, 8):
        chosen = [k for k in range(3) if subset >> k & 1]
        part, right = np.empty((len(chosen), len(chosen))), np.empty(len(chosen))
        for a in range(len(chosen)):
            right[a] = target[chosen[a]]
            for b in range(len(chosen)):
                part[a, b] = matrix[chosen[a], chosen[b]]
            # columns may be all but equal
            part[a, a] *= 1.0 + 1e-12
        found = np.linalg.solve(part, right)
        cost = -float(np.sum(found * right))
        if found.min() >= 0.0 and cost < lowest:
            lowest = cost
            best[:] = 0.0
            for a in range(len(chosen)):
                best[chosen[a]] = found[a]
    return best


SEGMENT, FEWEST = 2.0, 6
"""Length of a segment, s: its bins lie half a hertz apart; least number of them in a record, which shortens them."""

BINS = 12
"""Neighbouring bins that share one noise level."""

SHIFTS, CHANCE = 14, 0.8
"""Times that the prediction is shifted against the residual, and the quantile of what it then carries: the noise of a
force rings in lightly damped modes, and so few independent swells are easily matched by chance."""

CLEAR, BOTH = 2.0, 3.0
"""Standard errors by which a residual must exceed measured noise, and the variance of their ratio over that of one
line: one from the residual, two from the noise of two periods, the fewest."""

EXACT = 0.01
"""Error, over the response, that is asked of no modal model: with strong signals noise lies far below it."""


def leftover(hypothesis: Hypothesis, lines: list[WindowedSpectrum]) -> Remainder:
    """How much of the residual moves with the predicted response.

    In cells of time and frequency the residual's power is regressed, with non-negative factors, on a constant (noise of
    that band), on the predicted power in the same cell and on the predicted power of all frequencies at the same time
    (what a nonlinearity spreads). The share is what the last two carry, less what they carry by chance, when the
    prediction is shifted in time against the residual. Where forces were replaced by what they say of the true ones,
    the forces as measured are tried too, and what moves with both counts: the replaced ones lack force where it swells
    from little, the measured ones bring their noise. Where forces repeat, the part of the residual that repeats with
    them counts too (:func:`repeated_share`): a steady test has no times of more and of less signal. Where noise was
    measured no chance is needed: all power above it is left over.

    Parameters
    ----------
    hypothesis
        The hypothesis with everything that was found.
    lines
        Windowed lines of the recordings.

    Returns
    -------
    Remainder
        Share of the residual's power beyond what chance may well make of noise, 0 to 1; size: as a share of the
        response's power, mean over channels and recordings, beyond what chance makes on average.
    """
    found = []
    for one in lines:
        if one.noise is not None:
            found.append(_above_noise(hypothesis, one))
            continue
        moving = _moving(hypothesis, one)
        measured = one.with_measured_forces()
        if not np.array_equal(measured.force_here, one.force_here):
            moving = np.minimum(moving, _moving(hypothesis, measured))
        found.append(np.maximum(moving, _repeating(hypothesis, one)))
    share, power = np.concatenate(found).mean(axis=0)
    return Remainder(float(share), float(power))


def _moving(hypothesis: Hypothesis, one: WindowedSpectrum) -> Real:
    """Share of the residual's power and of the response's that moves with the signal, (n_responses, 2)."""
    shown, rest = shown_and_left(hypothesis, one)
    found = []
    for p in range(rest.shape[1]):
        r, s = _powers(rest[:, p], one), _powers(shown[:, p], one)
        own = moving_power(r, s, BINS)
        shifted = [moving_power(r, np.roll(s, shift, axis=1), BINS) for shift in _shifts(s.shape[1])]
        whole, size = float(np.sum(r)), float(np.sum(s))
        share = np.clip(own - np.quantile(shifted, CHANCE), 0.0, whole) / whole
        found.append([share, np.clip(own - np.median(shifted), 0.0, whole) / size])
    return np.array(found)


def _above_noise(hypothesis: Hypothesis, one: WindowedSpectrum) -> Real:
    """Share of the residual's power and of the response's above the measured noise, (n_responses, 2)."""
    assert one.noise is not None
    rest = np.sum(np.abs(one.measured - predict_lines(hypothesis, one).response) ** 2, axis=0)
    whole = np.sum(np.abs(one.measured) ** 2, axis=0)
    covariance = one.noise.covariance(one.frequencies, through_structure(hypothesis, one))
    lines = np.einsum("kpp->kp", covariance).real
    noise = lines.sum(axis=0)
    # residual and noise are both known from as many lines as carry the noise's power
    spread = np.sqrt(BOTH * np.sum(lines**2, axis=0)) / noise
    own = noise * (1 + CLEAR * spread) + EXACT**2 * whole
    return np.column_stack([np.clip(1 - own / rest, 0.0, 1.0), np.maximum(rest - noise, 0.0) / whole])


def _repeating(hypothesis: Hypothesis, one: WindowedSpectrum) -> Real:
    """Share of the residual's power and of the response's that repeats with the forces, (n_responses, 2)."""
    share = repeated_share(hypothesis, one)
    if not share.any():
        return np.zeros((len(share), 2))
    rest = np.sum(np.abs(one.measured - predict_lines(hypothesis, one).response) ** 2, axis=0)
    return np.column_stack([share, share * rest / np.sum(np.abs(one.measured) ** 2, axis=0)])


def _shifts(count: int) -> list[int]:
    """Segments by which a prediction is turned in time."""
    return sorted({max(1, round(count * share)) for share in np.linspace(0.12, 0.88, SHIFTS)})


def _powers(signal: Real, lines: WindowedSpectrum) -> Real:
    """Power in cells, (n_bins, n_segments), in the band that is compared."""
    length = 2 * int(min(SEGMENT, lines.recording.duration / FEWEST) * lines.recording.rate / 2)
    transform = scipy.signal.ShortTimeFFT(
        scipy.signal.windows.hann(length, sym=False), length // 2, lines.recording.rate
    )
    power = np.abs(transform.stft(signal, p0=1, p1=len(signal) // (length // 2))) ** 2
    inside = (transform.f >= lines.frequencies[0]) & (transform.f <= lines.frequencies[-1])
    return np.asarray(power[inside])
