"""Structures and cuts drawn from their errors, and islands of instability that these errors move below a limit."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError, Real
from millfrf.cutting import MillingProcess
from modal_fit import ModalModel, pack_parameters, unpack_parameters

from .lobes_result import StabilityLobes
from .milling_loop import delay_system
from .ranked_limits import unstable_at
from .settings import SETTINGS

LARGEST_EXPONENT = 0.95  # of a draw; with 1 a force would not depend on its chip


def drawn(model: ModalModel, process: MillingProcess, count: int, seed: int) -> list[tuple[ModalModel, MillingProcess]]:
    """Draw structures and cuts from the model's covariance and the coefficients' errors, normally distributed.

    A model without covariance and coefficients without errors do not vary. A draw is repeated if one of its modes does
    not decay. K_tc stays above a twentieth of its value, and exponents of the chip thickness between 0 and 0.95.
    """
    generator = np.random.default_rng(seed)
    centre = pack_parameters(model)
    root = np.zeros((len(centre), 0))
    if model.covariance is not None:
        root = _root(model.covariance)
    law, numbers = process.chip_law, 6 if process.chip_law.varies else 3
    root_of_cut = _root(process.coefficient_covariance[:numbers, :numbers])
    draws = []
    for _ in range(count):
        for _ in range(20):
            structure = unpack_parameters(model, centre + root @ generator.standard_normal(root.shape[1]))
            if structure.poles.real.max() < 0:
                break
        else:
            raise InputError("the model's poles are so uncertain that draws of them do not decay; measure longer")
        ktc, krc, kac, *changes = root_of_cut @ generator.standard_normal(numbers)
        exponents = np.clip(np.array(law.exponents) + np.array(changes or (0.0, 0.0, 0.0)), 0.0, LARGEST_EXPONENT)
        cut = replace(
            process,
            ktc=max(process.ktc + float(ktc), 0.05 * process.ktc),
            krc=process.krc + float(krc),
            kac=process.kac + float(kac),
            ktc_std=0.0,
            chip_law=replace(law, exponents=tuple(exponents.tolist())),
        )
        draws.append((replace(structure, covariance=None), cut))
    return draws


def _root(covariance: Real) -> Real:
    """Return R with ``R R^T = covariance``; parameters differ in unit and size: it is that of the correlation."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


def reached_by_islands(
    model: ModalModel,
    process: MillingProcess,
    lobes: StabilityLobes,
    max_depth: float,
    chosen: NDArray[np.bool_],
    seed: int = 0,
) -> NDArray[np.bool_]:
    """Mark limits below which one of 39 drawn structures has an island of instability.

    An island of instability, such as a lobe of period doubling, ends at a vertical edge: the limit jumps there as the
    speed changes. The edge moves in speed as the natural frequencies do, so that islands are sought first for the given
    structure, at speeds that are up to two standard errors of the most uncertain natural frequency higher or lower:
    there a cut is unstable, and a deeper one below the limit is stable.

    Parameters
    ----------
    model, process, lobes, max_depth
        Structure, cut, their limits, and the largest depth (m) that was searched.
    chosen : (n_speeds,)
        Limits in question.
    seed
        Seed of the random generator.

    Returns
    -------
    (n_speeds,)
        Whether an island reaches the limit; all that are near an island where the poles of draws may not decay.
    """
    errors, marked = model.standard_errors(), np.zeros(len(chosen), dtype=bool)
    if errors is None or not errors[0].any() or not chosen.any():
        return marked
    shift = min(0.5, 2 * float(np.max(errors[0] / model.natural_frequencies)))
    tops = np.where(np.isfinite(lobes.depth_limits), lobes.depth_limits, max_depth)
    depths = np.outer(tops, SETTINGS.island_depths)
    system, near = delay_system(model, process), np.zeros(len(chosen), dtype=bool)
    for factor in 1 + shift * np.array([-1.0, -0.5, 0.5, 1.0]):
        tried = np.flatnonzero(chosen & ~near)
        unstable = unstable_at(system, factor * lobes.spindle_speeds[tried], depths[tried])
        near[tried] = unstable.any(axis=1) & ~unstable[:, 0]
    try:
        draws = drawn(model, process, SETTINGS.draws, seed) if near.any() else []
    except InputError:  # the poles are so uncertain that they may not decay
        return near
    for structure, cut in draws:
        tried = np.flatnonzero(near & ~marked)
        system = delay_system(structure, cut)
        marked[tried] = unstable_at(system, lobes.spindle_speeds[tried], depths[tried, 1:]).any(axis=1)
    return marked
