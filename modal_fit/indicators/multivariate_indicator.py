"""Multivariate mode indicator function: how far forces at all references can bring the responses into quadrature."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from estimation import Frf
from foundation import Band

from .reference_side import indicated_columns

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
        lines, _ = find_peaks(-self.values[:, 0], height=-deepest, prominence=0.1)
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
