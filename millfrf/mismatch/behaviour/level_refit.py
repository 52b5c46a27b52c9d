"""Linear refits of single recordings, with error bars that include unmodelled dynamics."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy

from estimation import WindowedSpectrum
from millfrf.core import Complex, MillfrfError, Real

from ..inference.settings import VerdictSettings
from ..models.fitting import ENOUGH
from ..models.hypothesis import Hypothesis, predict_lines
from ..models.misfit import shares_left

STEPS = 10
"""Steps of the refit at most."""

ENOUGH_GAINED = 1e-3
"""Fall of the misfit, as a share, below which the refit ends."""

SHAPES = 0.01
"""Precision of the belief that shapes stay as they are, in lab errors: they may move by ten of them."""

PARTS = 8
"""Parts of a recording at most; what they ask for apart from each other enters the error bars."""

FEWEST_PARTS = 4
"""Parts from which their scatter is an estimate."""

RINGS = 1.0
"""Least length of a part in time constants of the slowest mode."""


@dataclass(frozen=True)
class RefittedModes:
    """Modes of one recording by a linear model of its own.

    Parameters
    ----------
    name
        Name of the recording.
    level
        Root mean square of what drives the rig, all directions together.
    values, errors : (2, n_modes)
        Logarithms of natural frequencies (rad/s), then damping ratios as they are (no logarithms), and the standard
        errors of both.
    drift, drift_errors : (2, n_modes)
        Change of the same over the length of the recording, and its standard error; nan where parts are too few.
    freedom
        Degrees of freedom of the errors: one less than the parts that they rest on.
    misfit
        Root mean square that the refit leaves, over the response.
    """

    name: str
    level: float
    values: Real
    errors: Real
    drift: Real
    drift_errors: Real
    freedom: int
    misfit: float


def refitted_modes(start: Hypothesis, lines: WindowedSpectrum) -> RefittedModes:
    """Fit natural frequencies, damping ratios and (nearly free) shapes to one recording by least squares.

    Each response counts in units of what is left of it. With J and r real and imaginary parts of all lines and P the
    weak belief in the shapes, ``A = J^T J + P``, the covariance is ``A^-1 (sum_c g_c g_c^T) A^-1`` with the gradients
    ``g_c = J_c^T r_c`` of clusters c: once of lines with their neighbours (White, Econometrica 48, 817, 1980; Newey
    & West, Econometrica 55, 703, 1987), once of parts in time (Liang & Zeger, Biometrika 73, 13, 1986). The larger
    variance counts. A nonlinear structure leaves more than noise, and either sees another side of it.

    Parameters
    ----------
    start
        Modal model that the refit begins with; linear causes that it holds stay as they are.
    lines
        Windowed spectrum of the recording.
    """
    parts = _parts(lines, float((-start.model.poles.real).min()))
    few = lines.thinned(ENOUGH)
    # where recordings disagree, the fit to all of them may be far from each: the nominal model is another beginning
    beginnings = (start,) if start.causes else (start, start.nominal)
    state = min((_descended(one, few) for one in beginnings), key=lambda one: one.misfit)
    slope, rest, inverse = state.slope, state.rest, state.inverse
    by_line = _line_gradients(slope, rest, inverse)
    variance = np.diag(inverse @ by_line @ inverse)
    drift = drift_error = np.full(slope.shape[-1], np.nan)
    if len(parts) >= FEWEST_PARTS:
        moves = _part_moves(parts, state, lines, few)
        scatter = np.sum(moves**2, axis=0) / (len(moves) * (len(moves) - 1))
        variance = np.maximum(variance, scatter)
        drift, drift_error = _slope_over_time(moves)
    freedom = max(len(parts), FEWEST_PARTS) - 1
    return _in_numbers(state, few, freedom, (variance, drift, drift_error))


@dataclass(frozen=True)
class _State:
    """A hypothesis with what it leaves, in units of the root mean square that is left of each response."""

    hypothesis: Hypothesis
    unit: Real
    slope: Real
    rest: Real
    inverse: Real
    misfit: float


def _descended(start: Hypothesis, lines: WindowedSpectrum) -> _State:
    """Gauss-Newton with step halving; the unit of each response is that of what is left."""
    shape = start.shape
    belief = np.full(shape.size, SHAPES)
    rows = np.zeros((len(shape.nominal.poles), shape.per_mode), dtype=bool)
    rows[:, :2] = True
    belief[: shape.modal_size][rows.ravel()] = 1e-6
    size = np.sqrt(np.mean(np.abs(lines.measured) ** 2, axis=0))
    current, left = start, lines.measured - predict_lines(start, lines).response
    for _ in range(STEPS):
        unit = np.maximum(np.sqrt(np.mean(np.abs(left) ** 2, axis=0)), 1e-6 * size)
        slope, rest = _stacked(current, lines, left, unit)
        matrix = np.einsum("ckpi,ckpj->ij", slope, slope, optimize=True) + np.diag(belief)
        step = np.linalg.solve(
            matrix, np.einsum("ckpi,ckp->i", slope, rest, optimize=True) - belief * (current.u - start.u)
        )
        before = float(np.sum(rest**2) + belief @ (current.u - start.u) ** 2)
        gained = 0.0
        for share in (1.0, 0.5, 0.25, 0.1):
            there = replace(current, u=current.u + share * step)
            remains = lines.measured - predict_lines(there, lines).response
            after = float(np.sum(np.abs(remains / unit) ** 2) + belief @ (there.u - start.u) ** 2)
            if after < before:
                gained, current, left = 1 - after / before, there, remains
                break
        if gained < ENOUGH_GAINED:
            break
    unit = np.maximum(np.sqrt(np.mean(np.abs(left) ** 2, axis=0)), 1e-6 * size)
    slope, rest = _stacked(current, lines, left, unit)
    matrix = np.einsum("ckpi,ckpj->ij", slope, slope, optimize=True) + np.diag(belief)
    misfit = float(np.linalg.norm(left / size) / np.linalg.norm(lines.measured / size))
    return _State(current, unit, slope, rest, np.linalg.inv(matrix), misfit)


def _stacked(hypothesis: Hypothesis, lines: WindowedSpectrum, left: Complex, unit: Real) -> tuple[Real, Real]:
    """Derivative of the prediction (2, n_lines, n_responses, size), and what is left (2, n_lines, n_responses)."""
    slope = hypothesis.shape.jacobian(hypothesis.u, lines.frequencies, lines.force_here)
    slope = slope * (lines.kinematic / unit)[..., None]
    rest = left / unit
    return np.stack([slope.real, slope.imag]), np.stack([rest.real, rest.imag])


def _line_gradients(slope: Real, rest: Real, inverse: Real) -> Real:
    """Sum of squared gradients of lines, each with its neighbour; leverage counted."""
    leverage = np.einsum("ckpi,ij,ckpj->ckp", slope, inverse, slope, optimize=True)
    scores = np.einsum("ckpi,ckp->ki", slope, rest / np.maximum(1 - leverage, 0.1), optimize=True)
    beside = scores[1:].T @ scores[:-1]
    return np.asarray(scores.T @ scores + 0.5 * (beside + beside.T))


def _parts(lines: WindowedSpectrum, decay: float) -> list[slice]:
    """Samples of the window that belong to each part; one part where the recording is too short for several."""
    n = len(lines.window)
    shortest = max(RINGS * lines.recording.rate / decay, 8 * lines.recording.rate / float(lines.frequencies[0]))
    count = int(np.clip(n / shortest, 1, PARTS))
    ends = np.linspace(0, n, count + 1).astype(int)
    return [slice(int(a), int(b)) for a, b in pairwise(ends)]


def _part_moves(parts: list[slice], state: _State, lines: WindowedSpectrum, few: WindowedSpectrum) -> Real:
    """What each part of the recording alone asks for, to first order, (n_parts, size)."""
    predicted = few.signal(predict_lines(state.hypothesis, few).spectrum)
    kept = slice(lines.start, lines.start + len(lines.window))
    left = (lines.recording.response[kept] - predicted[kept]) * lines.window[:, None] / state.unit
    moves = []
    for part in parts:
        alone = np.zeros_like(left)
        alone[part] = left[part]
        spectrum = scipy.fft.rfft(alone, axis=0)[few.band]
        gradient = np.einsum("ckpi,ckp->i", state.slope, np.stack([spectrum.real, spectrum.imag]), optimize=True)
        moves.append(len(parts) * state.inverse @ gradient)
    found = np.array(moves)
    return np.asarray(found - found.mean(axis=0))


def _slope_over_time(moves: Real) -> tuple[Real, Real]:
    """Change over the whole recording by a line through the parts, and its standard error, each (size,)."""
    count = len(moves)
    time = (np.arange(count) + 0.5) / count - 0.5
    power = float(time @ time)
    slope = time @ moves / power
    scatter = np.sum((moves - np.outer(time, slope)) ** 2, axis=0) / (count - 2)
    return np.asarray(slope), np.sqrt(scatter / power)


def _in_numbers(state: _State, lines: WindowedSpectrum, freedom: int, found: tuple[Real, Real, Real]) -> RefittedModes:
    """Logarithms of frequencies, damping ratios as they are, and the errors of both, from lab errors."""
    shape = state.hypothesis.shape
    model, rows = state.hypothesis.model, [shape.modal_rows(one)[:, :2].T for one in found]
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


MOST_FITTED = 0.5
"""Share of the noise's power at most that a refit is taken to have fitted, however few its lines are."""


@dataclass(frozen=True)
class FollowedAlone:
    """A recording of which an answer leaves much that modes of its own follow: what is left there is no noise.

    Parameters
    ----------
    name
        Name of the recording.
    left
        Root mean square that the answer leaves, over the response.
    alone
        The same of modes that were refitted to the recording alone, with what they fit of the noise put back.
    """

    name: str
    left: float
    alone: float

    @property
    def sentence(self) -> str:
        """What a reader is told."""
        return (
            f"the answer leaves {100 * self.left:.3g} % of {self.name}, and modes that are refitted to it alone leave "
            f"{100 * self.alone:.3g} %: what is left there is no noise, so the answer is not whole"
        )


def followed_alone(
    answer: Hypothesis, base: Hypothesis, recordings: Sequence[WindowedSpectrum], settings: VerdictSettings
) -> tuple[FollowedAlone, ...]:
    """Recordings of which an answer leaves far more than modes that are refitted to each alone.

    Noise that is inferred from what an answer leaves would hold all of it. What a linear model of one recording
    follows is no noise of that recording. With n_p numbers, the refit follows the share ``n_p / (2 n_lines n_r)`` of
    the power of white noise as well, which is put back.

    Parameters
    ----------
    answer
        The hypothesis that would be told.
    base
        Modal parameters alone, fitted to all recordings: where the refits begin.
    recordings
        Recordings without tones and with clipped samples put back.
    settings
        Thresholds of the verdict.
    """
    found = []
    for one in recordings:
        left = float(np.sqrt(np.mean(shares_left(answer, one))))
        if left <= settings.most_not_noise:
            continue
        alone = _left_alone(base, one)
        apart = np.sqrt(max(left**2 - alone**2, 0.0))
        if left > settings.most_over_alone * alone and apart > settings.most_not_noise:
            found.append(FollowedAlone(one.recording.name, left, alone))
    return tuple(found)


def _left_alone(base: Hypothesis, lines: WindowedSpectrum) -> float:
    """Root mean square that modes of the recording's own leave, over the response; infinite where no refit is found."""
    try:
        misfit = refitted_modes(base, lines).misfit
    except (MillfrfError, ValueError, ArithmeticError, np.linalg.LinAlgError):
        return np.inf
    numbers = 2 * min(len(lines.frequencies), ENOUGH) * lines.measured.shape[1]
    return misfit / float(np.sqrt(1 - min(base.shape.modal_size / numbers, MOST_FITTED)))
