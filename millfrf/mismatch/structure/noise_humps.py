"""Test whether inferred noise has a narrow hump, which a smooth spectrum of noise does not have."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from estimation import WindowedSpectrum
from millfrf.core import Real, listed

from ..models.first_motion import predict_lines
from ..models.fitting import Fit
from ..models.misfit import through_structure
from ..models.settings import RESIDUAL
from ..records.noise_model import inexactness, whitening

WIDTHS = (8, 16, 32, 64)  # lines over which the whitened residual is averaged

INDEPENDENT = 0.5  # independent lines for each line, as the window correlates neighbours


@dataclass(frozen=True)
class NoiseHump:
    """Narrow band in which the residual of a response is much larger than the noise inferred around it."""

    recordings: tuple[str, ...]  # those with a hump, that with the likeliest first
    response: str
    band: tuple[float, float]  # Hz
    ratio: float  # power over that of the noise
    share: float  # share of the power of the whitened residual beyond the noise

    @property
    def sentence(self) -> str:
        """Warning for the reader of a diagnosis."""
        (low, high), (first, *others) = self.band, self.recordings
        also = f"; also in {listed(others)}" if others else ""
        return (
            f"{100 * self.share:.0f} % of the residual of {self.response} in {first} lies between {low:.4g} and "
            f"{high:.4g} Hz, {self.ratio:.1f} times the noise around it{also}: look for a tone that no force sensor "
            "measures and whose frequency moves, such as hum or another machine, or for a mode that the model lacks"
        )


def find_hump(fitted: Fit, recordings: Sequence[WindowedSpectrum]) -> NoiseHump | None:
    r"""Return the likeliest hump of the recordings whose noise was inferred; None if there is none.

    The residual lines r, whitened by the inferred noise and the least error of sensors, which is proportional to the
    signal, have at most the mean power 1. With the correlation of neighbouring lines by the window, the mean over m
    lines of noise has a gamma distribution,

    .. math:: \bar w \sim \Gamma(m / 2,\ 2 / m)

    A hump has a mean that noise reaches in any band of any width with the probability ``burst_chance``, and holds at
    least the share ``burst_share`` of the power of the residual.

    Parameters
    ----------
    fitted, recordings
        Model with the inferred noise of each recording, and the recordings.
    """
    humps: list[tuple[float, NoiseHump]] = []
    for lines, noise in zip(recordings, fitted.noises, strict=True):
        if lines.noise is not None:
            continue
        covariance = noise.covariance(lines.frequencies, through_structure(fitted.hypothesis, lines))
        covariance = covariance + inexactness(lines.measured)[:, :, None] * np.eye(lines.measured.shape[1])
        residual = lines.measured - predict_lines(fitted.hypothesis, lines).response
        power = np.abs(np.einsum("kij,kj->ki", whitening(covariance), residual)) ** 2
        humps += sorted(_humps(lines, power), key=lambda pair: pair[0])[:1]
    humps.sort(key=lambda pair: pair[0])
    names = tuple(name for _, hump in humps for name in hump.recordings)
    return replace(humps[0][1], recordings=names) if humps else None


def _humps(lines: WindowedSpectrum, power: Real) -> Iterator[tuple[float, NoiseHump]]:
    """Yield each hump with the logarithm of its probability by chance; ``power`` is (n_lines, n_responses)."""
    most = np.log(RESIDUAL.burst_chance)
    for width in WIDTHS:
        first = np.arange(0, len(power) - width + 1, width // 2)
        if len(first) < 2:
            continue
        sums = np.cumsum(np.vstack([np.zeros(power.shape[1]), power]), axis=0)
        means = (sums[first + width] - sums[first]) / width
        shape = INDEPENDENT * width
        chance = scipy.stats.gamma.logsf(shape * means, shape) + np.log(means.size * len(WIDTHS))
        shares = (means - 1) * width / power.sum(axis=0)
        for k, p in np.argwhere((chance < most) & (shares >= RESIDUAL.burst_share)):
            band = float(lines.frequencies[first[k]]), float(lines.frequencies[first[k] + width - 1])
            name = lines.recording.responses[p].name
            hump = NoiseHump((lines.recording.name,), name, band, float(means[k, p]), float(shares[k, p]))
            yield float(chance[k, p]), hump
