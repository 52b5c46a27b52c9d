"""Is what remains noise? Noise stays when the signal goes; an omission comes and goes with it."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import ShortTimeFFT
from scipy.signal.windows import hann

from estimation import WindowedSpectrum

from ..inference import Remainder
from ..models import Hypothesis, predict_lines, through_structure
from .cell_regression import moving_power
from .repeated_part import repeated_share
from .rest_in_time import shown_and_left

Real = NDArray[np.float64]

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
    transform = ShortTimeFFT(hann(length, sym=False), length // 2, lines.recording.rate)
    power = np.abs(transform.stft(signal, p0=1, p1=len(signal) // (length // 2))) ** 2
    inside = (transform.f >= lines.frequencies[0]) & (transform.f <= lines.frequencies[-1])
    return np.asarray(power[inside])
