"""Laws of two names whose forces differ by a linear spring alone: where one was fitted, the other is fitted too.

Stiffness that is gained beyond a knee is stiffness that is missing within it, on modes that are as much softer. The
misfit cannot tell them apart. How odd the modes must be does, and it can only where both were fitted.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from estimation import WindowedSpectrum

from ..inference import Proposal, in_processes
from ..models import Fit, believed, fit
from ..physics import JointPhysics, Physics, TwinPhysics, answer_name

STEPS = 60
"""Steps at most of the fit of a twin, which begins on the lab's modes."""


def twin_laws(
    lines: list[WindowedSpectrum], current: Fit, proposals: Sequence[Proposal[Fit]], causes: Mapping[str, Physics]
) -> list[Proposal[Fit]]:
    """Fit the twin of each proposed law that was not fitted itself, from the same numbers on the lab's modes.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    current
        The fit without the laws.
    proposals
        Fitted causes whose twins are wanted.
    causes
        Causes that may be weighed, by name.
    """
    known = {one.fitted.hypothesis.causes[-1].physics.name for one in proposals}
    tasks = []
    for one in proposals:
        physics = one.fitted.hypothesis.causes[-1].physics
        other = causes.get(physics.twin) if isinstance(physics, TwinPhysics) else None
        if isinstance(other, JointPhysics) and other.name not in known:
            tasks.append(partial(_twin_of, lines, current, one, other))
            known.add(other.name)
    return [one for one in in_processes(tasks) if np.isfinite(one.fitted.score)]


def _twin_of(
    lines: list[WindowedSpectrum], current: Fit, proposal: Proposal[Fit], physics: JointPhysics
) -> Proposal[Fit]:
    """The same numbers under the other name, fitted from the lab's modes."""
    hypothesis = believed(proposal.fitted.hypothesis)
    last = replace(hypothesis.causes[-1], physics=physics)
    fitted = fit(lines, replace(hypothesis, causes=(*hypothesis.causes[:-1], last)), iterations=STEPS)
    return Proposal(answer_name(physics), proposal.location, fitted, current.score - fitted.score)
