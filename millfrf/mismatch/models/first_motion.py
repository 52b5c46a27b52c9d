"""The prediction for one recording, and the first motion of recordings that are short for the damping of the modes.

The motion before a recording decays freely. If it has not decayed when the compared part begins, the modal coordinates
at the first sample are estimated from the measured response. They are a nuisance: every other number changes them, and
the derivatives by these numbers are projected (variable projection: Golub & Pereyra, SIAM J. Numer. Anal. 10, 1973, as
simplified by Kaufman, BIT 15, 1975).
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from estimation import WholeSpectrum, WindowedSpectrum
from millfrf.core import Complex, Real

from .hypothesis import NEGLIGIBLE, DrivenStructure, Hypothesis, Predicted, predicted_from, real_rows
from .joint_tangents import changes_by_decays
from .linear_lines import cut_products
from .ringing import decay_lines

# most Gauss-Newton steps to the first motion, most lengths of a step, and fall of the cost, as a share, that ends them
STEPS, LENGTHS, CONVERGED = 8, 4, 1e-3

LARGEST = 1e12  # a response so many times as large as the measured one has diverged

BLOCK = 512  # rows of derivatives that stay in the processor's cache


def predict_lines(hypothesis: Hypothesis, lines: WindowedSpectrum) -> Predicted:
    """Return the response of a hypothesis to the forces of a recording, cut and windowed like the measurement.

    If the first motion of the structure has not decayed in the run-in, it is estimated from the measured response.
    """
    ringing = np.flatnonzero(lines.rings(hypothesis.shape.nominal.poles[: hypothesis.shape.nominal_modes]))
    if not len(ringing) or not lines.measured.any():
        return predicted_from(hypothesis, lines)
    return _FirstMotion(hypothesis, lines, ringing).fitted()


@dataclass(frozen=True)
class _FirstMotion:
    """Least-squares problem of the first motion of the modes ``ringing``, with two numbers for each mode."""

    hypothesis: Hypothesis
    lines: WindowedSpectrum
    ringing: NDArray[np.int64]

    @cached_property
    def structure(self) -> DrivenStructure:
        """The hypothesis under the forces of the recording."""
        return DrivenStructure(self.hypothesis, self.lines)

    @cached_property
    def size(self) -> Real:
        """Root mean square of each measured response, which weights its residual."""
        return _size(self.lines)

    @cached_property
    def units(self) -> Complex:
        """Modal coordinates per number, (n_numbers, n_modes): each decays without joints as large as the response."""
        modes = np.zeros((len(self.ringing), len(self.hypothesis.model.poles)), dtype=complex)
        modes[np.arange(len(self.ringing)), self.ringing] = 1 / self.shares
        return np.concatenate([modes, 1j * modes])

    @cached_property
    def decays(self) -> Complex:
        """Lines of free decays without causes, relative to the response, (n_lines, n_responses, n_numbers)."""
        return decay_lines(self.hypothesis.model, self.lines, self.ringing) / self.size[:, None]

    @cached_property
    def shares(self) -> Real:
        """Size of the free decay of each mode from a modal coordinate of 1, relative to the response."""
        decays = self.decays[..., : len(self.ringing)]
        return np.asarray(np.maximum(np.sqrt(np.mean(np.abs(decays) ** 2, axis=(0, 1))), 1e-300))

    def predicted(self, numbers: Real) -> Predicted:
        """Return the prediction from the first motion with these numbers, (n_numbers,)."""
        return self.structure.predicted(numbers @ self.units)

    def misfit(self, predicted: Predicted) -> Complex:
        """Return the residual lines relative to the size of each response."""
        return np.asarray((self.lines.measured - predicted.response) / self.size)

    def diverged(self, predicted: Predicted) -> bool:
        """Return whether a simulation left the range of the measured response."""
        return has_diverged(predicted.response, self.lines)

    def fitted(self) -> Predicted:
        """Return the prediction from the likeliest first motion; from rest if the simulation diverges.

        The estimate always starts from rest, so that it depends on the hypothesis alone: derivatives taken over from
        another hypothesis let fits stop off their optimum. Its first step takes the forces of the joints as they are
        without a first motion: at rest, a joint with friction sticks, and its derivatives say nothing about a motion.
        """
        current, numbers = self.predicted(np.zeros(len(self.units))), np.zeros(len(self.units))
        if self.diverged(current):
            return current
        numbers, current, _ = self._stepped(numbers, current, self._linear_slopes)
        if not self._simulated:
            return current
        for _ in range(STEPS):
            slopes = self._linear_slopes + self._through_joints(current)
            if has_diverged(slopes * self.size[:, None], self.lines):
                break
            misfit = self.misfit(current)
            numbers, current, expected = self._stepped(numbers, current, slopes)
            after = _cost(self.misfit(current))
            # a response that follows its slopes, as with a stiffness that drifts, needs no second step
            if after > (1 - CONVERGED) * _cost(misfit) or after < (1 + CONVERGED) * expected:
                break
        return current

    def _stepped(self, numbers: Real, current: Predicted, slopes: Complex) -> tuple[Real, Predicted, float]:
        """Return numbers and prediction after a Gauss-Newton step, and the cost that the slopes let expect."""
        misfit, linear = self.misfit(current), not self._simulated
        # friction soon ends the first motion: where the response does not show it, it is as large as the response
        ridge = 0.0 if linear else _cost(misfit) / (2 * misfit.size)
        wanted = solved(slopes, misfit[:, :, None], ridge, numbers)[:, 0]
        numbers, trial = self._nearest(numbers, wanted, current)
        return numbers, replace(trial, first_slopes=slopes, first_ridge=ridge), _cost(misfit - slopes @ wanted)

    @property
    def _simulated(self) -> bool:
        """Whether the force of a joint follows the motion."""
        return any(cause.seen is None for cause in self.hypothesis.laws)

    @cached_property
    def _linear_slopes(self) -> Complex:
        """Derivative of the response lines by the numbers, relative to each response, with the joints' forces held."""
        if all(cause.axis is not None for cause in self.hypothesis.causes):
            return np.asarray(self.decays / np.tile(self.shares, 2))
        causes = tuple(cause for cause in self.hypothesis.causes if cause.axis is None)
        structure = DrivenStructure(replace(self.hypothesis, causes=causes), self.lines)
        at_rest = structure.predicted(np.zeros(self.units.shape[1], dtype=complex)).response
        moved = [structure.predicted(unit).response - at_rest for unit in self.units]
        return np.asarray(np.stack(moved, axis=2) / self.size[:, None])

    def _through_joints(self, current: Predicted) -> Complex:
        """Return the part of the derivative by changes of the joints' forces."""
        lines, slopes = self.lines, np.zeros((*self.lines.measured.shape, len(self.units)), dtype=complex)
        changes = changes_by_decays(self.hypothesis, self._whole, current, self.units, lines.frequencies[-1])
        for response, change in zip(self._to_joints, changes, strict=True):
            for some, cut in cut_products(response, change.change, lines):
                slopes[..., some] += cut
        return np.asarray(slopes / self.size[:, None])

    @cached_property
    def _whole(self) -> WholeSpectrum:
        return self.lines.whole()

    @cached_property
    def _to_joints(self) -> list[Complex]:
        return self.structure.to_joints()

    def _nearest(self, numbers: Real, wanted: Real, current: Predicted) -> tuple[Real, Predicted]:
        """Return the numbers after the longest part of a step that lowers the cost, and their prediction."""
        for length in 0.25 ** np.arange(LENGTHS):
            trial = self.predicted(numbers + length * wanted)
            if not self.diverged(trial) and _cost(self.misfit(trial)) < _cost(self.misfit(current)):
                return numbers + length * wanted, trial
        return numbers, current


def has_diverged(response: Complex, lines: WindowedSpectrum) -> bool:
    """Return whether simulated lines are not finite, or so large that their squares may overflow."""
    return not np.abs(response).max() < LARGEST * np.abs(lines.measured).max()


def _size(lines: WindowedSpectrum) -> Real:
    """Return the root mean square of each measured response, (n_responses,); 1 for a response without motion."""
    size = np.sqrt(np.mean(np.abs(lines.measured) ** 2, axis=0))
    return np.where(size > 0, size, 1.0)


def _cost(misfit: Complex) -> float:
    return float(np.sum(np.abs(misfit) ** 2))


def solved(slopes: Complex, lines: Complex, ridge: float = 0.0, numbers: Real | None = None) -> Real:
    """Return the real numbers (n_numbers, n_columns) whose combination of ``slopes`` is closest to each column.

    ``slopes`` (n_lines, n_responses, n_numbers) and ``lines`` (n_lines, n_responses, n_columns) have the same units.
    ``ridge`` is the weight of the squares of the numbers, which start at ``numbers`` (n_numbers,); None: at zero.
    """
    matrix, right = real_rows(slopes), real_rows(lines)
    weight, start = np.sqrt(ridge) * np.eye(matrix.shape[1]), np.zeros(matrix.shape[1]) if numbers is None else numbers
    offset = np.tile(-weight @ start[:, None], right.shape[1])
    return np.asarray(np.linalg.lstsq(np.vstack([matrix, weight]), np.vstack([right, offset]), rcond=NEGLIGIBLE)[0])


def with_first_motion_adapted(predicted: Predicted, lines: WindowedSpectrum, changes: Real) -> Complex:
    """Return the derivatives of the response lines by other numbers if the first motion adapts to each of them.

    ``changes``: derivatives with the first motion held, real and imaginary parts, (2, n_lines, n_responses, n_columns).
    """
    if predicted.first_slopes is None:
        return np.asarray(changes[0] + 1j * changes[1])
    flat = changes.reshape(2, -1, changes.shape[3])
    kept, size = predicted.taken_up_by_first_motion, np.tile(_size(lines), 2 * len(lines.measured))[:, None]
    basis, shares = (size * kept).reshape(*flat.shape[:2], -1), (kept / size).T @ flat.reshape(len(kept), -1)
    adapted = np.empty(flat.shape[1:], dtype=complex)
    for start in range(0, len(adapted), BLOCK):
        rows = slice(start, start + BLOCK)
        adapted[rows].real = flat[0, rows] - basis[0, rows] @ shares
        adapted[rows].imag = flat[1, rows] - basis[1, rows] @ shares
    return adapted.reshape(changes.shape[1:])
