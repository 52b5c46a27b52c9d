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

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real

from .hypothesis import Hypothesis, Predicted, predicted_from

# most Gauss-Newton steps to the first motion, most lengths of a step, and fall of the cost, as a share, that ends them
STEPS, LENGTHS, CONVERGED = 8, 4, 1e-3

LARGEST = 1e12  # a response so many times as large as the measured one has diverged

NEGLIGIBLE = 1e-8  # singular value of the slopes, relative to the largest, below which a combination has no effect

STEP = 0.01  # step of a difference quotient in a simulation, in units of a free decay as large as the response


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
    def size(self) -> Real:
        """Root mean square of each measured response, which weights its residual."""
        return _size(self.lines)

    @cached_property
    def units(self) -> Complex:
        """Modal coordinates per number, (n_numbers, n_modes): each decays without joints as large as the response."""
        modes = np.zeros((len(self.ringing), len(self.hypothesis.model.poles)), dtype=complex)
        modes[np.arange(len(self.ringing)), self.ringing] = 1.0
        bare, lines = replace(self.hypothesis, causes=()), self.lines
        still = replace(lines, force_lines=np.zeros_like(lines.force_lines))
        decays = [predicted_from(bare, still, mode).response / self.size for mode in modes]
        share = np.array([np.linalg.norm(decay) / np.sqrt(decay.size) for decay in decays])
        modes /= np.maximum(share, 1e-300)[:, None]
        return np.concatenate([modes, 1j * modes])

    def predicted(self, numbers: Real) -> Predicted:
        """Return the prediction from the first motion with these numbers, (n_numbers,)."""
        return predicted_from(self.hypothesis, self.lines, numbers @ self.units)

    def misfit(self, predicted: Predicted) -> Complex:
        """Return the residual lines relative to the size of each response."""
        return np.asarray((self.lines.measured - predicted.response) / self.size)

    def diverged(self, predicted: Predicted) -> bool:
        """Return whether a simulation left the range of the measured response."""
        return has_diverged(predicted.response, self.lines)

    def fitted(self) -> Predicted:
        """Return the prediction from the likeliest first motion; from rest if the simulation diverges."""
        linear = all(cause.seen is not None for cause in self.hypothesis.laws)
        numbers, step = np.zeros(len(self.units)), 1.0 if linear else STEP
        current = self.predicted(numbers)
        for _ in range(1 if linear else STEPS):
            if self.diverged(current):
                break
            moved = (self.predicted(numbers + step * unit) for unit in np.eye(len(numbers)))
            slopes = np.stack([(other.response - current.response) / step for other in moved], axis=2)
            if has_diverged(slopes, self.lines):
                break
            slopes, misfit = slopes / self.size[:, None], self.misfit(current)
            # friction soon ends the first motion: where the response does not show it, it is as large as the response
            ridge = 0.0 if linear else _cost(misfit) / (2 * misfit.size)
            wanted = solved(slopes, misfit[:, :, None], ridge, numbers)[:, 0]
            numbers, trial = self._nearest(numbers, wanted, current)
            done = _cost(self.misfit(trial)) > (1 - CONVERGED) * _cost(misfit)
            current = replace(trial, first_slopes=slopes, first_ridge=ridge)
            if done:
                break
        return current

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
    matrix, right = _as_real(slopes), _as_real(lines)
    weight, start = np.sqrt(ridge) * np.eye(matrix.shape[1]), np.zeros(matrix.shape[1]) if numbers is None else numbers
    offset = np.tile(-weight @ start[:, None], right.shape[1])
    return np.asarray(np.linalg.lstsq(np.vstack([matrix, weight]), np.vstack([right, offset]), rcond=NEGLIGIBLE)[0])


def with_first_motion_adapted(predicted: Predicted, lines: WindowedSpectrum, changes: Complex) -> Complex:
    """Return the derivatives of the response lines by other numbers if the first motion adapts to each of them.

    ``changes`` (n_lines, n_responses, n_columns): derivatives with the first motion held.
    """
    if predicted.first_slopes is None:
        return changes
    size, own = _size(lines)[:, None], _as_real(predicted.first_slopes)
    with_ridge = np.vstack([own, np.sqrt(predicted.first_ridge) * np.eye(own.shape[1])])
    left, sizes, _ = np.linalg.svd(with_ridge, full_matrices=False)
    # an orthonormal basis of what the first motion can take up, as complex lines
    real, imaginary = left[: len(own), sizes > NEGLIGIBLE * sizes[0]].reshape(2, *changes.shape[:2], -1)
    basis, flat = real + 1j * imaginary, changes.reshape(-1, changes.shape[2])
    shares = np.real((basis / size).conj().reshape(len(flat), -1).T @ flat)
    return np.asarray(flat - (size * basis).reshape(len(flat), -1) @ shares).reshape(changes.shape)


def _as_real(lines: Complex) -> Real:
    """Return real parts above imaginary parts of lines (n_lines, n_responses, n_columns), a row for each."""
    return np.concatenate([lines.real, lines.imag]).reshape(-1, lines.shape[2])
