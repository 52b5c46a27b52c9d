"""The structure that a cut sees once everything found is counted: receptances of a hypothesis at one level."""

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, WindowedSpectrum

from ...joints import common_axes, driven_force
from ...models import Hypothesis, predict_lines, surround

Real = NDArray[np.float64]


def equivalent_receptance(hypothesis: Hypothesis, lines: WindowedSpectrum, frequencies: Real) -> Frf:
    """Receptance with the causes that belong to the structure, joints linearised for the motion of one recording.

    A joint's law counts as the spring and damper that come closest to its force, ``k = <g x> / <x^2>`` and
    ``c = <g v> / <v^2>`` (statistical linearisation: Roberts & Spanos, Random Vibration and Statistical Linearization,
    chapter 5). Faults of the measuring chain are no part of the structure.

    Parameters
    ----------
    hypothesis
        Hypothesis with its modes and causes as fitted.
    lines
        Recording whose motion counts.
    frequencies : (n,), Hz
        Frequencies at which the receptances are computed.

    Returns
    -------
    Frf
        Receptances, m/N.
    """
    model = hypothesis.model
    added = np.zeros((len(frequencies), len(model.excitations), len(model.responses)), dtype=complex)
    feedback = surround(hypothesis, frequencies).feedback
    if feedback is not None:
        added += feedback
    rows, columns = common_axes(model)
    s = 2j * np.pi * frequencies
    answers = iter(predict_lines(hypothesis, lines).joints)
    for cause in hypothesis.causes:
        if cause.direction is None:
            continue
        answer = next(answers)
        often = max(1, len(answer.deflection) // lines.padded)
        kept = slice(lines.start * often, (lines.start + len(lines.window)) * often)
        x, v = answer.deflection, answer.velocity
        g = driven_force(lines, x, v, cause.law(), often=often)[kept]
        stiffness, damping = (float(g @ y[kept]) / float(y[kept] @ y[kept]) for y in (x, v))
        outer = np.outer(cause.direction, cause.direction)
        added[:, np.array(columns)[:, None], rows] += (stiffness + s * damping)[:, None, None] * outer
    receptance = model.receptance(frequencies)
    closed = np.asarray(np.linalg.solve(np.eye(receptance.shape[1]) + receptance @ added, receptance))
    valid = np.ones(len(frequencies), dtype=bool)
    return Frf(frequencies, closed, model.responses, model.excitations, "receptance", "m/N", valid)
