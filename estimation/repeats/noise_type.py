"""`MeasuredNoise`: the noise of responses and forces as recordings show it, without a model."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

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
