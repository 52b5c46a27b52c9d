"""Upper bounds of inferred noise: the residual itself, and the noise of the other recordings of the same rig."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from estimation import WindowedSpectrum
from millfrf.core import Real, listed

from ..inference.settings import VerdictSettings
from ..models.first_motion import predict_lines
from ..models.fitting import Fit
from ..models.hypothesis import Hypothesis
from ..models.misfit import through_structure
from ..models.settings import RESIDUAL


@dataclass(frozen=True)
class NoiseBounds:
    """Mean power of the lines of each recording and response: measured, residual, and largest possible noise.

    All arrays have the shape (n_recordings, n_responses).
    """

    response: Real
    residual: Real
    noise: Real  # largest possible noise power
    contradicted: Real  # whether the residual is more than the other recordings allow as noise

    @property
    def left(self) -> float:
        """Mean residual power of the responses, as a share of their power."""
        return float(np.mean(self.residual / np.maximum(self.response, 1e-300)))

    @property
    def beyond(self) -> float:
        """Mean residual power beyond noise of the responses, as a share of their power."""
        return float(np.mean((self.residual - self.noise) / np.maximum(self.response, 1e-300)))


def bounds_from_powers(response: Real, residual: Real, counts: Sequence[int]) -> NoiseBounds:
    """Return bounds of the noise of each recording and response, from mean powers (n_recordings, n_responses).

    Noise N is at most the residual R. With one rig and one setting of its sensors, the noise of a response is a
    constant plus a share of the signal power S, ``N = a + b S`` with a, b >= 0, so that for any two recordings

        N_i <= N_j max(1, S_i / S_j) <= R_j max(1, S_i / S_j)

    The logarithm of a mean power over n lines has the variance 1/n by chance (an F-test of two recordings has the
    freedoms 2 n_i and 2 n_j), and noise of one rig scatters between recordings (``noise_scatter``). A residual above
    this bound at a probability of ``noise_chance`` over all recordings and responses is not all noise: the rest of it
    beyond the mean bound is unexplained.

    Examples
    --------
    The last of three recordings leaves ten times as much power as the others allow.

    >>> bounds = bounds_from_powers(np.array([[1.0], [4.0], [16.0]]), np.array([[0.01], [0.04], [1.6]]), [900] * 3)
    >>> bounds.contradicted.ravel(), bounds.noise.ravel()
    (array([False, False,  True]), array([0.01, 0.04, 0.16]))
    """
    count = len(response)
    if count < 2:
        return NoiseBounds(response, residual, residual, np.zeros(residual.shape, dtype=bool))
    ratio = np.maximum(1.0, response[:, None] / np.maximum(response[None], 1e-300))
    allowed = np.where(np.eye(count, dtype=bool)[:, :, None], np.inf, residual[None] * ratio)
    mean = allowed.min(axis=1)
    chance = 1 / np.asarray(counts, dtype=float)
    spread = np.sqrt(2 * RESIDUAL.noise_scatter**2 + chance.max() + chance)[:, None]
    margin = np.exp(scipy.special.ndtri(1 - RESIDUAL.noise_chance / residual.size) * spread)
    contradicted = residual > margin * mean
    return NoiseBounds(response, residual, np.where(contradicted, mean, residual), contradicted)


def noise_bounds(hypothesis: Hypothesis, lines: Sequence[WindowedSpectrum]) -> NoiseBounds:
    """Return bounds of the noise of recordings under a hypothesis; where noise was measured, it counts instead."""
    responses = [np.mean(np.abs(recording.measured) ** 2, axis=0) for recording in lines]
    residuals = []
    for recording in lines:
        if recording.noise is None:
            rest = np.abs(recording.measured - predict_lines(hypothesis, recording).response) ** 2
        else:
            covariance = recording.noise.covariance(recording.frequencies, through_structure(hypothesis, recording))
            rest = np.einsum("kpp->kp", covariance).real
        residuals.append(np.mean(rest, axis=0))
    counts = [len(recording.frequencies) for recording in lines]
    return bounds_from_powers(np.array(responses), np.array(residuals), counts)


def with_bounded_noise(fitted: Fit, lines: Sequence[WindowedSpectrum]) -> Fit:
    """Return a fit whose inferred noise is within its bounds."""
    bounds = noise_bounds(fitted.hypothesis, lines)
    noises = tuple(replace(noise, most=most) for noise, most in zip(fitted.noises, bounds.noise, strict=True))
    return replace(fitted, noises=noises)


def leaves_beyond_noise(
    hypothesis: Hypothesis, base: Hypothesis, lines: Sequence[WindowedSpectrum], settings: VerdictSettings
) -> bool:
    """Return whether a hypothesis leaves more beyond noise than a complete explanation may.

    A complete explanation removes the share ``explained`` of what the modes alone (``base``) leave.
    """
    bounds = noise_bounds(hypothesis, lines)
    return bounds.beyond > (1 - settings.explained) * noise_bounds(base, lines).left


def contradictions(hypothesis: Hypothesis, lines: Sequence[WindowedSpectrum]) -> tuple[str, ...]:
    """Return a sentence on each recording whose residual is more than the other recordings allow as noise."""
    bounds, sentences = noise_bounds(hypothesis, lines), []
    for k, recording in enumerate(lines):
        which = np.flatnonzero(bounds.contradicted[k])
        if not len(which):
            continue
        rest, most = (np.sqrt(power[k] / bounds.response[k]) for power in (bounds.residual, bounds.noise))
        names = [
            f"{100 * rest[p]:.2g} % of {recording.recording.responses[p].name} (noise {100 * most[p]:.2g} %)"
            for p in which
        ]
        sentences.append(
            f"the model leaves more of {recording.recording.name} than the noise of the other recordings allows: "
            f"{listed(names)}; the difference counts as unexplained"
        )
    return tuple(sentences)
