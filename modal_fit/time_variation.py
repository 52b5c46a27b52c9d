"""`moving_modes`: whether natural frequencies move while recordings are made, without a complete fit."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from estimation import BandRecording
from millfrf.core import Band, Complex

from .maximum_likelihood.likelihood_fit import Optimum
from .maximum_likelihood.likelihood_model import LikelihoodProblem, linear_start, prediction, transfer
from .maximum_likelihood.moving_poles import MovingPoles, moving_poles
from .maximum_likelihood.normal_equations import evaluate
from .maximum_likelihood.whole_records import RecordSpectra, flat_noise, record_spectra
from .models.out_of_band import fixed_poles, out_of_band_basis
from .settings import SETTINGS
from .stabilisation import choose_poles, stabilisation_chart
from .subspace import correlation_blocks, subspace_poles, with_flanks

MAX_ORDER = 40  # highest order of the state space, two for each mode


def moving_modes(recordings: Sequence[BandRecording], band: Band) -> MovingPoles | None:
    """Test whether the natural frequencies of a structure are constant between recordings and within each.

    Poles of a state space and least squares for everything else give a model with constant poles. As the score test
    leaves out whatever constant dynamics explain, the model need not be refined. A wide band is tested part by part,
    on the responses that the model describes best.

    Parameters
    ----------
    recordings
        One recording a test, all of one sample rate and channel layout.
    band
        Lowest and highest frequency, Hz.

    Returns
    -------
    MovingPoles or None
        Motion of the modes in the band; None if no pole is stable over the orders, or the equations are singular.

    Raises
    ------
    InputError
        Recordings that cannot be stacked or are too short, or a band outside the band of the recordings.
    """
    try:
        poles = _poles(recordings, band)
        inside = np.sort(np.abs(poles[_between(poles, band)])) / (2 * np.pi)
        middles = [math.sqrt(a * b) for a, b in pairwise(inside)]
        edges = [band[0], *middles[SETTINGS.modes_tested_together - 1 :: SETTINGS.modes_tested_together], band[1]]
        parts = [_tested(recordings, (low, high), poles) for low, high in pairwise(edges)] if len(inside) else []
    except np.linalg.LinAlgError:  # channels that depend on each other exactly
        return None
    return MovingPoles.joined(parts) if parts else None


def _poles(recordings: Sequence[BandRecording], band: Band) -> Complex:
    """Return the poles, rad/s, that are stable over the orders, in the band and beside it."""
    n_responses = len(recordings[0].responses)
    rows = max(SETTINGS.block_rows, math.ceil(SETTINGS.spare_block_rows * MAX_ORDER / n_responses))
    wide = with_flanks(band, recordings)
    groups, _ = choose_poles(
        stabilisation_chart(list(subspace_poles(correlation_blocks(recordings, rows), wide, MAX_ORDER)), wide)
    )
    return np.array([group.pole for group in groups], dtype=complex)


def _between(poles: Complex, band: Band) -> NDArray[np.bool_]:
    """Return which poles lie in a band."""
    frequencies = np.abs(poles) / (2 * np.pi)
    return np.asarray((frequencies > band[0]) & (frequencies < band[1]))


def _tested(recordings: Sequence[BandRecording], band: Band, poles: Complex) -> MovingPoles:
    """Test the modes of a part of the band."""
    near = poles[_between(poles, with_flanks(band, recordings))]
    spectra = record_spectra(recordings, band)
    x = 2 * (spectra.s.imag / (2 * np.pi) - band[0]) / (band[1] - band[0]) - 1
    powers = np.array([x**k for k in range(SETTINGS.transient_terms)])
    basis = out_of_band_basis(spectra.s, band, fixed_poles(band, *SETTINGS.poles_outside_band[-1]))
    described = _best_described(LikelihoodProblem(spectra, basis, powers), near)
    problem = LikelihoodProblem(described, basis, powers)
    start = linear_start(near, problem)
    noise = flat_noise(problem.response - prediction(start, problem, transfer(start, problem)), described)
    motion = moving_poles(Optimum(problem, evaluate(start, problem, noise), noise, converged=False))
    return motion.of(np.flatnonzero(_between(near, band)))


def _best_described(problem: LikelihoodProblem, poles: Complex) -> RecordSpectra:
    """Return the spectra with those responses of which modes with these poles leave least."""
    spectra, start = problem.spectra, linear_start(poles, problem)
    error = problem.response - prediction(start, problem, transfer(start, problem))
    shares = np.linalg.norm(error, axis=1) / np.maximum(np.linalg.norm(problem.response, axis=1), 1e-300)
    kept = np.sort(np.argsort(shares)[: SETTINGS.responses_tested])
    return replace(spectra, response=spectra.response[:, kept], derivative=spectra.derivative[kept])
