"""Natural frequencies and damping ratios over the level of the forces."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import FRF_ORDERS, LinearApproximation, SteadyPeriods, derivative_orders, linear_approximation
from millfrf.core import Complex, InputError, MillfrfError, Real

from .polyreference import fit_polyreference


@dataclass(frozen=True)
class LevelFit:
    """Modes of one level.

    Parameters
    ----------
    frequencies : (n_modes,), Hz
        Natural frequencies, in the order of the start.
    damping : (n_modes,)
        Damping ratios, 1 for critical damping.
    covariance : (2 n_modes, 2 n_modes)
        Covariance of ln frequencies, then of damping ratios.
    misfit : (n_responses,)
        Root mean square that the fit leaves of each response, over its root mean square.
    """

    frequencies: Real
    damping: Real
    covariance: Real
    misfit: Real

    @property
    def frequency_errors(self) -> Real:
        """Standard errors of the natural frequencies, (n_modes,), Hz."""
        n = len(self.frequencies)
        return np.asarray(self.frequencies * np.sqrt(np.diag(self.covariance)[:n]))

    @property
    def damping_errors(self) -> Real:
        """Standard errors of the damping ratios, (n_modes,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[len(self.frequencies) :]))


def fit_level(linear: LinearApproximation, band: tuple[float, float], frequencies: Real, damping: Real) -> LevelFit:
    """Fit a given number of modes to the FRF of one level, weighted by the force of each line.

    ``H = sum_r (a_r w_r^2 + b_r w_r s) / (s^2 + 2 zeta_r w_r s + w_r^2) + L / s^2 + U`` with the least
    ``sum_k |dH_k F_k|^2``, each response in units of its root mean square; a, b, L and U are eliminated (variable
    projection, Golub & Pereyra, SIAM J. Numer. Anal. 10, 413, 1973).

    A structure that is not linear leaves more than noise, and not evenly. The covariance is the sandwich
    ``(J^T J)^-1 (sum_k J_k^T r_k r_k^T J_k) (J^T J)^-1`` over lines k with ``r / (1 - leverage)``, which counts what is
    left where it is left (HC3: MacKinnon & White, J. Econometrics 29, 305, 1985); no variance is below that by noise.

    Parameters
    ----------
    linear
        FRF of the level on its excited lines.
    band : Hz
        Lowest and highest frequency fitted.
    frequencies : (n_modes,), Hz
        Natural frequencies to begin with.
    damping : (n_modes,)
        Damping ratios to begin with.

    Raises
    ------
    InputError
        Fewer lines in the band than the fit needs.
    MillfrfError
        The search leaves the band or does not come to an end.
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

    def rest(unknowns: Real) -> Real:
        return _rest(unknowns, s, measured, weight, order)[0]

    found = scipy.optimize.least_squares(rest, start, x_scale=np.concatenate([damping, np.full(n, 0.3)]), max_nfev=60)
    fitted = np.exp(found.x)
    if not found.success or fitted[:n].min() < 0.8 * band[0] or fitted[:n].max() > 1.2 * band[1]:
        raise MillfrfError(
            f"a linear fit of {n} modes at {linear.level:.3g} N rms does not settle within {band[0]:g} to "
            f"{band[1]:g} Hz; fit fewer modes or another band"
        )
    leverage = _rest(found.x, s, measured, weight, order)[1]
    covariance = _sandwich(found.jac, found.fun, leverage, noise)
    scale = np.concatenate([np.ones(n), fitted[n:]])  # from ln damping to damping
    left = found.fun.reshape(2, *measured.shape) ** 2
    size = np.sum(np.abs(measured) ** 2, axis=(0, 2))
    return LevelFit(
        fitted[:n], fitted[n:], covariance * np.outer(scale, scale), np.sqrt(left.sum(axis=(0, 1, 3)) / size)
    )


def _weighted(linear: LinearApproximation, lines: NDArray[np.bool_]) -> tuple[Complex, Real, Complex]:
    """FRF times the size of each force, responses in units of their root mean square; that size; their noise."""
    size = 1 / np.sqrt(np.einsum("kqq->kq", linear.excitation[lines]).real)
    values = linear.frf.values[lines] * size[:, None, :]
    unit = np.sqrt(np.mean(np.abs(values) ** 2, axis=(0, 2)))
    return values / unit[:, None], size, linear.noise[lines] / np.outer(unit, unit)


def _columns(unknowns: Real, s: Complex, order: int) -> Complex:
    """What the eliminated numbers multiply, (n_lines, 2 n_modes + 2)."""
    n = len(unknowns) // 2
    w, zeta = 2 * np.pi * np.exp(unknowns[:n]), np.exp(unknowns[n:])
    shares = 1 / (s[:, None] ** 2 + 2 * zeta * w * s[:, None] + w**2)
    unit = abs(s[-1])
    modes = [w**2 * shares, w * s[:, None] * shares]
    columns = np.concatenate([*modes, (unit / s[:, None]) ** 2, np.ones((len(s), 1))], axis=1)
    return np.asarray(columns * (s[:, None] / unit) ** order)


def _rest(unknowns: Real, s: Complex, measured: Complex, weight: Real, order: int) -> tuple[Real, Real]:
    """What the best eliminated numbers leave, and the leverage of these, (2 n_lines n_responses n_excitations,)."""
    columns = _columns(unknowns, s, order)
    left, leverage = np.empty((2, *measured.shape)), np.empty((2, *measured.shape))
    for q in range(measured.shape[2]):
        design = columns * weight[:, q, None]
        real = np.concatenate([design.real, design.imag])
        orthogonal = np.linalg.qr(real / np.linalg.norm(real, axis=0))[0]
        target = np.concatenate([measured[:, :, q].real, measured[:, :, q].imag])
        left[..., q] = (target - orthogonal @ (orthogonal.T @ target)).reshape(2, len(s), -1)
        leverage[..., q] = np.sum(orthogonal**2, axis=1).reshape(2, len(s), 1)
    return left.ravel(), leverage.ravel()


def _sandwich(jacobian: Real, rest: Real, eliminated: Real, noise: Complex) -> Real:
    """Covariance of the unknowns from what each line leaves; neighbours count together; not below that of noise."""
    n_lines, n = noise.shape[:2]
    inverse = np.linalg.pinv(jacobian.T @ jacobian)
    leverage = eliminated + np.einsum("ij,jk,ik->i", jacobian, inverse, jacobian)
    scores = jacobian * (rest / np.maximum(1 - leverage, 0.1))[:, None]
    per_line = scores.reshape(2, n_lines, -1, jacobian.shape[1]).sum(axis=(0, 2))
    middle = per_line.T @ per_line
    beside = per_line[1:].T @ per_line[:-1]  # Bartlett's weight of one line's distance (Newey & West 1987)
    covariance = inverse @ (middle + 0.5 * (beside + beside.T)) @ inverse
    slopes = jacobian.reshape(2, n_lines, n, -1, jacobian.shape[1])
    slope = slopes[0] + 1j * slopes[1]  # noise of the forces moves all responses together
    by_noise = 0.5 * np.einsum("kpqi,kpu,kuqj->ij", slope.conj(), noise, slope, optimize=True).real
    least = np.diag(inverse @ by_noise @ inverse)
    raised = np.sqrt(np.maximum(1.0, least / np.maximum(np.diag(covariance), 1e-300)))
    return np.asarray(covariance * np.outer(raised, raised))


SIGNIFICANT = 0.01
"""p-value below which a change is told."""


@dataclass(frozen=True)
class ModeChange:
    """Change of one mode between two levels.

    Parameters
    ----------
    mode
        Number of the mode.
    frequency : Hz
        Natural frequency at the lower level.
    levels : N
        Root mean square of the forces at either level.
    frequency_change, frequency_error
        Natural frequency at the higher level over that at the lower, minus one, and its standard error.
    frequency_p_value
        Probability of such a change by the errors of both fits.
    damping_change, damping_error
        The same of the damping ratio.
    damping_p_value
        The same of the damping ratio.
    """

    mode: int
    frequency: float
    levels: tuple[float, float]
    frequency_change: float
    frequency_error: float
    frequency_p_value: float
    damping_change: float
    damping_error: float
    damping_p_value: float

    def sentence(self) -> str:
        """The change in words with two standard errors; what is not significant is said to be."""
        where = f"mode at {self.frequency:.4g} Hz, {self.levels[0]:.3g} to {self.levels[1]:.3g} N rms: "
        shift_error, gain_error = (_percent(2 * one) for one in (self.frequency_error, self.damping_error))
        verb = "stiffens" if self.frequency_change > 0 else "softens"
        moves = f"{verb} by {100 * abs(self.frequency_change):.2g} +- {shift_error} %"
        if self.frequency_p_value > SIGNIFICANT:
            moves = f"frequency {100 * self.frequency_change:+.2g} +- {shift_error} %, within its error"
        verb = "gains" if self.damping_change > 0 else "loses"
        damps = f"{verb} {100 * abs(self.damping_change):.2g} +- {gain_error} % of its damping"
        if self.damping_p_value > SIGNIFICANT:
            damps = f"damping {100 * self.damping_change:+.2g} +- {gain_error} %, within its error"
        return f"{where}{moves}, {damps}"


@dataclass(frozen=True)
class AmplitudeDependence:
    """Modes over the level of the forces.

    Parameters
    ----------
    levels : (n_levels,), N
        Root mean square of the forces, rising.
    deflections : (n_levels, n_responses), m
        Root mean square displacement at each response, excited lines of the band together.
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
        """Each mode from the lowest to the highest level."""
        first, last = self.fits[0], self.fits[-1]
        result = []
        for r in range(len(first.frequencies)):
            shift = last.frequencies[r] / first.frequencies[r] - 1
            shift_error = np.hypot(
                first.frequency_errors[r] / first.frequencies[r], last.frequency_errors[r] / last.frequencies[r]
            )
            gain = last.damping[r] / first.damping[r] - 1
            gain_error = (1 + gain) * np.hypot(
                first.damping_errors[r] / first.damping[r], last.damping_errors[r] / last.damping[r]
            )
            result.append(
                ModeChange(
                    r + 1,
                    float(first.frequencies[r]),
                    (float(self.levels[0]), float(self.levels[-1])),
                    float(shift),
                    float(shift_error),
                    _two_sided(shift / shift_error),
                    float(gain),
                    float(gain_error),
                    _two_sided(
                        (last.damping[r] - first.damping[r]) / np.hypot(first.damping_errors[r], last.damping_errors[r])
                    ),
                )
            )
        return tuple(result)

    def sentences(self) -> tuple[str, ...]:
        """Changes of all modes, one sentence each."""
        return tuple(one.sentence() for one in self.changes())


def amplitude_dependence(
    levels: Sequence[SteadyPeriods], band: tuple[float, float], modes: Sequence[tuple[float, float]] | None = None
) -> AmplitudeDependence:
    """Fit each level linearly with the same modes, and tell how they move with the level.

    A mode of a nonlinear structure has no one frequency; that of the best linear approximation at each level moves with
    the stiffness, and the damping ratio with the energy lost in a cycle (Kerschen et al., Mech. Syst. Signal Process.
    20, 505, 2006). Shapes may change, too; they are not compared.

    Parameters
    ----------
    levels
        Steady periods of each level, two at least, of the same channels; see :func:`estimation.steady_periods`.
    band : Hz
        Lowest and highest frequency fitted.
    modes
        Natural frequency (Hz) and damping ratio of each mode to begin with; None: those that
        :func:`fit_polyreference` finds at the lowest level.

    Raises
    ------
    InputError
        Fewer than two levels, other channels, or too few lines in the band.
    MillfrfError
        No mode is found, or a fit does not settle.
    """
    if len(levels) < 2:
        raise InputError(f"{len(levels)} level given; two at least tell a change")
    if len({(one.excitations, one.responses) for one in levels}) > 1:
        raise InputError("levels of different channels cannot be compared; give the same channels in the same order")
    ordered = sorted(levels, key=lambda one: one.level)
    approximations = [linear_approximation(one) for one in ordered]
    start = _start(approximations[0], band) if modes is None else np.array(modes, dtype=float)
    fits: list[LevelFit] = []
    for one in approximations:
        fits.append(fit_level(one, band, start[:, 0], start[:, 1]))
        start = np.column_stack([fits[-1].frequencies, fits[-1].damping])
    return AmplitudeDependence(
        np.array([one.level for one in approximations]),
        np.array([_deflection(one, periods, band) for one, periods in zip(approximations, ordered, strict=True)]),
        tuple(fits),
        tuple(channel.name for channel in ordered[0].responses),
    )


def _start(linear: LinearApproximation, band: tuple[float, float]) -> Real:
    """Frequency and damping ratio of the modes of the lowest level, (n_modes, 2), split and stray poles left out."""
    frf = replace(linear.frf, covariance=None)  # what a nonlinear structure leaves is not weighted like noise
    model = fit_polyreference(frf, band).model
    spacing = float(np.median(np.diff(linear.frf.frequencies)))
    width = 2 * model.damping_ratios * model.natural_frequencies
    inside = (model.natural_frequencies > band[0]) & (model.natural_frequencies < band[1]) & (width > 0.2 * spacing)
    found = np.column_stack([model.natural_frequencies, model.damping_ratios])[inside]
    return np.asarray(found[np.argsort(found[:, 0])])


def _deflection(linear: LinearApproximation, periods: SteadyPeriods, band: tuple[float, float]) -> Real:
    """Root mean square displacement of each response in the band, (n_responses,), m."""
    f = linear.frf.frequencies
    inside = (f >= band[0]) & (f <= band[1])
    orders = derivative_orders(periods.responses)
    scale = (2 * np.pi * f[inside, None]) ** (-2.0 * orders)
    return np.asarray(np.sqrt(2 * np.sum(linear.power[inside] * scale, axis=0) / round(periods.period * periods.rate)))


def _percent(share: float) -> str:
    """One figure of a share in per cent, without a power of ten."""
    return f"{float(f'{100 * share:.1g}'):g}"


def _two_sided(sigmas: float) -> float:
    return float(scipy.special.erfc(abs(sigmas) / np.sqrt(2)))
