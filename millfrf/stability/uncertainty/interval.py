"""Confidence interval of a stability limit: first order where it holds, samples elsewhere."""

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import InputError, Real
from millfrf.cutting import MillingProcess
from modal_fit import ModalModel, pack_parameters, unpack_parameters

from ..floquet.multipliers import multipliers
from ..lobes_result import StabilityLobes
from ..solvers.collocation import lowest_limits
from .sensitivity import depth_errors

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


SAMPLES = 39
"""The smallest and the largest of 39 draws hold the next one with a probability of 38 / 40 = 95 %."""

CONFIDENCE = 0.95

OUTSIDE = 5
"""Of 39 samples, 2 are expected outside the first-order interval; more than 5 come by chance once in a hundred."""

SPREAD = (0.65, 1.5)
"""Ratio of the samples' spread to the first-order error that 39 samples show by chance, three standard errors wide."""


LARGE, JUMP, BESIDE = 0.15, 0.02, 0.01
"""Relative error of a limit, relative jump of the chatter's frequency, and share of the speed around a jump, that make
draws necessary."""


@dataclass(frozen=True)
class LimitBand:
    """95 % interval of the depth limit at each speed.

    Parameters
    ----------
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds of the limits.
    low, high : (n_speeds,), m
        Ends of the interval. ``high`` is infinite where the limit may lie above the largest depth looked at; both are
        NaN where nothing is known.
    basis
        How the interval was found, one word a speed: ``first-order``, ``samples``, or ``none``.
    """

    spindle_speeds: Real
    low: Real
    high: Real
    basis: tuple[str, ...]


def limit_band(
    structure: Frf | ModalModel, process: MillingProcess, lobes: StabilityLobes, max_depth: float, seed: int = 0
) -> LimitBand:
    """Give the 95 % interval of each limit of ``certified_lobes``, from errors of the structure and the coefficients.

    Where the first order may fail (two lobes meet nearby, no limit was found, the error is large) 39 draws of a modal
    model are solved; a speed at which they contradict the first order has their smallest and largest limit instead. Of
    an FRF there are no draws: the first order alone.

    Parameters
    ----------
    structure, process, lobes
        Structure, cut and certified limits, as for :func:`depth_errors`.
    max_depth : m
        Largest depth up to which draws are solved.
    seed
        Seed of the generator that draws.

    Raises
    ------
    InputError
        As :func:`depth_errors`; a helix, unequal pitch or process damping is refused.
    """
    errors = depth_errors(structure, process, lobes)
    half = scipy.special.ndtri(0.5 + CONFIDENCE / 2) * errors
    low, high = np.maximum(lobes.depth_limits - half, 0.0), lobes.depth_limits + half
    known = np.isfinite(low) & np.array([status != "unresolved" for status in lobes.status], dtype=bool)
    basis = np.where(known, "first-order", "none").astype(object)
    low, high = np.where(known, low, np.nan), np.where(known, high, np.nan)
    doubted = np.flatnonzero(_doubted(lobes, errors))
    if isinstance(structure, ModalModel) and len(doubted):
        samples = sampled_limits(structure, process, lobes.spindle_speeds[doubted], max_depth, SAMPLES, seed)
        agree = _agree(samples, lobes.depth_limits[doubted], errors[doubted], half[doubted])
        replaced = (samples > 0).all(axis=0) & ~(known[doubted] & agree)
        chosen = doubted[replaced]
        low[chosen], high[chosen] = samples[:, replaced].min(axis=0), samples[:, replaced].max(axis=0)
        basis[chosen] = "samples"
    return LimitBand(lobes.spindle_speeds, low, high, tuple(str(one) for one in basis))


def _doubted(lobes: StabilityLobes, errors: Real) -> NDArray[np.bool_]:
    """Speeds with no or a large error, and those close to where the chatter's frequency or kind changes."""
    speeds, frequency = lobes.spindle_speeds, lobes.chatter_frequencies
    doubted = ~(errors < LARGE * lobes.depth_limits)
    kinds = np.array(lobes.bifurcations)
    jumps = (kinds[1:] != kinds[:-1]) | ~(np.abs(np.diff(frequency)) < JUMP * frequency[1:])
    for k in np.flatnonzero(jumps):
        near = (speeds > speeds[k] * (1 - BESIDE)) & (speeds < speeds[k + 1] * (1 + BESIDE))
        near[max(0, k - 1) : k + 3] = True
        doubted |= near
    return np.asarray(doubted)


def _agree(samples: Real, limits: Real, errors: Real, half: Real) -> NDArray[np.bool_]:
    """Whether the draws spread as the first order says, (n_speeds,)."""
    finite = np.isfinite(samples).all(axis=0)
    away = np.where(finite, samples, 0.0) - limits
    outside = np.sum(~(np.abs(away) <= half), axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.sqrt(np.mean(away**2, axis=0)) / errors
    return np.asarray(finite & (outside <= OUTSIDE) & (ratio > SPREAD[0]) & (ratio < SPREAD[1]))
