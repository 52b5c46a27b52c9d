"""Derivative of the response lines by everything that is fitted."""

import numpy as np
from numpy.typing import NDArray

from estimation import WindowedSpectrum

from .hypothesis import Hypothesis, Predicted, line_response, surround
from .joint_tangents import joint_changes

Complex = NDArray[np.complex128]


def jacobian(hypothesis: Hypothesis, lines: WindowedSpectrum, predicted: Predicted) -> Complex:
    """Derivative of the response lines by u and the causes' coordinates, (n_lines, n_responses, size)."""
    around = surround(hypothesis, lines.frequencies)
    force: Complex = around.pushed(lines.force_here)
    joint = lines.cut(lines.signal(predicted.joint)) if predicted.joints else None
    if joint is not None:
        force = force - joint
    receptance = hypothesis.model.receptance(lines.frequencies)
    closed = around.closed(receptance)
    if around.feedback is not None:
        force = force - np.einsum("kqp,kp->kq", around.feedback, np.einsum("kpq,kq->kp", closed, force))
    if not hypothesis.causes:
        return hypothesis.shape.jacobian(hypothesis.u, lines.frequencies, force, lines.kinematic)
    linear = hypothesis.shape.jacobian(hypothesis.u, lines.frequencies, force)
    if around.feedback is not None:
        linear = np.asarray(np.linalg.solve(np.eye(receptance.shape[1]) + receptance @ around.feedback, linear))
    result = np.zeros((*linear.shape[:2], hypothesis.size), dtype=complex)
    result[:, :, : linear.shape[2]] = linear
    if predicted.joints:
        result += closed @ joint_changes(hypothesis, lines, predicted)
    result *= lines.kinematic[:, :, None]
    shown: Complex = np.asarray(around.shown(result), dtype=complex)
    here, plain = hypothesis.coordinates(), line_response(hypothesis, lines, joint)
    chain = np.concatenate([np.zeros(0)] + [np.full(c.size, c.direction is None) for c in hypothesis.causes])
    for k in np.flatnonzero(chain):
        aside = here.copy()
        aside[k] += 0.02
        change = line_response(hypothesis.with_causes(aside), lines, joint) - plain
        shown[:, :, linear.shape[2] + k] += change / 0.02
    return shown
