"""Nonlinear distortion without a model, and homogeneity of the FRF over the level of the forces."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, InputError, Real

from .cut_periods import SteadyPeriods, same_forces
from .linear_approximation import (
    LinearApproximation,
    excited_lines,
    linear_approximation,
    ratio_p_values,
    silent_classes,
    standing_out,
    together,
)
from .noise import parted, residual_covariance
from .noise_between_periods import covariance_of_periods

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


@dataclass(frozen=True)
class Homogeneity:
    """FRFs of two levels beside each other.

    Parameters
    ----------
    frequencies : (n_lines,), Hz
        Lines that both levels excite.
    first, second : (n_lines, n_responses, n_excitations)
        FRF at either level.
    levels : N
        Root mean square of the forces at either level.
    line_p_values : (n_lines, n_responses)
        Probability of a difference as large by the uncertainty of both.
    p_values : (n_responses,)
        The same of all lines together.
    differing : (n_lines, n_responses)
        Lines that differ; among them 5 % by chance.
    change : (n_responses,)
        Root mean square difference over root mean square FRF, uncertainty taken off.
    largest : (n_responses,), Hz
        Line of the largest difference.
    statement
        One sentence that says which uncertainty was counted.
    """

    frequencies: Real
    first: Complex
    second: Complex
    levels: tuple[float, float]
    line_p_values: Real
    p_values: Real
    differing: NDArray[np.bool_]
    change: Real
    largest: Real
    statement: str


def homogeneity(first: SteadyPeriods, second: SteadyPeriods) -> Homogeneity:
    """Test whether two levels have the same FRF.

    At each line and response ``d^H (C_1 + C_2)^-1 d / m ~ F(2 m, 2 v)`` with the difference d of the m entries of a
    row, the covariances C of both, and v degrees of freedom (Welch, Biometrika 34, 28, 1947). Where both levels play
    the same realisation, C is that of noise alone: what a nonlinearity adds by chance is the same for a homogeneous
    structure. Else it holds the stochastic contributions, if there are realisations enough to tell them.

    Parameters
    ----------
    first, second
        Steady periods of either level, of the same channels, rate and period.

    Raises
    ------
    InputError
        Unlike channels, or no line that both excite.
    """
    if (first.excitations, first.responses) != (second.excitations, second.responses):
        raise InputError("levels of different channels cannot be compared; give the same channels in the same order")
    one, other = linear_approximation(first), linear_approximation(second)
    same = len(first.realisations) == len(second.realisations) and all(
        same_forces(a, b) for a, b in zip(first.realisations, second.realisations, strict=True)
    )
    here, there = _common(one, other)
    delta = other.frf.values[there] - one.frf.values[here]
    pieces = [_uncertainty(each, lines, same) for each, lines in ((one, here), (other, there))]
    n, m = delta.shape[1:]
    line_p, variance = np.empty(delta.shape[:2]), np.empty(delta.shape[:2])
    for p in range(n):
        rows = [own[:, p, p].real[:, None, None] * excitation for own, excitation, _ in pieces]
        traces = [np.einsum("kqq->k", row).real for row in rows]
        freedom = sum(traces) ** 2 / np.maximum(
            sum(t**2 / v for t, (_, _, v) in zip(traces, pieces, strict=True)), 1e-300
        )
        size = np.linalg.solve(rows[0] + rows[1], delta[:, p, :, None])[:, :, 0]
        ratio = np.einsum("kq,kq->k", delta[:, p].conj(), size).real / m
        line_p[:, p], variance[:, p] = ratio_p_values(ratio, m, freedom), traces[0] + traces[1]
    difference = np.sum(np.abs(delta) ** 2, axis=2)
    whole = np.maximum(np.sum(np.abs(one.frf.values[here]) ** 2, axis=(0, 2)), 1e-300)
    counted = "noise alone, because both play the same realisation" if same else _counted(one, other)
    return Homogeneity(
        one.frf.frequencies[here],
        one.frf.values[here],
        other.frf.values[there],
        (one.level, other.level),
        line_p,
        np.array([together(line_p[:, p]) for p in range(n)]),
        np.stack([standing_out(line_p[:, p]) for p in range(n)], axis=1),
        np.sqrt(np.maximum(np.sum(difference - variance, axis=0), 0.0) / whole),
        one.frf.frequencies[here][np.argmax(difference, axis=0)],
        f"{len(here)} lines that both levels excite; the uncertainty is that of {counted}.",
    )


def _common(one: LinearApproximation, other: LinearApproximation) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Lines that both have, as indices of either."""
    a, b = (each.frf.frequencies for each in (one, other))
    nearest = np.clip(np.searchsorted(b, a - 1e-9 * a), 0, len(b) - 1)
    shared = (np.abs(b[nearest] - a) < 1e-6 * a) & one.frf.valid & other.frf.valid[nearest]
    if not shared.any():
        raise InputError("the levels excite no line in common; play the same lines at both")
    return np.flatnonzero(shared), nearest[shared]


def _uncertainty(linear: LinearApproximation, lines: NDArray[np.int64], same: bool) -> tuple[Complex, Complex, int]:
    """Covariance of the residual, factor of the excitation, degrees of freedom."""
    if same or linear.total is None:
        return linear.noise[lines], linear.excitation[lines], linear.noise_freedom
    return linear.total[lines], linear.excitation[lines], linear.total_freedom


def _counted(one: LinearApproximation, other: LinearApproximation) -> str:
    if one.total is None or other.total is None:
        return "noise alone, because one realisation does not tell its stochastic contributions: these count as change"
    return "noise and of stochastic contributions between realisations"
