"""`amplitude_dependence`: how natural frequencies and damping ratios change from level to level."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfc

from estimation import LinearApproximation, SteadyPeriods, derivative_orders, linear_approximation
from foundation import InputError

from ..polyreference import fit_polyreference
from .level_fit import LevelFit, fit_level

Real = NDArray[np.float64]

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
    return float(erfc(abs(sigmas) / np.sqrt(2)))
