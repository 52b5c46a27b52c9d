"""Mode indicator functions (CMIF, MIF): where an FRF matrix shows modes, before any fit."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import Band, InputError

from .shapes import modal_assurance


def indicated_columns(
    frf: Frf, band: Band | None
) -> tuple[NDArray[np.float64], NDArray[np.complex128], tuple[str, ...]]:
    """Give the valid lines inside a band, with the side of fewer degrees of freedom as columns: the references.

    A roving hammer has many excitations and few sensors; by reciprocity its sensors are the references.

    Parameters
    ----------
    frf
        FRF of any quantity.
    band : Hz
        Lowest and highest frequency; None: all lines.

    Returns
    -------
    frequencies : (n_lines,), Hz
        Frequencies of the lines, above 0 Hz.
    columns : (n_lines, n_others, n_references)
        Values of the FRF, transposed where there are more excitations than responses.
    references
        Degrees of freedom of the columns.

    Raises
    ------
    InputError
        No valid line lies there.
    """
    low, high = (0.0, np.inf) if band is None else band
    f = frf.frequencies
    inside = frf.valid & (f > 0) & (f >= low) & (f <= high)
    if not inside.any():
        raise InputError(
            f"no valid line of the FRF lies between {low:g} and {high:g} Hz; it has {f[0]:g} to {f[-1]:g} Hz"
        )
    if len(frf.excitations) <= len(frf.responses):
        return f[inside], frf.values[inside], frf.excitations
    return f[inside], frf.values[inside].transpose(0, 2, 1), frf.responses


_SAME_VECTOR = 0.8  # assurance of a curve's vectors on both sides of a peak; below, two curves may cross there
_ROUNDING = 1e-12


@dataclass(frozen=True)
class IndicatorPeak:
    """A peak of one curve of the complex mode indicator.

    Parameters
    ----------
    frequency
        Hz, of the line.
    curve
        1 for the largest singular value.
    value
        Singular value, in the unit of the FRF.
    prominence
        The peak over the higher of the two valleys beside it, a factor.
    """

    frequency: float
    curve: int
    value: float
    prominence: float


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
    """

    frequencies: NDArray[np.float64]
    singular_values: NDArray[np.float64]
    vectors: NDArray[np.complex128]
    references: tuple[str, ...]
    unit: str

    def peaks(self, least_prominence: float = 2.0) -> tuple[IndicatorPeak, ...]:
        """Peaks of all curves in order of frequency, without those where two curves cross.

        Where two curves cross, the lower one has a kink upwards, the upper one a kink downwards, and they exchange
        their vectors.

        Parameters
        ----------
        least_prominence
            Factor over the valleys that a peak must have.
        """
        found = []
        for curve in range(self.singular_values.shape[1]):
            size = self._logarithm(curve)
            lines, seen = scipy.signal.find_peaks(size, prominence=np.log(least_prominence))
            for line, prominence in zip(lines, seen["prominences"], strict=True):
                if self._crossing(int(line), curve):
                    continue
                value = float(self.singular_values[line, curve])
                peak = IndicatorPeak(float(self.frequencies[line]), curve + 1, value, float(np.exp(prominence)))
                found.append(peak)
        return tuple(sorted(found, key=_frequency_and_curve))

    def _logarithm(self, curve: int) -> NDArray[np.float64]:
        """Give the logarithm of a curve, with the rounding of the largest value as floor."""
        floor = max(_ROUNDING * float(self.singular_values[:, 0].max()), 1e-300)
        return np.log(np.maximum(self.singular_values[:, curve], floor))

    def _crossing(self, line: int, curve: int) -> bool:
        """Whether the curve's peak is where the one above comes down to it and turns away with its vector."""
        if curve == 0:
            return False
        near = self.singular_values[max(line - 2, 0) : line + 3, curve - 1]
        valley = near.min() < min(near[0], near[-1])
        before, after = self.vectors[line - 1, curve], self.vectors[line + 1, curve]
        return bool(valley and modal_assurance(before[None], after[None])[0, 0] < _SAME_VECTOR)


def complex_mode_indicator(frf: Frf, band: Band | None = None) -> ComplexModeIndicator:
    r"""Singular values of the FRF matrix on each line (Shih, Tsuei, Allemang & Brown, MSSP 2, 1988, 367-377).

    ``H(w) = sum_k sigma_k(w) u_k(w) v_k(w)^H``. Near the pole of a mode the largest singular value follows
    ``|right| |left| / |i w - pole|``; a second mode at the same frequency with other vectors lifts the second one.

    Parameters
    ----------
    frf
        Any quantity; the values are taken as they stand.
    band
        Hz; None: all lines.

    Raises
    ------
    InputError
        No valid line lies in the band.

    Examples
    --------
    Two modes at one frequency with other shapes: two singular values of the same size.

    >>> axis, dofs = np.array([10.0]), ("A:+X", "A:+Y")
    >>> frf = Frf(axis, np.diag([2j, 1.9j])[None], dofs, dofs, "receptance", "m/N", axis > 0)
    >>> complex_mode_indicator(frf).singular_values.tolist()
    [[2.0, 1.9]]
    """
    frequencies, columns, references = indicated_columns(frf, band)
    _, singular, rows = np.linalg.svd(columns, full_matrices=False)
    return ComplexModeIndicator(frequencies, singular, rows.conj(), references, frf.unit)


def _frequency_and_curve(peak: IndicatorPeak) -> tuple[float, int]:
    return peak.frequency, peak.curve


_LEAST = 1e-12  # share of the largest eigenvalue below which a combination of forces moves nothing


@dataclass(frozen=True)
class MultivariateModeIndicator:
    """Eigenvalues between 0 and 1 on each line; each dips to 0 at a mode that the forces of that curve drive.

    Parameters
    ----------
    frequencies : (n_lines,), Hz
        Frequencies of the lines.
    values : (n_lines, n_references)
        Eigenvalues, rising along the second axis; the first column is the indicator of the clearest mode.
    references
        Degrees of freedom of the side with fewer of them; with a single one it is the ordinary mode indicator function.
    """

    frequencies: NDArray[np.float64]
    values: NDArray[np.float64]
    references: tuple[str, ...]

    def dips(self, deepest: float = 0.3) -> NDArray[np.float64]:
        """Frequencies (Hz) of the minima of the first curve that are below ``deepest``."""
        lines, _ = scipy.signal.find_peaks(-self.values[:, 0], height=-deepest, prominence=0.1)
        return np.asarray(self.frequencies[lines])


def multivariate_mode_indicator(frf: Frf, band: Band | None = None) -> MultivariateModeIndicator:
    r"""The share of the responses in phase with real forces, at best (Williams, Crowley & Vold, Proc. IMAC 3, 1985).

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
        Hz; None: all lines.

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
    frequencies, columns, references = indicated_columns(frf, band)
    turned = columns * (1j if frf.quantity == "mobility" else 1.0)
    real, imaginary = turned.real, turned.imag
    in_phase = real.transpose(0, 2, 1) @ real
    total = in_phase + imaginary.transpose(0, 2, 1) @ imaginary
    return MultivariateModeIndicator(frequencies, _shares(in_phase, total), references)


def _shares(part: NDArray[np.float64], total: NDArray[np.float64]) -> NDArray[np.float64]:
    """Eigenvalues of ``part f = lambda total f``; 1 for combinations of forces that move nothing."""
    size, directions = np.linalg.eigh(total)
    moving = size > _LEAST * size[:, -1:]
    scale = np.divide(1.0, np.sqrt(np.abs(size)), out=np.zeros_like(size), where=moving)
    whitening = directions * scale[:, None, :]
    whitened = whitening.transpose(0, 2, 1) @ part @ whitening
    idle = np.einsum("kq,qr->kqr", (~moving).astype(float), np.eye(size.shape[1]))
    return np.clip(np.linalg.eigvalsh(whitened + idle), 0.0, 1.0)
