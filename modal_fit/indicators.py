"""Mode indicator functions (CMIF, MIF): where an FRF matrix shows modes, before any fit."""

from dataclasses import dataclass

import numpy as np
import scipy

from estimation import Frf
from millfrf.core import Band, Complex, InputError, Real

from .frf_fit.measured_lines import entry_noise
from .settings import SETTINGS
from .shapes import modal_assurance

_ROUNDING = 1e-12  # relative size below which a singular value or an eigenvalue is rounding

CLEAR = 4.0  # standard errors by which a peak exceeds its valleys; noise does so once in 30 000 lines


def _lines_over_references(frf: Frf, band: Band | None) -> tuple[Real, Complex, tuple[str, ...]]:
    """Return frequencies (Hz), FRFs and references of the valid lines inside a band.

    The FRFs have shape (n_lines, n_others, n_references).

    The references are the side with fewer degrees of freedom: a roving hammer has many excitations and few sensors,
    and by reciprocity its sensors are the references.
    """
    low, high = (0.0, np.inf) if band is None else band
    f = frf.frequencies
    chosen = frf.valid & (f > 0) & (f >= low) & (f <= high)
    if not chosen.any():
        raise InputError(
            f"no valid line of the FRF lies between {low:g} and {high:g} Hz; it has {f[0]:g} to {f[-1]:g} Hz"
        )
    if len(frf.excitations) <= len(frf.responses):
        return f[chosen], frf.values[chosen], frf.excitations
    return f[chosen], frf.values[chosen].transpose(0, 2, 1), frf.responses


@dataclass(frozen=True)
class IndicatorPeak:
    """A peak of one curve of the complex mode indicator."""

    frequency: float  # Hz, of the line
    curve: int  # 1 for the largest singular value
    value: float  # singular value, in the unit of the FRF
    prominence: float  # factor of the peak over the higher neighbouring valley


@dataclass(frozen=True)
class ComplexModeIndicator:
    """Singular values of an FRF matrix; close modes show as peaks of several curves at once.

    Parameters
    ----------
    frequencies : (n_lines,), Hz
        Frequencies of the lines.
    singular_values : (n_lines, n_curves)
        Singular values in ``unit``, falling along the second axis.
    vectors : (n_lines, n_curves, n_references)
        Unit singular vectors over ``references``.
    references
        Degrees of freedom of the side with fewer of them, ``node:direction``.
    unit
        Unit of the FRF.
    noise : (n_lines,)
        Standard error of the FRF matrix (Frobenius norm), in ``unit``: no singular value is off by more than the error
        of the matrix (Weyl's inequality).
    """

    frequencies: Real
    singular_values: Real
    vectors: Complex
    references: tuple[str, ...]
    unit: str
    noise: Real

    def peaks(self, least_prominence: float = 2.0) -> tuple[IndicatorPeak, ...]:
        """Find the peaks of all curves in order of frequency, without noise and without those where two curves cross.

        A peak exceeds its valleys by four standard errors. Where two curves cross, the lower one has a kink upwards,
        the upper one a kink downwards, and they exchange their vectors.

        Parameters
        ----------
        least_prominence
            Factor over the valleys that a peak must have.
        """
        peaks = []
        floor = max(_ROUNDING * float(self.singular_values[:, 0].max()), 1e-300)
        for curve in range(self.singular_values.shape[1]):
            logarithm = np.log(np.maximum(self.singular_values[:, curve], floor))
            lines, properties = scipy.signal.find_peaks(logarithm, prominence=np.log(least_prominence))
            for line, prominence in zip(lines, properties["prominences"], strict=True):
                frequency, value = float(self.frequencies[line]), float(self.singular_values[line, curve])
                is_clear = value * (1 - np.exp(-prominence)) > CLEAR * self.noise[line]
                if is_clear and not self._is_crossing(int(line), curve):
                    peaks.append(IndicatorPeak(frequency, curve + 1, value, float(np.exp(prominence))))
        return tuple(sorted(peaks, key=lambda peak: (peak.frequency, peak.curve)))

    def _is_crossing(self, line: int, curve: int) -> bool:
        """Return whether, at the peak of a curve, the curve above has a valley and the vector changes."""
        if curve == 0:
            return False
        near = self.singular_values[max(line - 2, 0) : line + 3, curve - 1]
        valley = near.min() < min(near[0], near[-1])
        before, after = self.vectors[line - 1, curve], self.vectors[line + 1, curve]
        return bool(valley and modal_assurance(before[None], after[None])[0, 0] < SETTINGS.crossing_assurance)


def complex_mode_indicator(frf: Frf, band: Band | None = None) -> ComplexModeIndicator:
    r"""Compute the singular values of the FRF matrix on each line (Shih, Tsuei, Allemang & Brown, MSSP 2, 1988).

    ``H(w) = sum_k sigma_k(w) u_k(w) v_k(w)^H``. Near the pole of a mode the largest singular value follows
    ``|right| |left| / |i w - pole|``; a second mode at the same frequency with other vectors raises the second singular
    value.

    Parameters
    ----------
    frf
        FRF of any quantity; its values are not converted.
    band
        Lowest and highest frequency, Hz; None: all lines.

    Raises
    ------
    InputError
        No valid line lies in the band.

    Examples
    --------
    Two modes at one frequency with different shapes: two singular values of similar size.

    >>> axis, dofs = np.array([10.0]), ("A:+X", "A:+Y")
    >>> frf = Frf(axis, np.diag([2j, 1.9j])[None], dofs, dofs, "receptance", "m/N", axis > 0)
    >>> complex_mode_indicator(frf).singular_values.tolist()
    [[2.0, 1.9]]
    """
    frequencies, columns, references = _lines_over_references(frf, band)
    _, singular, rows = np.linalg.svd(columns, full_matrices=False)
    variance = entry_noise(frf, np.isin(frf.frequencies, frequencies))
    noise = np.sqrt(np.nansum(variance, axis=(1, 2)))
    return ComplexModeIndicator(frequencies, singular, rows.conj(), references, frf.unit, noise)


@dataclass(frozen=True)
class MultivariateModeIndicator:
    """Eigenvalues from 0 to 1 on each line; each curve falls to 0 at a mode that suitable real forces excite alone.

    Parameters
    ----------
    frequencies : (n_lines,), Hz
        Frequencies of the lines.
    values : (n_lines, n_references)
        Eigenvalues, rising along the second axis; the first column is the indicator of the clearest mode.
    references
        Degrees of freedom of the side with fewer of them; a single one gives the ordinary mode indicator function.
    """

    frequencies: Real
    values: Real
    references: tuple[str, ...]

    def dips(self, deepest: float = 0.3) -> Real:
        """Return the frequencies (Hz) of the minima of the first curve that are below ``deepest``."""
        lines, _ = scipy.signal.find_peaks(-self.values[:, 0], height=-deepest, prominence=0.1)
        return np.asarray(self.frequencies[lines])


def multivariate_mode_indicator(frf: Frf, band: Band | None = None) -> MultivariateModeIndicator:
    r"""Compute the least share of the responses in phase with real forces (Williams, Crowley & Vold, IMAC 3, 1985).

    .. math:: \min_f \frac{f^T A f}{f^T (A + B) f}, \qquad A = \mathrm{Re} H^T\, \mathrm{Re} H, \quad
              B = \mathrm{Im} H^T\, \mathrm{Im} H

    At an undamped natural frequency the right forces bring all responses of a structure with real modes into
    quadrature, and the indicator is 0. All eigenvalues of ``A f = lambda (A + B) f`` are returned. With one reference
    it is ``sum Re H^2 / sum |H|^2`` (Hunt, Vold, Peterson & Williams, AIAA 84-1068, 1984). A mobility is turned by 90
    degrees.

    Parameters
    ----------
    frf
        Receptance, mobility, accelerance, or a transfer whose phase is that of motion over force.
    band
        Lowest and highest frequency, Hz; None: all lines.

    Raises
    ------
    InputError
        No valid line lies in the band.

    Examples
    --------
    In quadrature, in phase, and between:

    >>> axis, dof = np.array([1.0, 2.0, 3.0]), ("A:+X",)
    >>> frf = Frf(axis, np.array([-1j, 1.0, 1 - 1j]).reshape(3, 1, 1), dof, dof, "receptance", "m/N", axis > 0)
    >>> multivariate_mode_indicator(frf).values[:, 0].round(6).tolist()
    [0.0, 1.0, 0.5]
    """
    frequencies, columns, references = _lines_over_references(frf, band)
    turned = columns * (1j if frf.quantity == "mobility" else 1.0)
    real, imaginary = turned.real, turned.imag
    in_phase = real.transpose(0, 2, 1) @ real
    total = in_phase + imaginary.transpose(0, 2, 1) @ imaginary
    return MultivariateModeIndicator(frequencies, _generalised_eigenvalues(in_phase, total), references)


def _generalised_eigenvalues(in_phase: Real, total: Real) -> Real:
    """Return the eigenvalues of ``in_phase f = lambda total f``; 1 for combinations of forces that move nothing."""
    size, directions = np.linalg.eigh(total)
    moving = size > _ROUNDING * size[:, -1:]
    scale = np.divide(1.0, np.sqrt(np.abs(size)), out=np.zeros_like(size), where=moving)
    whitening = directions * scale[:, None, :]
    whitened = whitening.transpose(0, 2, 1) @ in_phase @ whitening
    idle = np.einsum("kq,qr->kqr", (~moving).astype(float), np.eye(size.shape[1]))
    return np.clip(np.linalg.eigvalsh(whitened + idle), 0.0, 1.0)
