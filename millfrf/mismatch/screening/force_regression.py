"""Regression of recordings on forces of one joint, with modes within their prior, a spring and a damper."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real

from ..joints.joint_law import JointLaw, driven_force
from ..models.hypothesis import Hypothesis
from ..models.misfit import fitted_noise, through_structure
from ..records.noise_model import whitening
from .joint_places import AxisBands, EstimatedMotion, gain_along
from .law_free_refit import REFIT_LINES, LawFreeFit, off, orthonormal, rectangular, refit_part, stacked, without

NUISANCES = 2  # first forces, a spring and a damper, which errors of the modes imitate: they are never named

INDEPENDENT = 1e-9  # least share of a force's square that nothing else imitates


@dataclass(frozen=True)
class LinearProblem:
    """Normal equations of the forces after the modes, the spring and the damper were eliminated.

    Parameters
    ----------
    matrix, gradient : (n_forces, n_forces), (n_forces,)
        Normal matrix and gradient of all forces; those of spring and damper are zero.
    sizes : (n_forces,)
        Diagonal of the normal matrix before anything was eliminated.
    nuisances : (size + NUISANCES, n_forces + 1)
        Numbers of the modes, spring and damper for no further force, and what a unit of each force takes from them.
    available
        Fall of the misfit, beyond that by noise, if the force of the joint is free at every line.
    explained
        Share of the residual beyond noise that such a force explains.
    """

    matrix: Real
    gradient: Real
    sizes: Real
    nuisances: Real
    available: float
    explained: float

    @classmethod
    def of(
        cls,
        refit: LawFreeFit,
        lines: Sequence[WindowedSpectrum],
        motions: Sequence[EstimatedMotion],
        forces: Sequence[Sequence[JointLaw]],
    ) -> "LinearProblem":
        """Return the equations for the forces of laws in each recording under estimated motions.

        The first two laws are spring and damper.
        """
        records = [
            _record(refit, k, recording, motion, laws)
            for k, (recording, motion, laws) in enumerate(zip(lines, motions, forces, strict=True))
        ]
        shape, u = refit.hypothesis.shape, refit.hypothesis.u
        count = len(u) + len(forces[0])
        matrix, gradient = np.zeros((count, count)), np.zeros(count)
        matrix[: len(u), : len(u)] = np.diag(shape.prior_precision)
        gradient[: len(u)] = -shape.prior_precision * u
        for record in records:
            columns = np.hstack([record.modes, record.forces])
            matrix += 2 * columns.T @ columns
            gradient += 2 * columns.T @ record.error
        sizes, first = np.diag(matrix)[len(u) :], len(u) + NUISANCES
        inverse = _inverse(matrix[:first, :first])
        alone, taken = inverse @ gradient[:first], inverse @ matrix[:first, len(u) :]
        reduced = matrix[len(u) :, len(u) :] - matrix[len(u) :, :first] @ taken
        before = 2 * sum(record.rest(alone) for record in records)
        before += float(shape.prior_precision @ (u + alone[: len(u)]) ** 2)
        after = 2 * sum(record.projected for record in records) + float(shape.prior_precision @ u**2)
        noise = 2.0 * sum(len(record.along) for record in records)
        gained = before - after - noise
        return cls(
            reduced,
            gradient[len(u) :] - matrix[len(u) :, :first] @ alone,
            sizes,
            np.column_stack([alone, taken]),
            gained,
            float(np.clip(gained / max(before - noise * records[0].along.shape[1], 1e-300), 0.0, 1.0)),
        )

    def others(self, columns: Sequence[int]) -> Real:
        """Return the numbers of the modes, spring and damper that fit best with some forces, (size + NUISANCES,)."""
        chosen = self._independent(columns)
        factors = np.zeros(len(self.sizes))
        factors[chosen] = _inverse(self.matrix[np.ix_(chosen, chosen)]) @ self.gradient[chosen]
        return np.asarray(self.nuisances[:, 0] - self.nuisances[:, 1:] @ factors)

    def _independent(self, columns: Sequence[int]) -> NDArray[np.int64]:
        """Return the forces that the nuisances do not imitate exactly."""
        own = np.diag(self.matrix)
        return np.array([k for k in columns if own[k] > INDEPENDENT * self.sizes[k]], dtype=np.int64)

    def gain(self, columns: Sequence[int], *, signed: bool = False) -> float:
        """Return the fall of the misfit by some forces together, with factors that are not negative if ``signed``."""
        chosen = self._independent(columns)
        if not len(chosen):
            return 0.0
        matrix, gradient = self.matrix[np.ix_(chosen, chosen)], self.gradient[chosen]
        size = np.sqrt(np.diag(matrix))
        values, vectors = np.linalg.eigh(matrix / np.outer(size, size))
        kept = values > 1e-8 * values[-1]
        root = np.sqrt(values[kept])[:, None] * vectors[:, kept].T
        target = (vectors[:, kept].T @ (gradient / size)) / np.sqrt(values[kept])
        if not signed:
            return float(target @ target)
        return float(target @ target - scipy.optimize.nnls(root, target)[1] ** 2)

    def factor(self, column: int) -> float:
        """Return the best factor of one force alone."""
        return float(self.gradient[column] / max(self.matrix[column, column], 1e-300))


@dataclass(frozen=True)
class _Record:
    """Whitened real columns of one recording, without the motion at its ends."""

    error: Real  # residual without a force of the joint, (n_rows,)
    modes: Real  # derivative by the numbers of the modes, (n_rows, size)
    forces: Real  # response to each force, (n_rows, n_forces)
    along: Complex  # unit vector of the response to the joint's force, (n_lines, n_responses)
    projected: float  # square of the residual that no force explains

    def rest(self, nuisances: Real) -> float:
        """Return the square of what modes, spring and damper leave."""
        columns = np.hstack([self.modes, self.forces[:, :NUISANCES]])
        return float(np.sum((self.error - columns @ nuisances) ** 2))


def _inverse(matrix: Real) -> Real:
    """Return the pseudo-inverse of a normal matrix whose numbers may have very different units."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    units = np.outer(scale, scale)
    return np.asarray(np.linalg.pinv(matrix / units, rcond=1e-10, hermitian=True) / units)


def evidence_of_force(refit: LawFreeFit, linear: Hypothesis, lines: Sequence[WindowedSpectrum]) -> float:
    """Return twice the gain in log likelihood of a free force of the joint over refitted modes alone.

    ``linear`` is the refit of the modes without a force. The mean gain of noise is subtracted.
    """
    total = 0.0
    for number, recording in enumerate(lines):
        few = rectangular(recording).thinned(REFIT_LINES)
        part = refit_part(linear, refit.axis, few, _white(refit, number, few))
        left = without(orthonormal(stacked(part.transients)), stacked(part.error[:, :, None]))
        parts = left.reshape(2, *part.along.shape)
        along = np.einsum("kp,kp->k", part.along.conj(), parts[0] + 1j * parts[1])
        edges = np.unique(np.linspace(0, len(along), min(150, max(4, len(along) // 12)) + 1).astype(int))
        unity = np.ones((len(along), 1, 1), dtype=complex)
        bands = AxisBands(along[:, None], unity, edges[:-1], np.diff(edges).astype(float))
        total += gain_along(bands, np.ones(1)) - bands.chance
    return total


def _white(refit: LawFreeFit, number: int, lines: WindowedSpectrum) -> Complex:
    """Return the whitening of a recording's lines; a rest beyond the noise counts as noise, so that gains are safe."""
    through = through_structure(refit.hypothesis, lines)
    return whitening(fitted_noise(lines, through, refit.noises[number]) * max(1.0, refit.rest))


def _record(
    refit: LawFreeFit, number: int, lines: WindowedSpectrum, motion: EstimatedMotion, forces: Sequence[JointLaw]
) -> _Record:
    few, hypothesis = rectangular(lines).thinned(REFIT_LINES), refit.hypothesis
    part = refit_part(hypothesis, refit.axis, few, _white(refit, number, few))
    push = hypothesis.reach_with(refit.axis).paths[-1].push
    # the filtered force replaces the raw one, whose noise would be large between the resonances
    joint = few.cut(-motion.force[:, None])
    alone = part.total - part.force[:, None] * push
    with_joint, without_joint = (_slopes(refit, few, part.shown, total) for total in (alone + joint * push, alone))
    # across the joint's response its force is free; along it, modes must not explain the force by scaling it
    modes = off(part.along, with_joint) + without_joint - off(part.along, without_joint)
    signals = np.stack([driven_force(lines, motion.deflection, motion.velocity, law) for law in forces], axis=1)
    response = part.reach @ refit.axis.entries
    # a joint's force acts on the structure with a minus sign
    columns = -response[:, :, None] * few.cut(signals)[:, None, :]
    ends = orthonormal(stacked(part.transients))
    return _Record(
        without(ends, stacked(part.error[:, :, None]))[:, 0],
        without(ends, stacked(modes)),
        without(ends, stacked(columns)),
        part.along,
        float(part.residual @ part.residual),
    )


def _slopes(refit: LawFreeFit, lines: WindowedSpectrum, shown: Complex, force: Complex) -> Complex:
    """Return the derivative of the whitened response by the numbers of the modes, (n_lines, n_responses, size)."""
    shape, model = refit.hypothesis.shape, refit.hypothesis.reach_with(refit.axis).model
    out = np.empty((2, *shown.shape[:2], shape.size))
    shape.write_slopes(model, lines.frequencies, np.ascontiguousarray(force), shown, out)
    return np.asarray(out[0] + 1j * out[1])
