"""Noise of responses and forces as recordings show it, without a model."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from millfrf.core import Complex, InputError, Real

from ..band_recordings.band_recording import BandRecording
from ..local_polynomials import local_half_width, local_polynomial
from .period_search import find_repeats

PERIODS = "periods"
REPEATS = "repeats"
SILENCE = "silence"
BOUND = "local polynomial, an upper bound"

ENOUGH = 8
"""Degrees of freedom behind a line, over the number of channels, up to which neighbouring lines are averaged."""


@dataclass(frozen=True)
class MeasuredNoise:
    """Covariance of the noise of forces and responses at each line.

    Spectra are ``rfft(w x)`` with ``sum w^2 = 1``: white noise of variance v has variance v a line whatever the length.
    This is the scale of :class:`WindowedSpectrum`; the one-sided power spectral density is ``2 v / rate``.

    Parameters
    ----------
    frequencies : (n_lines,), Hz
        Frequencies of the lines, rising.
    rate : Hz
        Sample rate of the recordings.
    responses : (n_lines, n_responses, n_responses)
        Covariance of the responses' noise, ``E[n_p conj(n_q)]``, SI.
    forces : (n_lines, n_excitations, n_excitations)
        Covariance of the forces' noise; zero where the kind cannot tell it from the responses'.
    cross : (n_lines, n_responses, n_excitations)
        Covariance of responses with forces.
    kind
        ``periods``, ``repeats``, ``silence``, or ``local polynomial, an upper bound``.
    freedom
        Complex degrees of freedom behind the covariance of a line: variances spread by ``1 / sqrt(freedom)``.
    response_share : (n_responses,)
        Noise of each response over what it repeats, root mean squares over the lines.
    force_share : (n_excitations,)
        The same of each force.
    statement
        One sentence that says on what the noise rests.
    """

    frequencies: Real
    rate: float
    responses: Complex
    forces: Complex
    cross: Complex
    kind: str
    freedom: float
    response_share: Real
    force_share: Real
    statement: str

    @property
    def upper_bound(self) -> bool:
        """Whether distortion is counted as noise."""
        return self.kind == BOUND

    def at(self, frequencies: Real, rate: float | None = None) -> "MeasuredNoise":
        """The same noise at other lines (Hz), linear in between, and at another sample rate (Hz).

        Raises
        ------
        InputError
            Lines outside those that were measured, by more than one spacing.
        """
        own, wanted = self.frequencies, np.asarray(frequencies, dtype=float)
        slack = float(np.diff(own).max()) if len(own) > 1 else 0.0
        if wanted.min() < own[0] - slack - 1e-9 or wanted.max() > own[-1] + slack + 1e-9:
            raise InputError(
                f"noise is known from {own[0]:.4g} to {own[-1]:.4g} Hz, not from {wanted.min():.4g} to "
                f"{wanted.max():.4g} Hz; measure it in that band"
            )
        scale = 1.0 if rate is None else rate / self.rate
        parts = [_interpolated(own, part, wanted) * scale for part in (self.responses, self.forces, self.cross)]
        return replace(
            self, frequencies=wanted, rate=rate or self.rate, responses=parts[0], forces=parts[1], cross=parts[2]
        )

    def covariance(self, frequencies: Real, through: Complex) -> Complex:
        """Covariance of the residual ``x - G f`` at lines, ``[1, -G] C [1, -G]^H``.

        Parameters
        ----------
        frequencies : (n,), Hz
            Frequencies of the lines.
        through : (n, n_responses, n_excitations)
            Matrix G from forces to responses at the lines.

        Returns
        -------
        (n, n_responses, n_responses)
        """
        here = self.at(frequencies)
        return residual_covariance(here.responses, here.forces, here.cross, through)

    def response_level(self) -> Real:
        """Root mean square noise of each response over the lines, (n_responses,), SI."""
        return np.asarray(np.sqrt(np.einsum("kpp->kp", self.responses).real.mean(axis=0)))


def residual_covariance(responses: Complex, forces: Complex, cross: Complex, through: Complex) -> Complex:
    """Covariance (n_lines, n, n) of ``x - G f`` from those of x, f, and x with f; ``through`` is G, (n_lines, n, m)."""
    mixed = cross @ _adjoint(through)
    return np.asarray(responses - mixed - _adjoint(mixed) + through @ forces @ _adjoint(through))


def averaged_lines(covariance: Complex, freedom: int) -> tuple[Complex, float]:
    """Covariances (n_lines, n, n) averaged over neighbouring lines, and the degrees of freedom behind each.

    As many lines to either side as :data:`ENOUGH` degrees of freedom a channel need.
    """
    n_lines, n = covariance.shape[:2]
    half = int(np.ceil((ENOUGH * n / freedom - 1) / 2)) if freedom < ENOUGH * n else 0
    half = min(half, (n_lines - 1) // 2)
    if half == 0:
        return covariance, float(freedom)
    total = np.concatenate([np.zeros((1, n, n)), np.cumsum(covariance, axis=0)])
    first = np.clip(np.arange(n_lines) - half, 0, n_lines - 1 - 2 * half)
    width = 2 * half + 1
    return np.asarray((total[first + width] - total[first]) / width), float(freedom * width)


def parted(joint: Complex, n_excitations: int) -> tuple[Complex, Complex, Complex]:
    """Covariances of responses, of forces, and of responses with forces, from the joint one, forces first."""
    m = n_excitations
    return joint[:, m:, m:], joint[:, :m, :m], joint[:, m:, :m]


def _adjoint(matrices: Complex) -> Complex:
    return np.asarray(matrices.conj().transpose(0, 2, 1))


def _interpolated(own: Real, values: Complex, wanted: Real) -> Complex:
    if len(own) == 1:
        return np.repeat(values, len(wanted), axis=0)
    right = np.clip(np.searchsorted(own, wanted), 1, len(own) - 1)
    share = np.clip((wanted - own[right - 1]) / (own[right] - own[right - 1]), 0.0, 1.0)[:, None, None]
    return np.asarray((1 - share) * values[right - 1] + share * values[right])


QUIET = 0.05
"""Force over its root mean square in the recording below which a block is silent."""

RUNG_OUT = 1.5
"""Power of a response in a silent block, over the middle of the quieter half of blocks, from which it still rings."""

FEWEST = 4
"""Silent blocks at least."""


def noise_in_silence(
    recordings: Sequence[BandRecording], band: tuple[float, float], block: float | None = None
) -> MeasuredNoise | None:
    """Noise in blocks without force, once the structure has rung out; None where there are fewer than four.

    The covariance is the mean of those of the Hann-windowed blocks. A silent structure is not the one that works:
    noise that comes with the force (cables that move, range of the converter) is not seen.

    Parameters
    ----------
    recordings
        Recordings of the same channels and sample rate.
    band : Hz
        Lowest and highest frequency of the lines.
    block : s
        Length of a block; None: eight lines within the band, or a quarter of a second where that is longer.
    """
    first = recordings[0]
    seconds = max(8.0 / (band[1] - band[0]), 0.25, 2.0 / band[0]) if block is None else block
    n = round(seconds * first.rate)
    window = np.hanning(n + 1)[:-1, None]
    window = window / np.sqrt(np.sum(window**2))
    spectra = [
        scipy.fft.rfft((cut - cut.mean(axis=0)) * window, axis=0)
        for one in recordings
        for cut in _silent_blocks(one, n)
    ]
    if len(spectra) < FEWEST:
        return None
    frequencies = np.arange(n // 2 + 1) * first.rate / n
    kept = (frequencies >= band[0]) & (frequencies <= band[1])
    lines = np.array(spectra)[:, kept].transpose(1, 2, 0)
    m = first.force.shape[1]
    averaged, freedom = averaged_lines(lines @ lines.conj().transpose(0, 2, 1) / len(spectra), len(spectra))
    level = _levels(recordings, band)
    own = np.sqrt(np.einsum("kpp->kp", averaged).real.mean(axis=0)) / level
    responses, forces, cross = parted(averaged, m)
    said = (
        f"{len(spectra)} blocks of {n / first.rate:.3g} s without force (below {100 * QUIET:g} % of its root mean "
        "square), after the structure rang out; noise that comes with the force is not in it."
    )
    return MeasuredNoise(
        frequencies[kept], first.rate, responses, forces, cross, SILENCE, freedom, own[m:], own[:m], said
    )


def noise_bound(recordings: Sequence[BandRecording], band: tuple[float, float]) -> MeasuredNoise:
    """Upper bound of the noise: what forces do not explain in narrow bands, in the responses alone.

    Around each line the response is a polynomial FRF times the forces and a polynomial transient
    (:func:`local_polynomial`); the misfit holds noise of responses and forces, and all distortion that is not smooth in
    frequency. Forces must be rough in frequency.

    Parameters
    ----------
    recordings
        Recordings of the same channels and sample rate; all are cut to the shortest.
    band : Hz
        Lowest and highest frequency of the lines.

    Raises
    ------
    InputError
        See :func:`local_polynomial`; forces that repeat, or that are dependent at every line.
    """
    for one in recordings:
        if find_repeats(one.force) is not None:  # few lines are excited, and their FRF takes up all that they hold
            raise InputError(f"{one.name}: the forces repeat, and this would be no bound; use noise_of_periods")
    frf = local_polynomial(recordings, band)
    if frf.covariance is None or not frf.valid.any():
        raise InputError(f"forces are dependent at every line from {band[0]:g} to {band[1]:g} Hz; excite them apart")
    m, tests = frf.values.shape[2], len(recordings)
    freedom = (2 * local_half_width(tests, m) + 1) * tests - 3 * (m + tests)
    covariance = frf.covariance.response[frf.valid]
    averaged, behind = averaged_lines(covariance, freedom)
    own = np.sqrt(np.einsum("kpp->kp", averaged).real.mean(axis=0)) / _levels(recordings, band)[m:]
    none = np.zeros((len(averaged), m, m), dtype=complex)
    said = (
        f"What {tests} recording{'s' if tests > 1 else ''} leave of a local polynomial FRF and transient in bands of "
        f"{2 * local_half_width(tests, m) + 1} lines: an upper bound, because distortion is counted as noise."
    )
    return MeasuredNoise(
        frf.frequencies[frf.valid],
        recordings[0].rate,
        averaged,
        none,
        np.zeros((len(averaged), averaged.shape[1], m), dtype=complex),
        BOUND,
        behind,
        own,
        np.full(m, np.nan),
        said,
    )


def _silent_blocks(recording: BandRecording, n: int) -> list[Real]:
    """Blocks (n, n_channels) without force in which no response rings any more."""
    force = recording.force - np.median(recording.force, axis=0)
    power = np.sum(force**2, axis=1)
    limit = QUIET**2 * power.mean()
    joint = np.concatenate([recording.force, recording.response], axis=1)
    quiet = [
        joint[first : first + n]
        for first in range(0, len(power) - n + 1, n)
        if limit > 0 and power[first : first + n].mean() < limit and power[first : first + n].max() < 25 * limit
    ]
    if len(quiet) < FEWEST:
        return []
    level = np.array([cut[:, force.shape[1] :].var(axis=0) for cut in quiet])
    usual = np.median(np.sort(level, axis=0)[: (len(level) + 1) // 2], axis=0)
    return [cut for cut, own in zip(quiet, level, strict=True) if np.all(own <= RUNG_OUT * usual)]


def _levels(recordings: Sequence[BandRecording], band: tuple[float, float]) -> Real:
    """Root mean square line of forces, then responses, inside the band, (n_channels,)."""
    powers = []
    for one in recordings:
        joint = np.concatenate([one.force, one.response], axis=1)
        spectrum = scipy.fft.rfft(joint - joint.mean(axis=0), axis=0) / np.sqrt(len(joint))
        axis = np.arange(len(spectrum)) * one.rate / len(joint)
        powers.append(np.mean(np.abs(spectrum[(axis >= band[0]) & (axis <= band[1])]) ** 2, axis=0))
    return np.asarray(np.sqrt(np.maximum(np.mean(powers, axis=0), 1e-300)))
