"""Complex mode indicator function: singular values of the FRF matrix over frequency."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from estimation import Frf
from foundation import Band

from ..models import modal_assurance
from .reference_side import indicated_columns

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
            lines, seen = find_peaks(size, prominence=np.log(least_prominence))
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
