"""Derivative of the joints' forces by everything that is fitted, the structure's motion answering."""

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, rfft

from estimation import WindowedSpectrum

from ..joints import JointResponse, common_axes, driven_force, joint_dynamics, stiffness_ramp, tangent_run
from .hypothesis import TURN_STEP, Cause, Hypothesis, Predicted, across, surround
from .modal_lines import displacement_at, receptance_at

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

BEYOND = 1.3
"""Changes of motion are followed up to this multiple of the band's end."""

ASIDE = 0.02
"""Step of a cause's coordinates for a difference quotient at given motion."""


def joint_changes(hypothesis: Hypothesis, lines: WindowedSpectrum, predicted: Predicted) -> Complex:
    """Derivative of the windowed lines of the joints' force on the structure, (n_lines, n_excitations, size).

    A change of the modal parameters, of the outer force or of an earlier joint changes a joint's driven motion; its
    tangent run says how its force answers. The sign is the one that the structure feels: minus g along the direction.

    Parameters
    ----------
    hypothesis
        Hypothesis with at least one joint.
    lines
        Windowed spectrum of the recording.
    predicted
        What the hypothesis predicts for the recording.
    """
    frequencies = lines.padded_frequencies
    frequencies = frequencies[frequencies <= BEYOND * lines.frequencies[-1]]
    outer, change = _outer_change(hypothesis, lines, len(frequencies))
    result = np.zeros((len(lines.frequencies), outer.shape[1], hypothesis.size), dtype=complex)
    answers = iter(predicted.joints)
    at = hypothesis.shape.size
    for place, cause in enumerate(hypothesis.causes):
        own = slice(at, at + cause.size)
        at += cause.size
        if cause.direction is None:
            continue
        answer = next(answers)
        _, columns = common_axes(hypothesis.model)
        outer[:, columns] -= answer.force[: len(frequencies), None] * cause.direction
        dg = _force_change(hypothesis, lines, (cause, own, answer), outer, change)
        angles = slice(own.start + len(cause.values), own.stop)
        turn = TURN_STEP * across(cause.direction)
        result[:, columns] -= lines.cut(np.asarray(dg))[:, None, :] * cause.direction[:, None]
        result[:, columns, angles] -= lines.cut(irfft(answer.force, n=lines.padded)[:, None])[:, :, None] * turn
        if any(later.direction is not None for later in hypothesis.causes[place + 1 :]):
            change[:, columns] -= rfft(dg, n=lines.padded, axis=0)[: len(frequencies), None] * cause.direction[:, None]
            change[:, columns, angles] -= answer.force[: len(frequencies), None, None] * turn
    return result


def _outer_change(hypothesis: Hypothesis, lines: WindowedSpectrum, count: int) -> tuple[Complex, Complex]:
    """Outer force at padded lines, and its derivative by the numbers of linear causes."""
    frequencies = lines.padded_frequencies[:count]
    force = lines.force_lines[:count]
    outer = np.array(surround(hypothesis, frequencies).pushed(force))
    change = np.zeros((*outer.shape, hypothesis.size), dtype=complex)
    here, first = hypothesis.coordinates(), hypothesis.shape.size
    at = 0
    for cause in hypothesis.causes:
        for k in range(at, at + cause.size if cause.direction is None else at):
            aside = here.copy()
            aside[k] += ASIDE
            moved = surround(hypothesis.with_causes(aside), frequencies).pushed(force)
            change[:, :, first + k] = (moved - outer) / ASIDE
        at += cause.size
    return outer, change


def _force_change(
    hypothesis: Hypothesis,
    lines: WindowedSpectrum,
    joint: tuple[Cause, slice, JointResponse],
    force: Complex,
    change: Complex,
) -> NDArray[np.float32]:
    """Derivative of g at the samples, (n, size)."""
    cause, own, answer = joint
    often = len(answer.deflection) // (len(lines.recording.force) if cause.seen is not None else lines.padded)
    n = often * len(lines.recording.force)
    # a derivative need not be known to more than six digits
    dg = np.zeros((n, hypothesis.size), dtype=np.float32)
    dg[:, own] = _law_change(cause, lines, answer, often)
    if cause.seen is not None:
        return dg
    driven = _driven_change(hypothesis, lines, joint, force, change)
    spectrum = np.zeros((often * lines.padded // 2 + 1, hypothesis.size), dtype=np.complex64)
    spectrum[: len(driven)] = often * driven
    law, step = cause.law(), 1 / (often * lines.recording.rate)
    s = 2j * np.pi * np.arange(len(spectrum), dtype=np.float32)[:, None] / np.float32(lines.padded * step * often)
    assert cause.direction is not None
    tangent_run(
        (answer.deflection[:n], answer.velocity[:n]),
        joint_dynamics(hypothesis.model, cause.direction, step),
        law.tables(),
        (law.reach, law.speed),
        stiffness_ramp(law, n, step, lines.recording.duration),
        (law.springs, law.yields),
        (
            irfft(spectrum, n=often * lines.padded, axis=0)[:n],
            irfft(s * spectrum, n=often * lines.padded, axis=0)[:n],
        ),
        dg,
    )
    return at_samples(dg, often)


def at_samples(signal: NDArray[np.float32], often: int) -> NDArray[np.float32]:
    """Every ``often``-th instant of signals (often n, n_columns), each the mean of those around it, tapered."""
    if often == 1:
        return signal
    weights = np.bartlett(2 * often + 1)[1:-1]
    weights /= weights.sum()
    padded = np.pad(signal, ((often - 1, often - 1), (0, 0)))
    return np.asarray(
        sum(weight * padded[k : k + len(signal) : often] for k, weight in enumerate(weights.astype(np.float32)))
    )


def _law_change(cause: Cause, lines: WindowedSpectrum, answer: JointResponse, often: int) -> Real:
    """Derivative of g at given motion by the cause's own numbers, (n, cause.size); none by angles."""
    n = often * len(lines.recording.force)
    x, v = answer.deflection[:n], answer.velocity[:n]
    result = np.zeros((n, cause.size))
    here = cause.coordinates()
    plain = driven_force(lines, x, v, cause.law(), often=often)
    for k in range(len(cause.values)):
        aside = here.copy()
        aside[k] += ASIDE
        result[:, k] = (driven_force(lines, x, v, cause.moved(aside).law(), often=often) - plain) / ASIDE
    return result


def _driven_change(
    hypothesis: Hypothesis,
    lines: WindowedSpectrum,
    joint: tuple[Cause, slice, JointResponse],
    force: Complex,
    change: Complex,
) -> Complex:
    """Derivative of the driven deflection at padded lines, (n, size): by modes, outer forces and angles."""
    cause, own, answer = joint
    assert cause.direction is not None
    frequencies = lines.padded_frequencies[: len(force)]
    rows, columns = common_axes(hypothesis.model)
    along = np.einsum("p,kpq->kq", cause.direction, receptance_at(hypothesis.model, frequencies)[:, rows])
    size = hypothesis.shape.size
    modes = hypothesis.shape.jacobian(hypothesis.u, frequencies, force)
    result = np.zeros((len(frequencies), hypothesis.size), dtype=complex)
    for row, share in zip(rows, cause.direction, strict=True):
        result[:, :size] += share * modes[:, row]
    if change.any():
        result += np.einsum("kq,kqc->kc", along, change)
    turn = TURN_STEP * across(cause.direction)
    displacement = displacement_at(hypothesis.model, frequencies, force)[:, rows]
    angles = displacement @ turn - (along[:, columns] @ turn) * answer.force[: len(force), None]
    result[:, own.start + len(cause.values) : own.stop] += angles
    return np.asarray(result)
