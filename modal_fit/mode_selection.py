"""Which modes a band needs: each is left out on trial, with poles held, and judged by what its absence costs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .likelihood_model import Setting
from .linear_start import regressors
from .maximum_likelihood import Noise
from .out_of_band import out_of_band_basis
from .record_spectra import RecordSpectra

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
_EXACT = 1e-10  # share of a channel's power below which a misfit is rounding


@dataclass(frozen=True)
class NeededModes:
    """What the trial fits with held poles say.

    Parameters
    ----------
    superfluous : (n_superfluous,)
        Numbers of the modes whose absence costs less than their unknowns are worth.
    curvature
        Whether the out-of-band terms need a fixed pole above the band.
    """

    superfluous: tuple[int, ...]
    curvature: bool


def needed_modes(poles: Complex, spectra: RecordSpectra, band: tuple[float, float], noise: Noise | None) -> NeededModes:
    """Leave out modes, last first, while Schwarz's criterion gains.

    With poles held, residues and out-of-band terms are a linear problem. It is factorised once; each trial then works
    on the small triangular factor. The misfit of the fullest model counts as noise, so that leakage and the like are no
    reason to keep a mode.

    Parameters
    ----------
    poles : (n_modes,), rad/s
        In falling order of trust: the last is tried first, the first is always kept.
    spectra, band, noise
        As in :func:`best_fit`.
    """
    setting = Setting(spectra, out_of_band_basis(spectra.s, band, curvature=True), np.zeros((0, len(spectra.s))))
    parts = [_factorised(poles, setting, int(order), noise) for order in np.unique(spectra.derivative)]
    n_excitations = spectra.excitation.shape[1]
    width = 2 * n_excitations
    columns = {number: slice(width * number, width * (number + 1)) for number in range(len(poles))}
    curvature = slice(width * len(poles) + 2 * n_excitations, None)
    n_real = 2 * len(spectra.s)
    keep = np.ones(parts[0].triangle.shape[1], dtype=bool)
    worth_of_column = spectra.response.shape[1] * float(np.log(n_real * spectra.response.shape[1]))
    superfluous = []
    current = _misfit(parts, keep)
    for tried in [curvature, *(columns[number] for number in range(len(poles) - 1, 0, -1))]:
        fewer = keep.copy()
        fewer[tried] = False
        misfit = _misfit(parts, fewer)
        if misfit - current < worth_of_column * np.count_nonzero(keep[tried]):
            keep, current = fewer, misfit
            if tried is not curvature:
                superfluous.append(tried.start // width)
    return NeededModes(tuple(superfluous), bool(keep[curvature].any()))


@dataclass(frozen=True)
class _Factorised:
    """``triangle`` x = ``target`` in least squares; the part of the responses that no unknown reaches is the noise."""

    triangle: Real  # (n_columns, n_columns)
    target: Real  # (n_columns, n_responses), over the noise's standard deviation


def _factorised(poles: Complex, setting: Setting, derivative: int, noise: Noise | None) -> _Factorised:
    spectra = setting.spectra
    mine = spectra.derivative == derivative
    weights = np.sqrt(_line_weights(noise, mine, len(spectra.s)))[:, None]
    design, response = weights * regressors(poles, setting, derivative, 0), weights * spectra.response[:, mine]
    columns: Real = np.concatenate([design.real, design.imag])
    measured: Real = np.concatenate([response.real, response.imag])
    scale = np.linalg.norm(columns, axis=0)
    orthogonal, triangle = np.linalg.qr(columns / np.where(scale > 0, scale, 1.0))
    target = orthogonal.T @ measured
    rest = np.sum(measured**2, axis=0) - np.sum(target**2, axis=0)
    freedom = max(1, len(columns) - columns.shape[1])
    variance = np.maximum(rest / freedom, _EXACT * np.mean(measured**2, axis=0))
    return _Factorised(triangle, target / np.sqrt(np.where(variance > 0, variance, 1.0)))


def _line_weights(noise: Noise | None, mine: NDArray[np.bool_], n_lines: int) -> Real:
    """One weight a line, from each response's variance relative to its median."""
    if noise is None or not hasattr(noise, "response") or noise.response.ndim != 3:
        return np.ones(n_lines)
    variance = np.real(np.einsum("kpp->kp", noise.response))[:, mine]
    relative = np.mean(variance / np.median(variance, axis=0), axis=1)
    return np.asarray(1 / np.maximum(relative, 1e-3))


def _misfit(parts: list[_Factorised], keep: NDArray[np.bool_]) -> float:
    """Squared misfit in units of noise variance that leaving columns out adds."""
    total = 0.0
    for part in parts:
        triangle = part.triangle[:, keep]
        solved = np.linalg.lstsq(triangle, part.target, rcond=1e-12)[0]
        total += float(np.sum((part.target - triangle @ solved) ** 2))
    return total
