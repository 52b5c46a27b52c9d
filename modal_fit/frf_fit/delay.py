"""Pure delay of a transfer function, estimated in turn with its poles."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import Band, Complex

from ..maximum_likelihood.likelihood_model import LikelihoodProblem, regressors
from ..maximum_likelihood.whole_records import RecordSpectra
from ..models.out_of_band import fixed_poles, out_of_band_basis
from ..settings import SETTINGS


def transfer_delay(poles: Complex, frf: Frf, chosen: NDArray[np.bool_], band: Band) -> float:
    """Find the delay tau (s) for which modes at ``poles`` and out-of-band terms explain ``H(s) exp(s tau)`` best.

    A delay of a fraction of a period turns the phase of a mode far from its resonance, which no modal model of
    few terms can follow. With fixed poles (n_modes,), rad/s, everything but tau is linear and is eliminated: the misfit
    is a function of tau alone; its minimum is searched on a grid and then refined.
    """
    spectra = _unit_excitations(frf, chosen)
    basis = out_of_band_basis(spectra.s, band, fixed_poles(band, (), (2.0,)))
    problem = LikelihoodProblem(spectra, basis, np.zeros((0, len(spectra.s))))
    design = regressors(poles, problem, 0)
    design = np.concatenate([design.real, design.imag])
    orthogonal, _ = np.linalg.qr(design / np.linalg.norm(design, axis=0))
    size = np.sqrt(np.mean(np.abs(spectra.response) ** 2, axis=0))
    response = spectra.response / np.where(size > 0, size, 1.0)

    def misfit(delay: float) -> float:
        advanced = response * np.exp(spectra.s * delay)[:, None]
        return -float(np.sum((orthogonal.T @ np.concatenate([advanced.real, advanced.imag])) ** 2))

    delays = np.linspace(0.0, SETTINGS.longest_delay / band[1], SETTINGS.delay_grid)
    best = int(np.argmin([misfit(delay) for delay in delays]))
    step = delays[1]
    bounds = (delays[best] - step, delays[best] + step)
    refined = scipy.optimize.minimize_scalar(misfit, bounds=bounds, method="bounded", options={"xatol": 1e-5 * step})
    return float(max(refined.x, 0.0))


def alternating_delay(frf: Frf, chosen: NDArray[np.bool_], band: Band, find_poles: Callable[[Frf], Complex]) -> float:
    """Estimate the delay (s) of a transfer and its poles in turn: the first poles still contain the delay."""
    delay = 0.0
    poles = find_poles(frf)
    for number in range(SETTINGS.delay_rounds):
        previous, delay = delay, transfer_delay(poles, frf, chosen, band)
        if number >= 2:
            delay = (delay + previous) / 2  # poles and delay can oscillate about their common value
        poles = find_poles(without_delay(frf, delay))
        if abs(delay - previous) < 1e-3 / band[1]:
            break
    return delay


def without_delay(frf: Frf, delay: float) -> Frf:
    """Return the FRF with a delay (s) removed."""
    return replace(frf, values=frf.values * np.exp(2j * np.pi * frf.frequencies * delay)[:, None, None])


def _unit_excitations(frf: Frf, chosen: NDArray[np.bool_]) -> RecordSpectra:
    """Return the FRF columns of each line in turn as responses to unit excitations."""
    values = frf.values[chosen]
    n_lines, n_responses, n_excitations = values.shape
    return RecordSpectra(
        np.repeat(2j * np.pi * frf.frequencies[chosen], n_excitations),
        np.zeros(n_lines * n_excitations, dtype=np.int64),
        np.tile(np.eye(n_excitations, dtype=complex), (n_lines, 1)),
        np.ascontiguousarray(values.transpose(0, 2, 1).reshape(-1, n_responses)),
        np.zeros(n_responses, dtype=np.int64),
    )
