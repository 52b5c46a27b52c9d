"""Error bars of frequencies and dampings: noise, and what changes with points, band and out-of-band terms."""

from collections.abc import Iterable, Iterator

import numpy as np

from ..models.mode_errors import ModeErrors
from .variable_projection.elimination import Elimination, Modes, Real
from .variable_projection.neighbourhood import half_power_lines
from .variable_projection.outside_terms import with_fixed_poles
from .variable_projection.refinement import normal_equations, refine, weighted_matrix, without_response
from .variable_projection.whitened_lines import MeasuredLines

_EDGE = 0.05  # of the band
_OTHER_POLES = (((0.5,), (1.6, 4.0)), ((0.85,), (1.15, 2.0)))  # of the band's lower and upper end
_TO_FEWER = (((0.7,), (1.3, 3.0)), ((), (2.0,)))  # where the fit has fewer than three fixed poles
_ALL_POLES = 3
_STEPS, _TOLERANCE = 8, 1e-5
_FEWEST_RESPONSES = 4
_SMOOTH = 4  # lines to each side over which the squared error is averaged


def mode_errors(modes: Modes, lines: MeasuredLines, found: Elimination, unknowns: Real) -> ModeErrors:
    """Compute standard errors of each mode, by their source.

    Parameters
    ----------
    modes, lines, found
        Modes, lines and elimination of the fit.
    unknowns : (2 n_unknowns, 2 n_unknowns)
        Covariance of poles and free left entries by the noise.
    """
    n = len(modes.poles)
    n_unknowns = len(unknowns) // 2
    of_poles = np.r_[0:n, n_unknowns : n_unknowns + n]
    by_pole = _by_pole(modes)
    covariance = unknowns[np.ix_(of_poles, of_poles)]
    noise = np.sqrt(np.maximum(np.einsum("rxi,ij,rxj->rx", by_pole, covariance, by_pole), 0.0))
    return ModeErrors(
        noise,
        _over_points(modes, lines, found, by_pole),
        _scatter(modes, _narrowed(modes, lines)),
        _scatter(modes, _other_terms(lines)),
    )


def _by_pole(modes: Modes) -> Real:
    """Derivative of frequency (Hz) and damping ratio by (real parts, imaginary parts) of poles, (n, 2, 2n)."""
    n, size = len(modes.poles), np.abs(modes.poles)
    real, imaginary = modes.poles.real, modes.poles.imag
    derivative = np.zeros((n, 2, 2 * n))
    rows = np.arange(n)
    derivative[rows, 0, rows], derivative[rows, 0, n + rows] = real / size / (2 * np.pi), imaginary / size / (2 * np.pi)
    derivative[rows, 1, rows] = -(imaginary**2) / size**3
    derivative[rows, 1, n + rows] = real * imaginary / size**3
    return derivative


def _over_points(modes: Modes, lines: MeasuredLines, found: Elimination, by_pole: Real) -> Real:
    """Jackknife over the responses, each left out by one Gauss-Newton step from the optimum of all."""
    n, n_responses = len(modes.poles), lines.values.shape[2]
    if n_responses < _FEWEST_RESPONSES:
        return np.full((n, 2), np.nan)
    normal = normal_equations(modes, lines, found)
    scale = np.sqrt(np.maximum(np.diag(normal.matrix), 1e-300))
    n_unknowns = len(scale) // 2
    of_poles = np.r_[0:n, n_unknowns : n_unknowns + n]
    moved = []
    for left_out in range(n_responses):
        matrix, gradient = without_response(normal, left_out)
        regular = matrix / np.outer(scale, scale) + 1e-9 * np.eye(len(scale))
        step = np.linalg.solve(regular, gradient / scale) / scale
        moved.append(by_pole @ step[of_poles])
    scatter = np.var(np.array(moved), axis=0) * (n_responses - 1)
    return np.asarray(np.sqrt(scatter))


def _narrowed(modes: Modes, lines: MeasuredLines) -> Iterator[MeasuredLines]:
    """The lines with one edge of the band moved inwards, where no mode stands in what is lost."""
    low, high = lines.frequencies[0], lines.frequencies[-1]
    step = _EDGE * (high - low)
    for inside in (lines.frequencies >= low + step, lines.frequencies <= high - step):
        if not any((half_power_lines(complex(pole), lines) & ~inside).any() for pole in modes.poles):
            yield lines.part(inside)


def _other_terms(lines: MeasuredLines) -> Iterator[MeasuredLines]:
    """The lines with the fixed poles outside the band at other places, or with more and with fewer of them."""
    for below, above in _OTHER_POLES if len(lines.outside_poles) == _ALL_POLES else _TO_FEWER:
        yield with_fixed_poles(lines, below, above)


def _scatter(modes: Modes, variants: Iterable[MeasuredLines]) -> Real:
    """Root mean square change of frequency and damping ratio with other lines, (n_modes, 2)."""
    others = [refine(modes, lines, steps=_STEPS, tolerance=_TOLERANCE).modes for lines in variants]
    if not others:
        return np.full((len(modes.poles), 2), np.nan)
    changes = [
        np.stack([other.frequencies - modes.frequencies, other.damping_ratios - modes.damping_ratios], axis=1)
        for other in others
    ]
    return np.asarray(np.sqrt(np.mean(np.square(changes), axis=0)))


def unknowns_covariance(modes: Modes, lines: MeasuredLines, found: Elimination, scale: float) -> Real:
    """Compute the covariance of the real unknowns: real parts of poles and free left entries, then imaginary parts.

    ``M^-1 (sum over lines of J^T v J) M^-1`` with v the squared error around each line, so that noise that is
    stronger at resonances widens the bars of what they decide (White, Econometrica 48, 1980).

    Parameters
    ----------
    modes, lines, found
        Modes, lines and elimination of the fit.
    scale
        Variance of a whitened complex value; half of it is in each part.
    """
    level = _smoothed(found.power(lines))
    level = level / max(float(level.mean()), 1e-300)
    normal = normal_equations(modes, lines, found)
    size = np.sqrt(np.maximum(np.diag(normal.matrix), 1e-300))
    inverse = np.linalg.pinv(normal.matrix / np.outer(size, size), hermitian=True) / np.outer(size, size)
    repeated = np.tile(np.repeat(level, lines.drive.shape[1]), 2)
    return np.asarray(0.5 * scale * inverse @ weighted_matrix(modes, lines, found, repeated) @ inverse)


def _smoothed(level: Real) -> Real:
    """Running mean over neighbouring lines."""
    reach = min(_SMOOTH, (len(level) - 1) // 2)
    padded = np.concatenate([level[reach:0:-1], level, level[-2 : -reach - 2 : -1]])
    return np.asarray(np.convolve(padded, np.ones(2 * reach + 1) / (2 * reach + 1), "valid"))
