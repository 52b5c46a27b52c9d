"""The pure delay of a measuring chain with amplifiers and converters, found beside the modes."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from .maximum_likelihood.likelihood_model import Setting
from .maximum_likelihood.linear_start import regressors
from .maximum_likelihood.whole_records import RecordSpectra
from .models.out_of_band import out_of_band_basis

Complex = NDArray[np.complex128]
_LONGEST = 4.0  # periods of the band's upper end
_GRID = 160


def transfer_delay(poles: Complex, spectra: RecordSpectra, band: tuple[float, float]) -> float:
    """Find the delay tau (s) for which modes at ``poles`` and out-of-band terms explain ``H(s) exp(s tau)`` best.

    A delay of a fraction of a period turns the phase of a mode far from its resonance, which no modal model of
    few terms can follow. With the poles held, everything but tau is linear and is eliminated: the misfit left is a
    function of tau alone, searched on a grid and then refined.

    Parameters
    ----------
    poles : (n_modes,), rad/s
        Poles that are held, in the upper half plane.
    spectra
        Spectra of a ``transfer``.
    band : Hz
        Lowest and highest frequency of the lines.
    """
    setting = Setting(spectra, out_of_band_basis(spectra.s, band), np.zeros((0, len(spectra.s))))
    design = regressors(poles, setting, 0, 0)
    design = np.concatenate([design.real, design.imag])
    orthogonal, _ = np.linalg.qr(design / np.linalg.norm(design, axis=0))
    size = np.sqrt(np.mean(np.abs(spectra.response) ** 2, axis=0))
    response = spectra.response / np.where(size > 0, size, 1.0)

    def misfit(delay: float) -> float:
        advanced = response * np.exp(spectra.s * delay)[:, None]
        return -float(np.sum((orthogonal.T @ np.concatenate([advanced.real, advanced.imag])) ** 2))

    delays = np.linspace(0.0, _LONGEST / band[1], _GRID)
    best = int(np.argmin([misfit(delay) for delay in delays]))
    step = delays[1]
    around = (delays[best] - step, delays[best] + step)
    found = minimize_scalar(misfit, bounds=around, method="bounded", options={"xatol": 1e-5 * step})
    return float(max(found.x, 0.0))
