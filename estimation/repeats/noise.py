"""Noise of responses and forces measured from recordings, without a model of the structure."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from millfrf.core import Complex, InputError, Real

from ..band_recordings.band_recording import BandRecording
from ..estimators import local_half_width, local_polynomial
from ..settings import PERIODS
from .period_search import find_repeats

_BOUND = "local polynomial, an upper bound"


@dataclass(frozen=True)
class MeasuredNoise:
    """Covariance of the noise of forces and responses at each line.

    Spectra are ``rfft(w x)`` with ``sum w^2 = 1``: white noise of variance v has variance v a line whatever the length.
    This is the scale of :class:`WindowedSpectrum`; the one-sided power spectral density is ``2 v / rate``.
    """

    frequencies: Real  # (n_lines,), Hz, rising
    rate: float  # Hz, sample rate of the recordings
    # (n_lines, n_responses, n_responses); covariance of the responses' noise, ``E[n_p conj(n_q)]``, SI
    responses: Complex
    # (n_lines, n_excitations, n_excitations); covariance of the forces' noise; zero where the method cannot separate it
    # from the responses'
    forces: Complex
    cross: Complex  # (n_lines, n_responses, n_excitations); covariance of responses with forces
    kind: str  # ``periods``, ``repeats``, ``silence``, or ``local polynomial, an upper bound``
    # complex degrees of freedom of the covariance of a line: variances spread by ``1 / sqrt(freedom)``
    freedom: float
    # (n_responses,); noise of each response over its repeated part, ratio of root mean squares over the lines
    response_share: Real
    force_share: Real  # (n_excitations,); noise of each force over its repeated part, in the same measure
    statement: str  # one sentence on the data from which the noise was measured

    def at(self, frequencies: Real, rate: float | None = None) -> "MeasuredNoise":
        """Interpolate the noise linearly to other lines (Hz), and convert it to another sample rate (Hz).

        Raises
        ------
        InputError
            Lines outside those that were measured, by more than one spacing.
        """
        own, lines = self.frequencies, np.asarray(frequencies, dtype=float)
        slack = float(np.diff(own).max()) if len(own) > 1 else 0.0
        if lines.min() < own[0] - slack - 1e-9 or lines.max() > own[-1] + slack + 1e-9:
            raise InputError(
                f"noise is known from {own[0]:.4g} to {own[-1]:.4g} Hz, not from {lines.min():.4g} to "
                f"{lines.max():.4g} Hz; measure it in that band"
            )
        # white noise of one power spectral density has a variance that is proportional to the sample rate
        scale = 1.0 if rate is None else rate / self.rate
        responses, forces, cross = (
            _interpolated(own, values, lines) * scale for values in (self.responses, self.forces, self.cross)
        )
        return replace(self, frequencies=lines, rate=rate or self.rate, responses=responses, forces=forces, cross=cross)

    def covariance(self, frequencies: Real, through: Complex) -> Complex:
        """Compute the covariance of the residual ``x - G f`` at lines, ``[1, -G] C [1, -G]^H``.

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
        noise = self.at(frequencies)
        return residual_covariance(noise.responses, noise.forces, noise.cross, through)

    def response_level(self) -> Real:
        """Compute the root mean square noise of each response over the lines, (n_responses,), SI."""
        return np.asarray(np.sqrt(np.einsum("kpp->kp", self.responses).real.mean(axis=0)))


def residual_covariance(responses: Complex, forces: Complex, cross: Complex, through: Complex) -> Complex:
    """Return the covariance (n_lines, n, n) of ``x - G f`` from the covariances of x, of f, and of x with f.

    ``through`` is G, (n_lines, n, m).
    """
    mixed = cross @ _adjoint(through)
    return np.asarray(responses - mixed - _adjoint(mixed) + through @ forces @ _adjoint(through))


def averaged_lines(covariance: Complex, freedom: int) -> tuple[Complex, float]:
    """Average covariances (n_lines, n, n) over neighbouring lines; also return the degrees of freedom of each.

    The average has enough lines for :attr:`PeriodSettings.freedom` degrees of freedom a channel: with fewer, the
    covariance is nearly singular.
    """
    n_lines, n = covariance.shape[:2]
    enough = PERIODS.freedom * n
    half = min(int(np.ceil((enough / freedom - 1) / 2)) if freedom < enough else 0, (n_lines - 1) // 2)
    if half == 0:
        return covariance, float(freedom)
    total = np.concatenate([np.zeros((1, n, n)), np.cumsum(covariance, axis=0)])
    first = np.clip(np.arange(n_lines) - half, 0, n_lines - 1 - 2 * half)
    width = 2 * half + 1
    return np.asarray((total[first + width] - total[first]) / width), float(freedom * width)


def split_covariance(joint: Complex, n_excitations: int) -> tuple[Complex, Complex, Complex]:
    """Split a joint covariance, forces first, into those of responses, of forces, and of responses with forces."""
    m = n_excitations
    return joint[:, m:, m:], joint[:, :m, :m], joint[:, m:, :m]


def _adjoint(matrices: Complex) -> Complex:
    return np.asarray(matrices.conj().transpose(0, 2, 1))


def _interpolated(own: Real, values: Complex, lines: Real) -> Complex:
    if len(own) == 1:
        return np.repeat(values, len(lines), axis=0)
    right = np.clip(np.searchsorted(own, lines), 1, len(own) - 1)
    share = np.clip((lines - own[right - 1]) / (own[right] - own[right - 1]), 0.0, 1.0)[:, None, None]
    return np.asarray((1 - share) * values[right - 1] + share * values[right])


def noise_in_silence(recordings: Sequence[BandRecording], band: tuple[float, float]) -> MeasuredNoise | None:
    """Measure the noise in a band (Hz) in blocks without force after the free decay; None for fewer than four blocks.

    The covariance is averaged over the Hann-windowed blocks. Noise that comes with the force (moving cables, range of
    the converter) is missing.
    """
    first = recordings[0]
    seconds = max(8.0 / (band[1] - band[0]), 0.25, 2.0 / band[0])  # eight lines in the band, two periods of the lowest
    n = round(seconds * first.rate)
    window = np.hanning(n + 1)[:-1, None]
    window = window / np.sqrt(np.sum(window**2))
    spectra = [
        scipy.fft.rfft((block - block.mean(axis=0)) * window, axis=0)
        for recording in recordings
        for block in _silent_blocks(recording, n)
    ]
    if len(spectra) < PERIODS.silent_blocks:
        return None
    frequencies = np.arange(n // 2 + 1) * first.rate / n
    inside = (frequencies >= band[0]) & (frequencies <= band[1])
    lines = np.array(spectra)[:, inside].transpose(1, 2, 0)
    m = first.force.shape[1]
    averaged, freedom = averaged_lines(lines @ _adjoint(lines) / len(spectra), len(spectra))
    share = np.sqrt(np.einsum("kpp->kp", averaged).real.mean(axis=0)) / _levels(recordings, band)
    statement = (
        f"{len(spectra)} blocks of {n / first.rate:.3g} s without force (below {100 * PERIODS.quiet:g} % of its root "
        "mean square), after the structure rang out; noise that comes with the force is not in it."
    )
    return MeasuredNoise(
        frequencies[inside],
        first.rate,
        *split_covariance(averaged, m),
        "silence",
        freedom,
        share[m:],
        share[:m],
        statement,
    )


def noise_bound(recordings: Sequence[BandRecording], band: tuple[float, float]) -> MeasuredNoise:
    """Compute an upper bound of the responses' noise in a band (Hz): the residual of local polynomials.

    Around each line the response is a polynomial FRF times the forces and a polynomial transient
    (:func:`local_polynomial`); the residual holds the noise of responses and forces, and all distortion that is not
    smooth in frequency. The spectra of the forces must be rough. All recordings are cut to the shortest.
    """
    for recording in recordings:
        # few lines are excited by forces that repeat, and their FRF would fit all of the noise
        if find_repeats(recording.force) is not None:
            raise InputError(f"{recording.name}: the forces repeat, and this would be no bound; use noise_of_periods")
    frf = local_polynomial(recordings, band)
    if frf.covariance is None or not frf.valid.any():
        raise InputError(
            f"forces are dependent at every line from {band[0]:g} to {band[1]:g} Hz; excite them separately"
        )
    m, n_records = frf.values.shape[2], len(recordings)
    n_lines = 2 * local_half_width(n_records, m) + 1
    freedom = n_lines * n_records - 3 * (m + n_records)  # equations less coefficients of second order polynomials
    averaged, averaged_freedom = averaged_lines(frf.covariance.response[frf.valid], freedom)
    share = np.sqrt(np.einsum("kpp->kp", averaged).real.mean(axis=0)) / _levels(recordings, band)[m:]
    statement = (
        f"Residual of {n_records} recording{'s' if n_records > 1 else ''} from a local polynomial FRF and transient in "
        f"bands of {n_lines} lines: an upper bound, because distortion is counted as noise."
    )
    return MeasuredNoise(
        frf.frequencies[frf.valid],
        recordings[0].rate,
        averaged,
        np.zeros((len(averaged), m, m), dtype=complex),
        np.zeros((len(averaged), averaged.shape[1], m), dtype=complex),
        _BOUND,
        averaged_freedom,
        share,
        np.full(m, np.nan),
        statement,
    )


def _silent_blocks(recording: BandRecording, n: int) -> list[Real]:
    """Return the blocks (n, n_channels) without force in which no response still rings."""
    force = recording.force - np.median(recording.force, axis=0)
    power = np.sum(force**2, axis=1)
    limit = PERIODS.quiet**2 * power.mean()
    joint = np.concatenate([recording.force, recording.response], axis=1)
    silent = [
        joint[start : start + n]
        for start in range(0, len(power) - n + 1, n)
        # no single sample may reach five times the limit of the mean: a short blow is not silence
        if limit > 0 and power[start : start + n].mean() < limit and power[start : start + n].max() < 25 * limit
    ]
    if len(silent) < PERIODS.silent_blocks:
        return []
    level = np.array([block[:, force.shape[1] :].var(axis=0) for block in silent])
    # the median of the quieter half is the level of the noise as long as half of the blocks do not ring
    usual = np.median(np.sort(level, axis=0)[: (len(level) + 1) // 2], axis=0)
    return [block for block, own in zip(silent, level, strict=True) if np.all(own <= PERIODS.rung_out * usual)]


def _levels(recordings: Sequence[BandRecording], band: tuple[float, float]) -> Real:
    """Return the root mean square of the lines in the band, of forces, then responses, (n_channels,)."""
    powers = []
    for recording in recordings:
        joint = np.concatenate([recording.force, recording.response], axis=1)
        spectrum = scipy.fft.rfft(joint - joint.mean(axis=0), axis=0) / np.sqrt(len(joint))
        frequencies = np.arange(len(spectrum)) * recording.rate / len(joint)
        inside = (frequencies >= band[0]) & (frequencies <= band[1])
        powers.append(np.mean(np.abs(spectrum[inside]) ** 2, axis=0))
    return np.asarray(np.sqrt(np.maximum(np.mean(powers, axis=0), 1e-300)))
