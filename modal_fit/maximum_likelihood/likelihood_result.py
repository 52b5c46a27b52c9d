"""The step from fitted unknowns to a `ModalModel`, and the choice of out-of-band terms by information criterion."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from foundation import MillfrfError

from ..models import ABOVE, ModalModel, out_of_band_basis, residuals_from
from .likelihood_fit import LikelihoodFit, maximise_likelihood
from .likelihood_model import LikelihoodModel, Setting
from .linear_start import linear_start
from .whole_records import RecordSpectra


def best_fit(
    poles: NDArray[np.complex128],
    spectra: RecordSpectra,
    band: tuple[float, float],
    *,
    n_smooth: int,
) -> LikelihoodFit:
    """Fit without, with one and with two fixed poles above the band; keep the best by Schwarz's criterion.

    Raises
    ------
    MillfrfError
        Neither fit gave finite numbers.
    """
    fits = []
    x = 2 * (spectra.s.imag / (2 * np.pi) - band[0]) / (band[1] - band[0]) - 1
    powers = np.array([x**k for k in range(n_smooth)]).reshape(n_smooth, len(x))
    for above in ABOVE:
        setting = Setting(spectra, out_of_band_basis(spectra.s, band, above), powers)
        try:
            start = linear_start(poles, setting, transients=n_smooth > 0)
            fit = maximise_likelihood(start, setting)
        except np.linalg.LinAlgError:
            continue
        if np.isfinite(fit.log_likelihood):
            fits.append((_criterion(fit, spectra), fit))
    if not fits:
        raise MillfrfError(f"the refinement of {len(poles)} modes did not converge; choose another band or fewer modes")
    return min(fits, key=_first)[1]


def _first(pair: tuple[float, LikelihoodFit]) -> float:
    return pair[0]


def _criterion(fit: LikelihoodFit, spectra: RecordSpectra) -> float:
    n_unknowns = fit.model.pack().size - 2 * len(fit.model.poles)
    return -2 * fit.log_likelihood + n_unknowns * float(np.log(2 * spectra.response.size))


def modal_model_from(
    fit: LikelihoodFit, band: tuple[float, float], responses: Sequence[str], excitations: Sequence[str], unit: str
) -> ModalModel:
    """The modes in order of frequency, with residual terms and the covariance of poles and vectors.

    The covariance is widened by the reduced chi-square where that is above 1: a misfit that the noise does not explain
    is uncertainty too.
    """
    model = fit.model
    order = np.argsort(np.abs(model.poles))
    n_kept = 2 * (model.poles.size + model.right.size + model.left.size)
    covariance = fit.covariance[:n_kept, :n_kept] * max(1.0, fit.reduced_chi_square)
    index = _sorting_index(model, order, n_kept)
    return ModalModel(
        poles=model.poles[order],
        right=model.right[order],
        left=model.left[order],
        responses=tuple(responses),
        excitations=tuple(excitations),
        quantity="receptance" if unit == "m/N" else "transfer",
        unit=unit,
        residuals=residuals_from(model.outside, band),
        covariance=covariance[np.ix_(index, index)],
        band=band,
    )


def _sorting_index(model: LikelihoodModel, order: NDArray[np.int64], n_kept: int) -> NDArray[np.int64]:
    """Give the place in the unsorted model of each packed unknown of the sorted one."""
    numbered = model.unpack(np.arange(model.pack().size, dtype=float))
    moved = replace(numbered, poles=numbered.poles[order], right=numbered.right[order], left=numbered.left[order])
    return moved.pack()[:n_kept].astype(np.int64)
