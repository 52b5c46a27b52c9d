"""Natural frequencies and damping ratios over the level of the forces."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import FRF_ORDERS, LinearApproximation, SteadyPeriods, derivative_orders, linear_approximation
from millfrf.core import Band, Complex, InputError, MillfrfError, Real

from .polyreference import fit_polyreference
from .settings import SETTINGS


@dataclass(frozen=True)
class LevelFit:
    """Fitted modes of one level, with standard errors and misfit."""

    frequencies: Real  # (n_modes,), Hz, in the order of the start values
    damping: Real  # (n_modes,): damping ratios
    covariance: Real  # (2 n_modes, 2 n_modes): covariance of ln frequencies, then of damping ratios
    misfit: Real  # (n_responses,): root mean square residual over the root mean square response

    @property
    def frequency_errors(self) -> Real:
        """Return the standard errors of the natural frequencies, Hz, shape (n_modes,)."""
        n = len(self.frequencies)
        return np.asarray(self.frequencies * np.sqrt(np.diag(self.covariance)[:n]))

    @property
    def damping_errors(self) -> Real:
        """Return the standard errors of the damping ratios, shape (n_modes,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[len(self.frequencies) :]))


def fit_level(linear: LinearApproximation, band: Band, frequencies: Real, damping: Real) -> LevelFit:
    """Fit a given number of modes to the FRF of one level, weighted by the force of each line.

    The model is ``H = sum_r (a_r w_r^2 + b_r w_r s) / (s^2 + 2 zeta_r w_r s + w_r^2) + L / s^2 + U`` with the least
    ``sum_k |dH_k F_k|^2``, each response in units of its root mean square; a, b, L and U are eliminated (variable
    projection, Golub & Pereyra, SIAM J. Numer. Anal. 10, 413, 1973).

    The residual of a nonlinear structure is larger than the noise, and not even over the lines. The covariance is
    therefore the sandwich ``(J^T J)^-1 (sum_k J_k^T r_k r_k^T J_k) (J^T J)^-1`` over lines k with
    ``r / (1 - leverage)`` (HC3: MacKinnon & White, J. Econometrics 29, 305, 1985); no variance is below that by noise.

    Parameters
    ----------
    linear
        FRF of the level on its excited lines.
    band : Hz
        Lowest and highest frequency fitted.
    frequencies : (n_modes,), Hz
        Start values of the natural frequencies.
    damping : (n_modes,)
        Start values of the damping ratios.

    Raises
    ------
    InputError
        Fewer lines in the band than the fit needs.
    MillfrfError
        The search leaves the band or does not converge.
    """
    n = len(frequencies)
    lines = linear.frf.valid & (linear.frf.frequencies >= band[0]) & (linear.frf.frequencies <= band[1])
    if lines.sum() < 3 * n + 4:
        raise InputError(
            f"{int(lines.sum())} excited lines between {band[0]:g} and {band[1]:g} Hz for {n} modes; "
            f"{3 * n + 4} are needed: widen the band"
        )
    s = np.asarray(2j * np.pi * linear.frf.frequencies[lines], dtype=np.complex128)
    measured, weight, noise = _weighted(linear, lines)
    order = FRF_ORDERS.get(linear.frf.quantity, 0)
    start = np.concatenate([np.log(frequencies), np.log(damping)])
    scale = np.concatenate([damping, np.full(n, 0.3)])  # typical changes of ln frequency and ln damping
    fit = scipy.optimize.least_squares(
        lambda x: _residual(x, s, measured, weight, order)[0], start, x_scale=scale, max_nfev=60
    )
    fitted = np.exp(fit.x)
    if not fit.success or fitted[:n].min() < 0.8 * band[0] or fitted[:n].max() > 1.2 * band[1]:
        raise MillfrfError(
            f"a linear fit of {n} modes at {linear.level:.3g} N rms does not converge within {band[0]:g} to "
            f"{band[1]:g} Hz; fit fewer modes or another band"
        )
    leverage = _residual(fit.x, s, measured, weight, order)[1]
    covariance = _sandwich(fit.jac, fit.fun, leverage, noise)
    slope = np.concatenate([np.ones(n), fitted[n:]])  # from ln damping to damping
    squared = fit.fun.reshape(2, *measured.shape) ** 2
    size = np.sum(np.abs(measured) ** 2, axis=(0, 2))
    misfit = np.sqrt(squared.sum(axis=(0, 1, 3)) / size)
    return LevelFit(fitted[:n], fitted[n:], covariance * np.outer(slope, slope), misfit)


def _weighted(linear: LinearApproximation, lines: NDArray[np.bool_]) -> tuple[Complex, Real, Complex]:
    """Return the FRF times the size of each force, that size, and the noise of the scaled responses.

    The scaled responses have a root mean square of 1.
    """
    size = 1 / np.sqrt(np.einsum("kqq->kq", linear.excitation[lines]).real)
    values = linear.frf.values[lines] * size[:, None, :]
    unit = np.sqrt(np.mean(np.abs(values) ** 2, axis=(0, 2)))
    return values / unit[:, None], size, linear.noise[lines] / np.outer(unit, unit)


def _regressors(unknowns: Real, s: Complex, order: int) -> Complex:
    """Return the columns whose coefficients are eliminated, shape (n_lines, 2 n_modes + 2)."""
    n = len(unknowns) // 2
    w, zeta = 2 * np.pi * np.exp(unknowns[:n]), np.exp(unknowns[n:])
    resonances = 1 / (s[:, None] ** 2 + 2 * zeta * w * s[:, None] + w**2)
    unit = abs(s[-1])
    modes = [w**2 * resonances, w * s[:, None] * resonances]
    columns = np.concatenate([*modes, (unit / s[:, None]) ** 2, np.ones((len(s), 1))], axis=1)
    return np.asarray(columns * (s[:, None] / unit) ** order)


def _residual(unknowns: Real, s: Complex, measured: Complex, weight: Real, order: int) -> tuple[Real, Real]:
    """Return the residual after the elimination, and the leverage of the eliminated coefficients.

    Both have shape (2 n_lines n_responses n_excitations,): first the real parts of all lines, then the imaginary parts.
    """
    columns = _regressors(unknowns, s, order)
    residual, leverage = np.empty((2, *measured.shape)), np.empty((2, *measured.shape))
    for q in range(measured.shape[2]):
        design = columns * weight[:, q, None]
        real = np.concatenate([design.real, design.imag])
        orthogonal = np.linalg.qr(real / np.linalg.norm(real, axis=0))[0]
        target = np.concatenate([measured[:, :, q].real, measured[:, :, q].imag])
        residual[..., q] = (target - orthogonal @ (orthogonal.T @ target)).reshape(2, len(s), -1)
        leverage[..., q] = np.sum(orthogonal**2, axis=1).reshape(2, len(s), 1)
    return residual.ravel(), leverage.ravel()


def _sandwich(jacobian: Real, residual: Real, eliminated: Real, noise: Complex) -> Real:
    """Return the covariance of the unknowns from the residual of each line.

    No variance is smaller than the noise alone gives.
    """
    n_lines, n = noise.shape[:2]
    inverse = np.linalg.pinv(jacobian.T @ jacobian)
    leverage = eliminated + np.einsum("ij,jk,ik->i", jacobian, inverse, jacobian)
    scores = jacobian * (residual / np.maximum(1 - leverage, 0.1))[:, None]
    per_line = scores.reshape(2, n_lines, -1, jacobian.shape[1]).sum(axis=(0, 2))
    middle = per_line.T @ per_line
    # residuals of neighbouring lines are correlated: Bartlett's weight for a lag of one (Newey & West 1987)
    neighbours = per_line[1:].T @ per_line[:-1]
    covariance = inverse @ (middle + 0.5 * (neighbours + neighbours.T)) @ inverse
    slopes = jacobian.reshape(2, n_lines, n, -1, jacobian.shape[1])
    slope = slopes[0] + 1j * slopes[1]  # noise of the forces moves all responses together
    by_noise = 0.5 * np.einsum("kpqi,kpu,kuqj->ij", slope.conj(), noise, slope, optimize=True).real
    least = np.diag(inverse @ by_noise @ inverse)
    raised = np.sqrt(np.maximum(1.0, least / np.maximum(np.diag(covariance), 1e-300)))
    return np.asarray(covariance * np.outer(raised, raised))


@dataclass(frozen=True)
class ModeChange:
    """Change of one mode between two levels."""

    mode: int  # number of the mode, from 1
    frequency: float  # Hz: natural frequency at the lower level
    levels: tuple[float, float]  # N: root mean square of the forces at either level
    frequency_change: float  # natural frequency at the higher level over that at the lower level, minus 1
    frequency_error: float  # standard error of the change
    frequency_p_value: float  # probability of such a change by the errors of both fits
    damping_change: float  # damping ratio at the higher level over that at the lower level, minus 1
    damping_error: float
    damping_p_value: float

    def sentence(self) -> str:
        """Describe the change with two standard errors, and whether it is significant."""
        f_error, zeta_error = (_one_digit_percent(2 * error) for error in (self.frequency_error, self.damping_error))
        verb = "stiffens" if self.frequency_change > 0 else "softens"
        frequency = f"{verb} by {100 * abs(self.frequency_change):.2g} +- {f_error} %"
        if self.frequency_p_value > SETTINGS.significance:
            frequency = f"frequency {100 * self.frequency_change:+.2g} +- {f_error} %, within its error"
        verb = "gains" if self.damping_change > 0 else "loses"
        damping = f"{verb} {100 * abs(self.damping_change):.2g} +- {zeta_error} % of its damping"
        if self.damping_p_value > SETTINGS.significance:
            damping = f"damping {100 * self.damping_change:+.2g} +- {zeta_error} %, within its error"
        low, high = self.levels
        return f"mode at {self.frequency:.4g} Hz, {low:.3g} to {high:.3g} N rms: {frequency}, {damping}"


@dataclass(frozen=True)
class AmplitudeDependence:
    """Modes over the level of the forces.

    Parameters
    ----------
    levels : (n_levels,), N
        Root mean square of the forces, rising.
    deflections : (n_levels, n_responses), m
        Root mean square displacement at each response, over all excited lines of the band.
    fits
        Linear fit of each level, all with the same modes in the same order.
    responses
        Names of the responses.
    """

    levels: Real
    deflections: Real
    fits: tuple[LevelFit, ...]
    responses: tuple[str, ...]

    def changes(self) -> tuple[ModeChange, ...]:
        """Return the change of each mode from the lowest to the highest level."""
        first, last = self.fits[0], self.fits[-1]
        levels = (float(self.levels[0]), float(self.levels[-1]))
        f1, f2, zeta1, zeta2 = first.frequencies, last.frequencies, first.damping, last.damping
        shift, gain = f2 / f1 - 1, zeta2 / zeta1 - 1
        shift_error = np.hypot(first.frequency_errors / f1, last.frequency_errors / f2)
        gain_error = (1 + gain) * np.hypot(first.damping_errors / zeta1, last.damping_errors / zeta2)
        # the test of the damping is on the difference, whose error does not depend on the change itself
        sigmas = (zeta2 - zeta1) / np.hypot(first.damping_errors, last.damping_errors)
        columns = (f1, shift, shift_error, _two_sided(shift / shift_error), gain, gain_error, _two_sided(sigmas))
        rows = (map(float, row) for row in zip(*columns, strict=True))
        return tuple(ModeChange(r, next(row), levels, *row) for r, row in enumerate(rows, start=1))

    def sentences(self) -> tuple[str, ...]:
        """Describe the change of each mode in one sentence."""
        return tuple(change.sentence() for change in self.changes())


def amplitude_dependence(
    levels: Sequence[SteadyPeriods], band: Band, modes: Sequence[tuple[float, float]] | None = None
) -> AmplitudeDependence:
    """Fit the same modes to each level by a linear model, and show how the modes change with the level.

    A mode of a nonlinear structure has no single frequency. The frequency of the best linear approximation at each
    level changes with the stiffness, and the damping ratio with the energy lost in a cycle (Kerschen et al., Mech.
    Syst. Signal Process. 20, 505, 2006). Shapes may change as well; they are not compared.

    Parameters
    ----------
    levels
        Steady periods of at least two levels, of the same channels; see :func:`estimation.steady_periods`.
    band : Hz
        Lowest and highest frequency fitted.
    modes
        Start values of natural frequency (Hz) and damping ratio of each mode; None: those that
        :func:`fit_polyreference` finds at the lowest level.

    Raises
    ------
    InputError
        Fewer than two levels, different channels, or too few lines in the band.
    MillfrfError
        No mode is found, or a fit does not converge.
    """
    if len(levels) < 2:
        raise InputError(f"{len(levels)} level given; give at least two, so that a change can be seen")
    if len({(level.excitations, level.responses) for level in levels}) > 1:
        raise InputError("levels of different channels cannot be compared; give the same channels in the same order")
    ordered = sorted(levels, key=lambda level: level.level)
    approximations = [linear_approximation(level) for level in ordered]
    start = _start(approximations[0], band) if modes is None else np.array(modes, dtype=float)
    fits: list[LevelFit] = []
    for linear in approximations:
        fits.append(fit_level(linear, band, start[:, 0], start[:, 1]))
        start = np.column_stack([fits[-1].frequencies, fits[-1].damping])
    return AmplitudeDependence(
        np.array([linear.level for linear in approximations]),
        np.array([_deflection(*pair, band) for pair in zip(approximations, ordered, strict=True)]),
        tuple(fits),
        tuple(channel.name for channel in ordered[0].responses),
    )


def _start(linear: LinearApproximation, band: Band) -> Real:
    """Return frequency (Hz) and damping ratio of the modes at the lowest level, shape (n_modes, 2)."""
    frf = replace(linear.frf, covariance=None)  # the residual of a nonlinear structure is no noise to weight by
    model = fit_polyreference(frf, band).model
    spacing = float(np.median(np.diff(linear.frf.frequencies)))
    f, zeta = model.natural_frequencies, model.damping_ratios
    # a pole far narrower than the spacing of the lines is spurious
    usable = (f > band[0]) & (f < band[1]) & (2 * zeta * f > 0.2 * spacing)
    modes = np.column_stack([f, zeta])[usable]
    return np.asarray(modes[np.argsort(modes[:, 0])])


def _deflection(linear: LinearApproximation, periods: SteadyPeriods, band: Band) -> Real:
    """Return the root mean square displacement of each response over the lines in the band, m, shape (n_responses,)."""
    f = linear.frf.frequencies
    inside = (f >= band[0]) & (f <= band[1])
    orders = derivative_orders(periods.responses)
    scale = (2 * np.pi * f[inside, None]) ** (-2.0 * orders)
    return np.asarray(np.sqrt(2 * np.sum(linear.power[inside] * scale, axis=0) / round(periods.period * periods.rate)))


def _one_digit_percent(share: float) -> str:
    """Write a share in per cent with one significant digit, without a power of ten."""
    return f"{float(f'{100 * share:.1g}'):g}"


def _two_sided(sigmas: Real) -> Real:
    """Return the probability that a normal variable deviates by more than ``sigmas`` standard errors to either side."""
    return np.asarray(scipy.special.erfc(np.abs(sigmas) / np.sqrt(2)))
