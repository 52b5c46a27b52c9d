"""Nonlinear distortion without a model: at lines that were not excited, and between realisations."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .cut_periods import SteadyPeriods
from .line_classes import excited_lines, silent_classes
from .line_tests import ratio_p_values, together
from .linear_part import LinearApproximation, linear_approximation
from .noise_between_periods import covariance_of_periods
from .noise_type import parted, residual_covariance

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

SIGNIFICANT = 1e-3
"""p-value below which distortion is told."""


@dataclass(frozen=True)
class LineClass:
    """Distortion of the responses on one class of lines.

    Parameters
    ----------
    name
        Which lines these are.
    n_lines
        Number of lines in the class.
    level : (n_responses,)
        Root mean square at such a line over that at an excited line, noise taken off; 0 where noise explains all.
    noise : (n_responses,)
        Noise of the mean periods in the same scale.
    force : (n_excitations,)
        Level of the forces themselves at these lines, in the same scale: a shaker distorts, too.
    p_values : (n_responses,)
        Probability of as much by noise alone.
    """

    name: str
    n_lines: int
    level: Real
    noise: Real
    force: Real
    p_values: Real


@dataclass(frozen=True)
class Distortion:
    """Nonlinear distortion of one level.

    Parameters
    ----------
    responses
        Names of the responses.
    classes
        Lines that were not excited, class by class.
    stochastic : (n_responses,) or None
        Stochastic nonlinear contributions at excited lines over the response there; None: one realisation.
    stochastic_p_values : (n_responses,) or None
        Probability of as much between realisations by noise alone.
    level : N
        Root mean square of the forces.
    """

    responses: tuple[str, ...]
    classes: tuple[LineClass, ...]
    stochastic: Real | None
    stochastic_p_values: Real | None
    level: float

    def sentences(self) -> tuple[str, ...]:
        """What is significant, one sentence each; the strongest response of each class is named."""
        said = []
        for one in self.classes:
            found = np.flatnonzero((one.p_values < SIGNIFICANT) & (one.level > 0))
            if len(found):
                worst = int(found[np.argmax(one.level[found])])
                said.append(
                    f"distortion at {one.name}: {_decibels(one.level[worst])} of {self.responses[worst]} "
                    f"(noise {_decibels(one.noise[worst])}, force itself {_decibels(float(one.force.max()))})"
                )
        if self.stochastic is not None and self.stochastic_p_values is not None:
            found = np.flatnonzero((self.stochastic_p_values < SIGNIFICANT) & (self.stochastic > 0))
            if len(found):
                worst = int(found[np.argmax(self.stochastic[found])])
                said.append(
                    f"realisations differ beyond noise: {_decibels(self.stochastic[worst])} of {self.responses[worst]}"
                )
        return tuple(said)


def distortion(periods: SteadyPeriods) -> Distortion:
    """Measure distortion of one level on the lines that were not excited, and between realisations.

    Between excited lines of the band the forces' own distortion is taken off through the FRF, linear in between:
    ``D = X - G F``. Above the band there is no G; the level of the forces is told beside the responses'. Each line is
    compared with the noise between periods by an F test; Fisher's method joins the lines (Pintelon & Schoukens, System
    Identification, 2nd ed., section 4.3.2). What a mains frequency leaves in step with the periods counts as
    distortion.

    Parameters
    ----------
    periods
        Steady periods of one level. As many realisations as forces are needed, one more for the stochastic part.
    """
    linear = linear_approximation(periods)
    excited = excited_lines(periods)
    joint, freedom = covariance_of_periods(periods)
    through, doubt = _between_lines(linear, periods, excited)
    size = np.sqrt(np.maximum(linear.power.mean(axis=0), 1e-300))  # a dead channel has none
    driven = [np.mean(np.abs(one.forces.mean(axis=0)[excited]) ** 2, axis=0) for one in periods.realisations]
    drive = np.sqrt(np.maximum(np.mean(driven, axis=0), 1e-300))
    parts = parted(joint, joint.shape[1] - linear.power.shape[1])
    noise = np.einsum("kpp->kp", residual_covariance(*parts, through)).real
    hum = np.einsum("kqq->kq", parts[1]).real
    classes = []
    for name, lines in silent_classes(periods, excited).items():
        ratio, power, own, quiet = _class_powers(periods, lines, through, doubt, noise, hum)
        p_values = ratio_p_values(ratio, len(periods.realisations), freedom)
        classes.append(
            LineClass(
                name,
                int(lines.sum()),
                np.sqrt(np.maximum(power, 0.0)) / size,
                np.sqrt(quiet) / size,
                np.sqrt(own) / drive,
                np.array([together(p_values[:, p]) for p in range(p_values.shape[1])]),
            )
        )
    names = tuple(channel.name for channel in periods.responses)
    return Distortion(names, tuple(classes), *_stochastic(linear), linear.level)


def _class_powers(
    periods: SteadyPeriods, lines: NDArray[np.bool_], through: Complex, doubt: Real, noise: Real, hum: Real
) -> tuple[Real, Real, Real, Real]:
    """Ratio to noise at each line; mean powers of distortion without noise, of forces, of noise."""
    ratio, power, own, quiet = 0.0, 0.0, 0.0, 0.0
    for one in periods.realisations:
        force = one.forces.mean(axis=0)[lines]
        rest = one.responses.mean(axis=0)[lines] - np.einsum("kpq,kq->kp", through[lines], force)
        true = np.sqrt(np.maximum(np.abs(force) ** 2 - hum[lines] / one.n_periods, 0.0))
        variance = noise[lines] / one.n_periods + np.einsum("kpq,kq->kp", doubt[lines], true) ** 2
        ratio = ratio + np.abs(rest) ** 2 / np.maximum(variance, 1e-300)
        power = power + np.mean(np.abs(rest) ** 2 - variance, axis=0)
        own, quiet = own + np.mean(np.abs(force) ** 2, axis=0), quiet + np.mean(variance, axis=0)
    count = len(periods.realisations)
    return tuple(np.asarray(each) / count for each in (ratio, power, own, quiet))  # type: ignore[return-value]


def _between_lines(
    linear: LinearApproximation, periods: SteadyPeriods, excited: NDArray[np.bool_]
) -> tuple[Complex, Real]:
    """FRF at all lines, linear between excited ones and 0 outside the band, and how far off that may be."""
    own, values = linear.frf.frequencies[linear.frf.valid], linear.frf.values[linear.frf.valid]
    bend = np.zeros_like(values)
    if len(own) > 2:  # a line against its neighbours' mean: constant curvature is off by half of it midway, at most
        bend[1:-1] = (values[1:-1] - (values[:-2] + values[2:]) / 2) / 2
        bend[0], bend[-1] = bend[1], bend[-2]
    shape = (len(excited), *values.shape[1:])
    through, doubt = np.zeros(shape, dtype=complex), np.zeros(shape)
    inside = (periods.frequencies >= own[0]) & (periods.frequencies <= own[-1])
    for p, q in np.ndindex(values.shape[1:]):
        through[inside, p, q] = np.interp(periods.frequencies[inside], own, values[:, p, q])
        doubt[inside, p, q] = np.interp(periods.frequencies[inside], own, np.abs(bend[:, p, q]))
    return through, doubt


def _stochastic(linear: LinearApproximation) -> tuple[Real | None, Real | None]:
    """Share of stochastic nonlinear contributions in each response, and its p-value."""
    beyond = linear.distortion()
    if beyond is None or linear.total is None:
        return None, None
    noise = np.einsum("kpp->kp", linear.noise).real
    ratio = np.einsum("kpp->kp", linear.total).real / np.maximum(noise, 1e-300)
    p_values = ratio_p_values(ratio, linear.total_freedom, linear.noise_freedom)
    share = np.sqrt(np.maximum(beyond.mean(axis=0), 0.0) / np.maximum(linear.power.mean(axis=0), 1e-300))
    return share, np.array([together(p_values[:, p]) for p in range(p_values.shape[1])])


def _decibels(share: float) -> str:
    return "none" if share <= 0 else f"{20 * np.log10(share):.0f} dB"
