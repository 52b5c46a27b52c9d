"""Depth limits of structures and coefficients drawn from their errors: where the first order does not do."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess
from foundation import InputError
from modal_fit import ModalModel
from modal_fit.models.uncertainty import pack_parameters, unpack_parameters

from ..floquet.floquet_multipliers import multipliers
from ..solvers.collocation_solver import lowest_limits

Real = NDArray[np.float64]

TRIES = 20
"""Draws of one structure before it is given up because one of its poles does not decay."""


def drawn(model: ModalModel, process: MillingProcess, count: int, seed: int) -> list[tuple[ModalModel, MillingProcess]]:
    """Draw structures and cuts from the model's covariance and the coefficients' errors, normally distributed.

    A draw with a pole that does not decay is drawn again; K_tc stays above a twentieth of its value.

    Parameters
    ----------
    model
        Modal model with its covariance; without one it stays as it is.
    process
        Cut with the standard errors of its coefficients; zero ones stay as they are.
    count
        Number of draws.
    seed
        Seed of the generator that draws.

    Raises
    ------
    InputError
        The covariance is so wide that draws have no decaying poles.
    """
    generator = np.random.default_rng(seed)
    centre = pack_parameters(model)
    root = np.zeros((len(centre), 0))
    if model.covariance is not None:
        scale = np.sqrt(np.maximum(np.diag(model.covariance), 1e-300))
        values, vectors = np.linalg.eigh(model.covariance / np.outer(scale, scale))
        root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    pairs = []
    for _ in range(count):
        for _ in range(TRIES):
            one = unpack_parameters(model, centre + root @ generator.standard_normal(root.shape[1]))
            if one.poles.real.max() < 0:
                break
        else:
            raise InputError("the model's poles are so uncertain that draws of them do not decay; measure longer")
        ktc, krc, kac = np.array(process.coefficient_errors) * generator.standard_normal(3)
        cut = replace(
            process,
            ktc=max(process.ktc + float(ktc), 0.05 * process.ktc),
            krc=process.krc + float(krc),
            kac=process.kac + float(kac),
            ktc_std=0.0,
        )
        pairs.append((replace(one, covariance=None), cut))
    return pairs


def sampled_limits(
    model: ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float, count: int, seed: int = 0
) -> Real:
    """Give the lowest limits of ``count`` draws, (count, n_speeds), m; infinite above ``max_depth``, 0 if not resolved.

    By the solver of :func:`certified_lobes`. In place of its ladder each draw is asked once more for its multipliers
    at the lowest of its limits; a draw that is not stable just below it counts with 0.

    Parameters
    ----------
    model, process, count, seed
        Modal model, cut, number of draws and seed, as for :func:`drawn`.
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds at which limits are wanted.
    max_depth : m
        Largest axial depth that is searched.

    Raises
    ------
    InputError
        As :func:`drawn` and :func:`certified_lobes`.
    """
    limits = np.empty((count, len(spindle_speeds)))
    for k, (one, cut) in enumerate(drawn(model, process, count, seed)):
        found = lowest_limits(one, cut, spindle_speeds, max_depth).lowest()
        limits[k] = np.where([status == "unresolved" for status in found.status], 0.0, found.depth_limits)
        worst = int(np.argmin(limits[k]))
        below = 0.999 * min(float(limits[k, worst]), max_depth)
        if not multipliers(one, cut, float(spindle_speeds[worst]), below).stable:
            limits[k, worst] = 0.0
    return limits
