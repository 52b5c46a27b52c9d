"""The structure that a cut sees once everything found is counted: receptances of a hypothesis at one level."""

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, WindowedSpectrum

from ....joints import driven_force
from ....models import Hypothesis, predict_lines, surround

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
    model, reach = hypothesis.model, hypothesis.reach
    n, m = len(model.responses), len(model.excitations)
    receptance = reach.model.receptance(frequencies)
    added = np.zeros(receptance.swapaxes(1, 2).shape, dtype=complex)
    feedback = surround(hypothesis, frequencies).feedback
    if feedback is not None:
        added[:, :m, :n] += feedback
    s = 2j * np.pi * frequencies
    answers = predict_lines(hypothesis, lines).joints
    for cause, path, answer in zip(hypothesis.laws, reach.paths, answers, strict=True):
        often = max(1, len(answer.deflection) // lines.padded)
        kept = slice(lines.start * often, (lines.start + len(lines.window)) * often)
        x, v = answer.deflection, answer.velocity
        g = driven_force(lines, x, v, cause.law(), often=often)[kept]
        stiffness, damping = (float(g @ y[kept]) / float(y[kept] @ y[kept]) for y in (x, v))
        added += (stiffness + s * damping)[:, None, None] * np.outer(path.push, path.along)
    whole = np.linalg.solve(np.eye(receptance.shape[1]) + receptance @ added, receptance)
    closed = np.asarray(whole[:, :n, :m], dtype=complex)
    valid = np.ones(len(frequencies), dtype=bool)
    return Frf(frequencies, closed, model.responses, model.excitations, "receptance", "m/N", valid)
