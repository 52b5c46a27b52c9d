"""This project's fit as an engine."""

import warnings

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, FrfCovariance
from modal_fit import ModalFit, fit_polyreference
from modal_fit.frf_fit.fit import REFINED

from .problem import UNITS, Answer, FoundMode, Problem


def find_modes(problem: Problem) -> Answer:
    """`modal_fit.fit_polyreference` with its defaults, on the quantity as it was measured."""
    covariance = None
    if problem.response_covariance is not None and problem.excitation_covariance is not None:
        covariance = FrfCovariance(problem.response_covariance, problem.excitation_covariance)
    frf = Frf(
        problem.frequencies,
        problem.values,
        problem.responses,
        problem.excitations,
        problem.quantity,
        UNITS[problem.quantity],
        np.ones(len(problem.frequencies), dtype=bool),
        covariance=covariance,
        coherence=problem.coherence,
        averages=problem.averages,
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        fit = fit_polyreference(frf, problem.band)
    said = [*fit.warnings, *(f"{each.category.__name__}: {each.message}" for each in caught)]
    said += [f"status: {fit.status}"] if fit.status != REFINED else []
    return Answer(_modes(fit), said=tuple(said))


def _modes(fit: ModalFit) -> tuple[FoundMode, ...]:
    model = fit.model
    bars = _standard_errors(fit)
    result = []
    for k, pole in enumerate(model.poles):
        shape = tuple((float(x.real), float(x.imag)) for x in model.right[k])
        frequency, damping = float(abs(pole) / (2 * np.pi)), float(-pole.real / abs(pole))
        errors = (None, None) if bars is None else (float(bars[0][k]), float(bars[1][k]))
        result.append(FoundMode(frequency, damping, *errors, shape))
    return tuple(result)


def _standard_errors(fit: ModalFit) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Of frequency (Hz) and damping ratio: the total that the fit states, else the noise's part of its covariance."""
    model = fit.model
    if model.errors is not None:
        return model.errors.frequency, model.errors.damping
    if model.covariance is None:
        return None
    n, size = len(model.poles), np.abs(model.poles)
    real, imaginary = model.poles.real, model.poles.imag
    rows = np.zeros((2, n, 2 * n))
    index = np.arange(n)
    rows[0, index, index], rows[0, index, n + index] = real / size, imaginary / size
    rows[0] /= 2 * np.pi
    rows[1, index, index] = -(imaginary**2) / size**3
    rows[1, index, n + index] = real * imaginary / size**3
    part = model.covariance[: 2 * n, : 2 * n]
    spread = np.sqrt(np.maximum(np.einsum("tki,ij,tkj->tk", rows, part, rows), 0.0))
    return spread[0], spread[1]
