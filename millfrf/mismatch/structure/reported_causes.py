"""Reported causes: parameters with standard errors, which include the uncertainty of the form of the law."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real, listed

from ..inference.diagnosis import AcceptedCause
from ..inference.search import Proposal
from ..models.cause import PRELOAD, Cause, limited_values, location_of
from ..models.first_motion import predict_lines
from ..models.fitting import Fit, fit
from ..models.hypothesis import Hypothesis
from ..models.misfit import fitted_noise, jacobian, through_structure
from ..models.model_terms import spread_with_scale
from ..physics.library import Rig
from ..physics.linear_causes import AcCoupling, MissingMode
from ..physics.protocol import JointPhysics, reported_name
from ..physics.recording_faults import QUANTISATION
from ..records.noise_model import SIGNAL_ERROR, NoiseModel, whitening
from .held_out import block_slices

# probability that a sample lies by chance as near to a lattice as :func:`estimation.rounding_step` requires
ON_LATTICE = 0.1


def accepted_cause(fitted: Fit, location: Mapping[str, Any], evidence: float, place: int = -1) -> AcceptedCause:
    """Return one cause of a fit, by default the last cause, with its numbers and first-order standard errors."""
    causes = fitted.hypothesis.causes
    cause, place = causes[place], place % len(causes)
    covariance = spread_with_scale(fitted, place)
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    parameters, errors = {}, {}
    # a number beyond a limit set by the motion has no effect on the data, and its standard error becomes large
    for parameter, value, error in zip(cause.physics.parameters, limited_values(cause), spread, strict=False):
        parameters[parameter.name] = float(value)
        errors[parameter.name] = float(error * parameter.unit_step * (abs(value) if parameter.logarithmic else 1.0))
    count = len(cause.values)
    derived, derived_errors = _derived(cause, covariance[:count, :count])
    preloaded, preloaded_errors = _preloaded(cause, covariance)
    parameters, errors = parameters | derived | preloaded, errors | derived_errors | preloaded_errors
    return AcceptedCause(reported_name(cause.physics), dict(location), parameters, errors, evidence)


def _preloaded(cause: Cause, covariance: Real) -> tuple[dict[str, float], dict[str, float]]:
    """Return the force of a joint in each recording and its geometric mean, and their errors; empty if it is the same.

    The logarithm of the force in a recording is a sum of fit coordinates, ``c_0 step_0 + c_k step``.
    """
    if not cause.preloads:
        return {}, {}
    first, count = cause.physics.parameters[0], len(cause.values)
    factors = np.array(list(cause.preloads.values()))
    rows = np.zeros((len(factors), len(covariance)))
    rows[:, 0] = first.unit_step
    rows[1:, count:] = PRELOAD.unit_step * np.eye(len(factors) - 1)
    rows = np.vstack([rows.mean(axis=0), rows])
    names = [first.name, *(f"{first.name}_in_{recording}" for recording in cause.preloads)]
    forces = float(cause.values[0]) * np.append(cause.mean_preload, factors)
    errors = forces * np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", rows, covariance, rows), 0.0))
    return dict(zip(names, forces.tolist(), strict=True)), dict(zip(names, errors.tolist(), strict=True))


def reported_causes_of(fitted: Fit, accepted: Sequence[Proposal[Fit]]) -> list[AcceptedCause]:
    """Return the accepted causes with numbers, errors and directions of the final fit, in its order."""
    reported: list[AcceptedCause] = []
    nominal_count, added = fitted.hypothesis.shape.nominal_modes, 0
    for place, (proposal, cause) in enumerate(zip(accepted, fitted.hypothesis.causes, strict=True)):
        if isinstance(cause.physics, MissingMode):
            reported.append(accepted_mode(fitted, cause.physics, proposal.evidence, nominal_count + added))
            added += 1
        else:
            location = dict(proposal.location)
            if cause.axis is not None:
                location |= location_of(cause.axis, fitted.hypothesis.model)
            reported.append(accepted_cause(fitted, location, proposal.evidence, place))
    return reported


def _derived(cause: Cause, covariance: Real) -> tuple[dict[str, float], dict[str, float]]:
    """Return derived numbers, more familiar than the fitted ones, and their errors; empty if the physics has none."""
    numbers: Callable[[Real], dict[str, float]] | None = getattr(cause.physics, "derived", None)
    if numbers is None:
        return {}, {}
    derived, coordinates = numbers(cause.values), cause.coordinates()
    count = len(cause.values)
    slopes: dict[str, Real] = {name: np.zeros(count) for name in derived}
    for k in range(count):
        step = 1e-4 * max(1.0, abs(float(coordinates[k])))
        derived_aside = [
            numbers(cause.moved(coordinates + sign * step * np.eye(len(coordinates))[k]).values) for sign in (1, -1)
        ]
        for name in derived:
            slopes[name][k] = (
                derived_aside[0].get(name, derived[name]) - derived_aside[1].get(name, derived[name])
            ) / (2 * step)
    return derived, {
        name: float(np.sqrt(np.maximum(slope @ covariance @ slope, 0.0))) for name, slope in slopes.items()
    }


def accepted_mode(fitted: Fit, physics: MissingMode, evidence: float, number: int) -> AcceptedCause:
    """Return an added mode of a fit: frequency, damping ratio and shape at the responses."""
    shape, model = fitted.hypothesis.shape, fitted.hypothesis.model
    first = shape.per_mode * number
    spread = np.sqrt(np.maximum(np.diag(fitted.covariance)[first : first + 2], 0.0))
    frequency, damping = float(model.natural_frequencies[number]), float(model.damping_ratios[number])
    right = np.abs(model.right[number]) / np.abs(model.right[number]).max()
    place = {"shape": dict(zip(model.responses, [round(float(x), 4) for x in right], strict=True))}
    return AcceptedCause(
        physics.name,
        place,
        {"frequency_hz": frequency, "damping_ratio": damping},
        {
            "frequency_hz": float(spread[0]) * shape.lab.frequency * frequency,
            "damping_ratio": float(spread[1]) * shape.lab.damping * damping,
        },
        evidence,
    )


def rounded_channels(fitted: Fit, lines: Sequence[WindowedSpectrum]) -> tuple[AcceptedCause, ...]:
    """Return the channels in which most of the residual of a recording is rounding to the steps of the converter.

    Rounding is white noise of a known variance. A recording without it would fit the model better; rounding below the
    errors that every sensor has is no fault.
    """
    causes = dict[str, AcceptedCause]()
    for recording in lines:
        rounding, measured = recording.recording.rounding, recording.measured
        if rounding is None:
            continue
        residual = measured - predict_lines(fitted.hypothesis, recording).response
        left, least = (np.sum(np.abs(part) ** 2, axis=0) for part in (residual, SIGNAL_ERROR * measured))
        power = len(recording.frequencies) * rounding**2
        for k in np.flatnonzero((power > left / 2) & (power > least)):
            step = float(np.sqrt(12) * rounding[k])
            name = recording.recording.responses[k].name
            evidence = -2 * len(recording.recording.response) * float(np.log(ON_LATTICE))
            causes[name] = AcceptedCause(QUANTISATION.name, {"channel": name}, {"step": step}, {}, evidence)
    return tuple(causes.values())


def unknown_scales(causes: Sequence[AcceptedCause], rig: Rig) -> tuple[str, ...]:
    """Return a sentence on each joint away from the tip, whose deflection no channel measures.

    A joint with the deflection ``x / a`` and the force ``a g`` predicts the same responses as ``x`` and ``g``, so that
    the data do not determine the scale a. By convention the deflection is referred to the motion of the tip where
    forces drive the rig (:func:`millfrf.mismatch.models.model_terms.counted_at_tip`).

    Examples
    --------
    >>> unknown_scales([AcceptedCause("gain_error", {"channel": "TCP:+X"}, {}, {}, 30.0)], Rig())
    ()
    """
    names = [cause.name for cause in causes if "participation" in cause.location]
    if not names:
        return ()
    counted = "it is counted in the tip's motion" if rig == Rig() else "its scale is that of the fit"
    return (
        f"No channel shows the deflection of the joint inside ({listed(names)}): {counted}, and lengths a times "
        "as large with forces a times as small fit as well",
    )


def different_preloads(hypothesis: Hypothesis) -> tuple[str, ...]:
    """Return a sentence on each joint whose force differs between recordings."""
    return tuple(
        f"The force of {reported_name(cause.physics)} differs between the recordings: {low:.3g} to {high:.3g} times "
        f"that in {next(iter(cause.preloads))}, as with another preload, temperature or wear; other recordings are "
        "predicted by the mean"
        for cause in hypothesis.laws
        if cause.preloads
        for low, high in [(min(cause.preloads.values()), max(cause.preloads.values()))]
    )


# most steps of a fit of a wider form, and excess of its score over the named form's score if it has not converged
WIDER_STEPS, NOT_CONVERGED = 15, 20.0

PARTS = 3  # number of parts of each recording, by the strength of the motion: weak, middle, strong

DISAGREE = 0.05  # p-value below which parts are taken to disagree

NORMAL = 1.959964  # half width of a 95 % interval, in standard errors


def with_form_spread(fitted: Fit, lines: Sequence[WindowedSpectrum]) -> Fit:
    """Add to the covariance of a fit the uncertainty that is due to the form of its laws.

    A law for which a wider form with one more shape number exists is fitted in this form too. The squared difference of
    the numbers and the growth of their variance are added. A curved drift is compared with an exponential one.

    If the true law has a different form, the best numbers differ between small and large motion. Each recording is
    therefore cut into blocks of time, which form a weak, a middle and a strong part. Each part g has an estimate
    ``theta_g = theta + N_g^-1 J_g^T V^-1 r_g`` of every number, to first order and with fixed modes. If the estimates
    disagree beyond their noise (Cochran's Q), the variance between the parts (DerSimonian & Laird 1986, Controlled
    Clinical Trials 7) is added, widened by Student's t for the small number of parts. It is not divided by the number
    of parts, as the error due to a wrong form does not average out.
    """
    shape = fitted.hypothesis.shape
    nominal_size = shape.per_mode * (len(shape.nominal.poles) - shape.added)
    others = np.arange(nominal_size, fitted.hypothesis.size)
    others = others[(others < shape.modal_size) | (others >= shape.size)]
    # a part of one recording determines only the force in this recording
    others = np.setdiff1d(others, _preload_columns(fitted.hypothesis))
    modal = np.concatenate([np.arange(first, first + 2) for first in range(0, nominal_size, shape.per_mode)])
    extra = np.zeros(fitted.hypothesis.size)
    extra += (
        _wider_form_variance(fitted, list(lines))
        + _other_form_variance(fitted, list(lines))
        + _other_course_variance(fitted)
    )
    extra[modal] += _variance_between_parts(fitted, lines, modal)
    if len(others):
        extra[others] += _variance_between_parts(fitted, lines, others)
    return replace(fitted, covariance=fitted.covariance + np.diag(extra))


def _preload_columns(hypothesis: Hypothesis) -> NDArray[np.int64]:
    """Return the columns of the factors on the forces of single recordings among all fitted numbers."""
    columns, at = [], hypothesis.shape.size
    for cause in hypothesis.causes:
        columns.append(np.arange(at + len(cause.values), at + cause.law_size))
        at += cause.size
    return np.concatenate([np.zeros(0, dtype=np.int64), *columns])


def _wider_form_variance(fitted: Fit, lines: list[WindowedSpectrum]) -> Real:
    """Return the variance that is added to each number because its law may have a wider form, (size,).

    It is the squared difference of the number between the wider and the named form, plus the growth of its variance.
    """
    extra = np.zeros(fitted.hypothesis.size)
    at = fitted.hypothesis.shape.size
    for place, cause in enumerate(fitted.hypothesis.causes):
        own, at = slice(at, at + len(cause.values)), at + cause.size
        make: Callable[[], tuple[JointPhysics, float]] | None = getattr(cause.physics, "wider", None)
        if make is None:
            continue
        physics, shape_number = make()
        wider = replace(cause, physics=physics, values=np.append(limited_values(cause), shape_number))
        causes = list(fitted.hypothesis.causes)
        causes[place] = wider
        refitted = fit(lines, replace(fitted.hypothesis, causes=tuple(causes)), fitted.noises, iterations=WIDER_STEPS)
        if refitted.score > fitted.score + NOT_CONVERGED:
            continue
        coordinates = refitted.hypothesis.causes[place].coordinates()[: len(cause.values)]
        difference = coordinates - cause.coordinates()[: len(cause.values)]
        growth = np.diag(refitted.covariance)[own] - np.diag(fitted.covariance)[own]
        extra[own] = difference**2 + np.maximum(growth, 0.0)
    return extra


def _other_form_variance(fitted: Fit, lines: list[WindowedSpectrum]) -> Real:
    """Return the variance that is added to each number because its law may have a different form, (size,).

    It is the squared difference of the number between both forms, so that the interval contains both values. It is
    weighted by the likelihood ratio of the different form to the named form (Bayes' information criterion), at most 1.
    """
    extra = np.zeros(fitted.hypothesis.size)
    at = fitted.hypothesis.shape.size
    for number, cause in enumerate(fitted.hypothesis.causes):
        own, at = slice(at, at + len(cause.values)), at + cause.size
        if not isinstance(cause.physics, AcCoupling):
            continue
        for place, values in cause.physics.other_forms(cause.values, cause.place):
            causes = list(fitted.hypothesis.causes)
            causes[number] = replace(cause, place=place, values=values)
            refitted = fit(
                lines, replace(fitted.hypothesis, causes=tuple(causes)), fitted.noises, iterations=WIDER_STEPS
            )
            difference = refitted.hypothesis.causes[number].coordinates() - cause.coordinates()
            extra[own] += min(1.0, np.exp(-(refitted.score - fitted.score) / 2)) * difference**2
    return extra


def _other_course_variance(fitted: Fit) -> Real:
    """Return the squared difference of each number between two similar courses in time, (size,).

    Both courses predict the same responses within the noise, and the interval shall contain both values.
    """
    extra = np.zeros(fitted.hypothesis.size)
    at = fitted.hypothesis.shape.size
    for cause in fitted.hypothesis.causes:
        own, at = slice(at, at + len(cause.values)), at + cause.size
        other: Callable[[Real], Real] | None = getattr(cause.physics, "other_course", None)
        if other is not None:
            count = len(cause.values)
            difference = replace(cause, values=other(cause.values)).coordinates()[:count] - cause.coordinates()[:count]
            extra[own] += difference**2
    return extra


def _variance_between_parts(fitted: Fit, lines: Sequence[WindowedSpectrum], which: NDArray[np.int64]) -> Real:
    """Return the variance between parts of the recordings for each of the coordinates ``which``."""
    parts = [
        part
        for recording, noise in zip(lines, fitted.noises, strict=True)
        for part in _parts(fitted, recording, noise, which)
    ]
    estimates = [_part_estimate(matrix, gradient) for matrix, gradient in parts]
    steps, variances = np.array([step for step, _ in estimates]), np.array([variance for _, variance in estimates])
    return np.array([_variance(steps[:, k], variances[:, k]) for k in range(len(which))])


def _parts(
    fitted: Fit, lines: WindowedSpectrum, noise: NoiseModel, which: NDArray[np.int64]
) -> list[tuple[Real, Real]]:
    """Return the normal matrix and right-hand side of the weak, the middle and the strong part of a recording."""
    hypothesis = fitted.hypothesis
    predicted = predict_lines(hypothesis, lines)
    white = whitening(fitted_noise(lines, through_structure(hypothesis, lines), noise))
    slopes = np.einsum("kij,kjc->kic", white, jacobian(hypothesis, lines, predicted)[:, :, which])
    residual = np.einsum("kij,kj->ki", white, lines.measured - predicted.response)
    n = len(lines.window)
    slope, residual_signal, response_signal = (_signal(lines, part) for part in (slopes, residual, predicted.response))
    blocks = block_slices(lines)
    size = np.mean(response_signal**2, axis=0)
    strength = np.array([np.mean(response_signal[block] ** 2 / size) for block in blocks])
    factors = []
    for group in np.array_split(np.argsort(strength), min(PARTS, len(blocks))):
        matrix, gradient = np.zeros((len(which), len(which))), np.zeros(len(which))
        for number in group:
            own = slope[blocks[number]].reshape(-1, len(which))
            matrix += n * own.T @ own
            gradient += n * own.T @ residual_signal[blocks[number]].ravel()
        factors.append((matrix, gradient))
    return factors


def _signal(lines: WindowedSpectrum, part: Complex) -> Real:
    """Return the windowed signals in time, (n_samples, ...), of spectral lines (n_lines, ...)."""
    spectrum = np.zeros((len(lines.window) // 2 + 1, *part.shape[1:]), dtype=complex)
    spectrum[lines.band] = part
    return np.asarray(scipy.fft.irfft(spectrum, n=len(lines.window), axis=0))


def _part_estimate(matrix: Real, gradient: Real) -> tuple[Real, Real]:
    """Return the step from the fitted numbers to the estimate of one part, and its variance due to noise."""
    inverse = np.linalg.pinv(matrix + 1e-6 * np.eye(len(matrix)), hermitian=True)
    return inverse @ gradient, np.diag(inverse)


def _variance(steps: Real, variances: Real) -> float:
    """Return the variance of a number between parts, 0 if the parts agree.

    It is scaled such that 1.96 standard errors give the 95 % interval of Student's t.
    """
    weights = 1 / np.maximum(variances, 1e-300)
    freedom = len(steps) - 1
    mean = np.sum(weights * steps) / np.sum(weights)
    q = float(np.sum(weights * (steps - mean) ** 2))
    if freedom < 1 or q < scipy.stats.chi2.isf(DISAGREE, freedom):
        return 0.0
    shared = float(np.sum(weights) - np.sum(weights**2) / np.sum(weights))
    if shared <= 0:
        # only one part determines the number, so that no disagreement between parts can be measured
        return 0.0
    between = (q - freedom) / shared
    return max(between, 0.0) * float(scipy.stats.t.ppf(0.975, freedom) / NORMAL) ** 2
