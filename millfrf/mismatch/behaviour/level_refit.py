"""Linear refits of single recordings, with error bars that include unmodelled dynamics."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy

from estimation import WindowedSpectrum
from millfrf.core import Complex, MillfrfError, Real

from ..inference.settings import VerdictSettings
from ..models.first_motion import predict_lines
from ..models.hypothesis import Hypothesis
from ..models.misfit import relative_residual_power
from ..models.settings import FITTING

STEPS = 10  # most steps of the refit

CONVERGED_GAIN = 1e-3  # fall of the misfit, as a share, below which the refit ends

NUMBER_PRECISION = 1e-6  # precision of the prior of frequencies and damping: they are free

FIXED_PRECISION = 1e12  # precision of numbers that are not fitted

SHAPE_PRECISION = 0.01  # precision of the prior of the shapes: they may change by ten laboratory errors

PARTS = 8  # most parts of a recording; the scatter of the estimates from the parts enters the standard errors

MIN_PARTS = 4  # least number of parts whose scatter is used as an estimate

TIME_CONSTANTS = 1.0  # least length of a part in time constants of the slowest mode


@dataclass(frozen=True)
class RefittedModes:
    """Modes that were refitted to one recording alone by a linear model."""

    name: str
    level: float  # root mean square excitation, all directions together
    # logarithms of natural frequencies (rad/s), then damping ratios as they are (no logarithms), and the standard
    # errors of both, (2, n_modes)
    values: Real
    errors: Real
    # change of ``values`` over the length of the recording, and its standard error, (2, n_modes); nan if there are too
    # few parts
    drift: Real
    drift_errors: Real
    freedom: int  # degrees of freedom of the errors: one less than the number of parts
    misfit: float  # root mean square residual of the refit, over the response


def half_around(lines: WindowedSpectrum, frequency: float) -> WindowedSpectrum:
    """Return the half of the lines of a recording that are nearest to a frequency, Hz."""
    count = len(lines.frequencies)
    first = int(np.clip(np.searchsorted(lines.frequencies, frequency) - count // 4, 0, count - count // 2))
    names = ("band", "frequencies", "force_here", "measured", "trust")
    return replace(lines, **{name: getattr(lines, name)[first : first + count // 2] for name in names})


def refitted_modes(start: Hypothesis, lines: WindowedSpectrum, alone: int | None = None) -> RefittedModes:
    """Fit natural frequencies, damping ratios and (nearly free) shapes to one recording by least squares.

    ``alone``: index of the only mode that is fitted, with all others fixed at ``start``; None fits all.

    Each response is weighted by its residual. Let J be the derivative and r the residual of all lines (real and
    imaginary parts), P the precision of a weak prior, and Q its part for frequencies and damping. With ``A = J^T J +
    P``, the covariance is ``A^-1 (Q + sum_c g_c g_c^T) A^-1`` with the gradients ``g_c = J_c^T r_c`` of clusters c. Q
    is all of the error of a mode that no response shows; the prior of the shapes draws all recordings alike, and
    changes no difference between them. The covariance is computed with clusters of neighbouring lines (White,
    Econometrica 48, 817, 1980; Newey & West, Econometrica 55, 703, 1987) and with clusters of parts in time (Liang &
    Zeger, Biometrika 73, 13, 1986), and the larger variance is used. The residual of a nonlinear structure is more than
    noise, and is correlated differently in frequency and in time.
    """
    parts = _parts(lines, float((-start.model.poles.real).min()))
    thinned = lines.thinned(FITTING.thinned_lines)
    # if recordings disagree, the fit to all recordings may be far from each one: the nominal model is a second start
    starts = (start,) if start.causes or alone is not None else (start, start.nominal)
    states = [_descended(hypothesis, thinned, alone) for hypothesis in starts]
    state = min(states, key=lambda descended: descended.misfit)
    slope, residual, inverse = state.slope, state.residual, state.inverse
    by_line = _line_gradients(slope, residual, inverse)
    of_numbers = np.where(state.precision == NUMBER_PRECISION, NUMBER_PRECISION, 0.0)
    by_prior = np.einsum("ij,j,ij->i", inverse, of_numbers, inverse)
    variance = np.diag(inverse @ by_line @ inverse) + by_prior
    drift = drift_error = np.full(slope.shape[-1], np.nan)
    if len(parts) >= MIN_PARTS:
        moves = _part_steps(parts, state, lines, thinned)
        scatter = np.sum(moves**2, axis=0) / (len(moves) * (len(moves) - 1))
        variance = np.maximum(variance, scatter + by_prior)
        drift, drift_error = _slope_over_time(moves)
        drift_error = np.hypot(drift_error, np.sqrt(by_prior))
    freedom = max(len(parts), MIN_PARTS) - 1
    return _in_numbers(state, thinned, freedom, (variance, drift, drift_error))


@dataclass(frozen=True)
class _State:
    """A hypothesis with its residual, in units of the root mean square residual of each response."""

    hypothesis: Hypothesis
    unit: Real
    slope: Real
    residual: Real
    inverse: Real
    precision: Real  # of the prior
    misfit: float


def _descended(start: Hypothesis, lines: WindowedSpectrum, alone: int | None = None) -> _State:
    """Minimise the residual by Gauss-Newton steps with step halving; each response is scaled by its latest residual."""
    shape = start.shape
    precision = np.full(shape.size, SHAPE_PRECISION)
    rows = np.zeros((len(shape.nominal.poles), shape.per_mode), dtype=bool)
    rows[:, :2] = True
    precision[: shape.modal_size][rows.ravel()] = NUMBER_PRECISION
    if alone is not None:
        fixed = np.ones(shape.size, dtype=bool)
        fixed[alone * shape.per_mode : (alone + 1) * shape.per_mode] = False
        precision[fixed] = FIXED_PRECISION
    size = np.sqrt(np.mean(np.abs(lines.measured) ** 2, axis=0))
    current, residual = start, lines.measured - predict_lines(start, lines).response
    for _ in range(STEPS):
        unit = np.maximum(np.sqrt(np.mean(np.abs(residual) ** 2, axis=0)), 1e-6 * size)
        slope, scaled_residual = _stacked(current, lines, residual, unit)
        matrix = np.einsum("ckpi,ckpj->ij", slope, slope, optimize=True) + np.diag(precision)
        step = np.linalg.solve(
            matrix, np.einsum("ckpi,ckp->i", slope, scaled_residual, optimize=True) - precision * (current.u - start.u)
        )
        before = float(np.sum(scaled_residual**2) + precision @ (current.u - start.u) ** 2)
        gain = 0.0
        for share in (1.0, 0.5, 0.25, 0.1):
            trial = replace(current, u=current.u + share * step)
            trial_residual = lines.measured - predict_lines(trial, lines).response
            after = float(np.sum(np.abs(trial_residual / unit) ** 2) + precision @ (trial.u - start.u) ** 2)
            if after < before:
                gain, current, residual = 1 - after / before, trial, trial_residual
                break
        if gain < CONVERGED_GAIN:
            break
    unit = np.maximum(np.sqrt(np.mean(np.abs(residual) ** 2, axis=0)), 1e-6 * size)
    slope, scaled_residual = _stacked(current, lines, residual, unit)
    matrix = np.einsum("ckpi,ckpj->ij", slope, slope, optimize=True) + np.diag(precision)
    misfit = float(np.linalg.norm(residual / size) / np.linalg.norm(lines.measured / size))
    return _State(current, unit, slope, scaled_residual, np.linalg.inv(matrix), precision, misfit)


def _stacked(hypothesis: Hypothesis, lines: WindowedSpectrum, residual: Complex, unit: Real) -> tuple[Real, Real]:
    """Return the derivative of the prediction and the residual, in the unit of each response.

    Their shapes are (2, n_lines, n_responses, size) and (2, n_lines, n_responses).
    """
    slope = hypothesis.shape.jacobian(hypothesis.u, lines.frequencies, lines.force_here)
    slope = slope * (lines.kinematic / unit)[..., None]
    scaled = residual / unit
    return np.stack([slope.real, slope.imag]), np.stack([scaled.real, scaled.imag])


def _line_gradients(slope: Real, residual: Real, inverse: Real) -> Real:
    """Return the sum of products of the gradients of each line and its neighbours, corrected for leverage."""
    leverage = np.einsum("ckpi,ij,ckpj->ckp", slope, inverse, slope, optimize=True)
    scores = np.einsum("ckpi,ckp->ki", slope, residual / np.maximum(1 - leverage, 0.1), optimize=True)
    neighbours = scores[1:].T @ scores[:-1]
    return np.asarray(scores.T @ scores + 0.5 * (neighbours + neighbours.T))


def _parts(lines: WindowedSpectrum, decay: float) -> list[slice]:
    """Return the samples of the window in each part; one part if the recording is too short."""
    n = len(lines.window)
    shortest = max(
        TIME_CONSTANTS * lines.recording.rate / decay, 8 * lines.recording.rate / float(lines.frequencies[0])
    )
    count = int(np.clip(n / shortest, 1, PARTS))
    ends = np.linspace(0, n, count + 1).astype(int)
    return [slice(int(a), int(b)) for a, b in pairwise(ends)]


def _part_steps(parts: list[slice], state: _State, lines: WindowedSpectrum, thinned: WindowedSpectrum) -> Real:
    """Return the first-order step to the estimate of each part of the recording, (n_parts, size)."""
    predicted = thinned.signal(predict_lines(state.hypothesis, thinned).spectrum)
    samples = slice(lines.start, lines.start + len(lines.window))
    residual = (lines.recording.response[samples] - predicted[samples]) * lines.window[:, None] / state.unit
    steps = []
    for part in parts:
        part_residual = np.zeros_like(residual)
        part_residual[part] = residual[part]
        spectrum = scipy.fft.rfft(part_residual, axis=0)[thinned.band]
        gradient = np.einsum("ckpi,ckp->i", state.slope, np.stack([spectrum.real, spectrum.imag]), optimize=True)
        steps.append(len(parts) * state.inverse @ gradient)
    result = np.array(steps)
    return np.asarray(result - result.mean(axis=0))


def _slope_over_time(moves: Real) -> tuple[Real, Real]:
    """Return the change over the recording from a line through the parts, and its standard error, each (size,)."""
    count = len(moves)
    time = (np.arange(count) + 0.5) / count - 0.5
    power = float(time @ time)
    slope = time @ moves / power
    scatter = np.sum((moves - np.outer(time, slope)) ** 2, axis=0) / (count - 2)
    return np.asarray(slope), np.sqrt(scatter / power)


def _in_numbers(
    state: _State, lines: WindowedSpectrum, freedom: int, mode_numbers: tuple[Real, Real, Real]
) -> RefittedModes:
    """Convert deviations in laboratory errors to logarithms of frequencies and to damping ratios, with their errors."""
    shape = state.hypothesis.shape
    model, rows = state.hypothesis.model, [shape.modal_rows(values)[:, :2].T for values in mode_numbers]
    damping = model.damping_ratios
    units = np.stack([np.full(len(damping), shape.lab.frequency), shape.lab.damping * damping])
    return RefittedModes(
        lines.recording.name,
        lines.recording.level,
        np.stack([np.log(np.abs(model.poles)), damping]),
        units * np.sqrt(rows[0]),
        units * rows[1],
        units * rows[2],
        freedom,
        state.misfit,
    )


MAX_FITTED = 0.5  # largest share of the noise power that a refit is assumed to have fitted


@dataclass(frozen=True)
class BetterRefit:
    """A recording whose residual is not noise, as modes refitted to this recording alone explain much of it."""

    name: str
    left: float  # root mean square residual of the result, over the response
    alone: float

    @property
    def sentence(self) -> str:
        """Sentence for the reader."""
        return (
            f"the answer leaves {100 * self.left:.3g} % of {self.name}, and modes that are refitted to it alone leave "
            f"{100 * self.alone:.3g} %: this residual is not noise, so the answer is incomplete"
        )


def better_refits(
    answer: Hypothesis, base: Hypothesis, recordings: Sequence[WindowedSpectrum], settings: VerdictSettings
) -> tuple[BetterRefit, ...]:
    """Return the recordings whose residual is far larger than with modes refitted to the recording alone.

    Noise that is inferred from the residual includes all of it. What a linear model of one recording describes is no
    noise of that recording. With n_p numbers, the refit also fits the share ``n_p / (2 n_lines n_r)`` of the power of
    white noise, for which it is corrected.
    """
    result = []
    for recording in recordings:
        error = float(np.sqrt(np.mean(relative_residual_power(answer, recording))))
        if error <= settings.most_not_noise:
            continue
        refit_error = _refit_error(base, recording)
        difference = np.sqrt(max(error**2 - refit_error**2, 0.0))
        if error > settings.most_over_alone * refit_error and difference > settings.most_not_noise:
            result.append(BetterRefit(recording.recording.name, error, refit_error))
    return tuple(result)


def _refit_error(base: Hypothesis, lines: WindowedSpectrum) -> float:
    """Return the root mean square residual of modes refitted to the recording, over the response.

    It is infinite if the refit fails.
    """
    try:
        misfit = refitted_modes(base, lines).misfit
    except (MillfrfError, ValueError, ArithmeticError, np.linalg.LinAlgError):
        return np.inf
    numbers = 2 * min(len(lines.frequencies), FITTING.thinned_lines) * lines.measured.shape[1]
    return misfit / float(np.sqrt(1 - min(base.shape.modal_size / numbers, MAX_FITTED)))
