"""Structures and cuts drawn from their errors, and islands of instability that these errors move below a limit."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError, Real
from millfrf.cutting import MillingProcess
from modal_fit import ModalModel, pack_parameters, unpack_parameters

from .lobes_result import StabilityLobes
from .milling_loop import delay_system
from .ranked_limits import ranked_limits, steps_around, unstable_at
from .settings import SETTINGS

LARGEST_EXPONENT = 0.95  # of a draw; with 1 a force would not depend on its chip

Draw = tuple[ModalModel, MillingProcess]


@dataclass(frozen=True)
class NormalErrors:
    """Structure and cut as functions of independent standard normal numbers.

    Parameters
    ----------
    model, process
        Structure and cut; their errors are those of the model's covariance and of the coefficients.
    root : (n_parameters, n)
        The parameters of the model move by this times the first n numbers; no column without covariance.
    root_of_cut : (k, k)
        K_tc, k_rc and k_ac, and where they depend on the chip thickness their exponents, move by this times the last
        k numbers.
    """

    model: ModalModel
    process: MillingProcess
    root: Real
    root_of_cut: Real

    @classmethod
    def of(cls, model: ModalModel, process: MillingProcess) -> "NormalErrors":
        """Return the errors that model and process state; what states none does not vary."""
        covariance = model.covariance
        root = np.zeros((len(pack_parameters(model)), 0)) if covariance is None else _root(covariance)
        moving = 6 if process.chip_law.varies else 3
        return cls(model, process, root, _root(process.coefficient_covariance[:moving, :moving]))

    @property
    def dimension(self) -> int:
        """Return how many numbers there are."""
        return int(self.root.shape[1] + self.root_of_cut.shape[1])

    def decays(self, numbers: Real) -> NDArray[np.bool_]:
        """Return for each row of numbers, (..., n) or more, whether all modes decay."""
        n_modes, count = len(self.model.poles), self.root.shape[1]
        return np.asarray((self.model.poles.real + numbers[..., :count] @ self.root[:n_modes].T < 0).all(axis=-1))

    def numbers(self, generator: np.random.Generator) -> Real:
        """Draw the numbers of a structure whose modes decay, (dimension,).

        Raises
        ------
        InputError
            Twenty draws in a row do not decay.
        """
        for _ in range(20):
            of_structure = generator.standard_normal((self.root.shape[1],))
            if self.decays(of_structure):
                return np.concatenate([of_structure, generator.standard_normal(self.root_of_cut.shape[1])])
        raise InputError("the model's poles are so uncertain that draws of them do not decay; measure longer")

    def at(self, numbers: Real) -> Draw:
        """Return structure and cut; K_tc stays above a twentieth of its value, exponents between 0 and 0.95."""
        of_structure, of_cut = np.split(numbers, [self.root.shape[1]])
        packed, law = pack_parameters(self.model) + self.root @ of_structure, self.process.chip_law
        ktc, krc, kac, *changes = self.root_of_cut @ of_cut
        exponents = np.clip(np.array(law.exponents) + np.array(changes or (0.0, 0.0, 0.0)), 0.0, LARGEST_EXPONENT)
        cut = replace(
            self.process,
            ktc=max(self.process.ktc + float(ktc), 0.05 * self.process.ktc),
            krc=self.process.krc + float(krc),
            kac=self.process.kac + float(kac),
            ktc_std=0.0,
            chip_law=replace(law, exponents=tuple(exponents.tolist())),
        )
        return replace(unpack_parameters(self.model, packed), covariance=None), cut


def drawn(model: ModalModel, process: MillingProcess, count: int, seed: int) -> list[Draw]:
    """Draw structures and cuts from the model's covariance and the coefficients' errors, normally distributed.

    A model without covariance and coefficients without errors do not vary. A draw is repeated if one of its modes does
    not decay.
    """
    generator, errors = np.random.default_rng(seed), NormalErrors.of(model, process)
    return [errors.at(errors.numbers(generator)) for _ in range(count)]


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
    draws: Sequence[Draw] = (),
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
    draws
        Structures and cuts instead of those drawn from the errors.

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
        draws = (draws or drawn(model, process, SETTINGS.draws, seed)) if near.any() else []
    except InputError:  # the poles are so uncertain that they may not decay
        return near
    for structure, cut in draws:
        tried = np.flatnonzero(near & ~marked)
        system = delay_system(structure, cut)
        marked[tried] = unstable_at(system, lobes.spindle_speeds[tried], depths[tried, 1:]).any(axis=1)
    return marked


def ranked_depths(
    structures: Sequence[ModalModel],
    process: MillingProcess,
    speeds: Real,
    limit: float,
    max_depth: float,
    ranks: Sequence[int],
) -> Real:
    """Find depths of some ranks among the limits of drawn structures, each the lowest over the speeds.

    The coefficients are drawn, too, where the process states their errors. Islands of instability that are thinner than
    a tenth of their depth, or lie below a quarter of ``limit``, may be missed.

    Parameters
    ----------
    structures
        Drawn modal models.
    process
        Cut, with the errors of its coefficients.
    speeds : (n_speeds,), rad/s
        A cut is unstable if it is at one of these.
    limit : m
        Limit of a structure in the middle of the draws, about which depths are tried.
    max_depth : m
        Largest depth; also the result where the limit of a rank lies above it.
    ranks
        1 is the lowest limit.

    Returns
    -------
    (n_ranks,), m
        Lower ends of intervals of one part in a thousand that contain the limits.
    """
    cuts = [cut for _, cut in drawn(replace(structures[0], covariance=None), process, len(structures), 0)]
    tried = np.union1d(steps_around(limit, max_depth), min(limit, max_depth) * np.array(SETTINGS.island_depths))
    limits = ranked_limits(list(zip(structures, cuts, strict=True)), speeds, tried)
    return np.minimum([limits.ranked(rank)[0] for rank in ranks], max_depth)
