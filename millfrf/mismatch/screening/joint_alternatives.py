"""Joint laws fitted at the location of an accepted one, as alternatives to it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from estimation import WindowedSpectrum

from ..inference.process_pool import in_processes
from ..inference.search import Proposal
from ..inference.settings import Settings
from ..joints.joint_axis import JointAxis
from ..models.fitting import Fit, fit
from ..models.refinement import believed
from ..physics.protocol import JointPhysics, LimitedPhysics, Physics, TwinPhysics, answer_name
from .joint_starts import begun_at, with_phases

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


def laws_beyond(
    lines: list[WindowedSpectrum], current: Fit, best: Proposal[Fit], laws: Sequence[JointPhysics], settings: Settings
) -> list[Proposal[Fit]]:
    """Fit the laws beyond the limit of the best law's name, where its numbers end there: at its place, from the start.

    Hysteresis whose elements yield at once is dry friction. Its fit ends at the limit, and cannot pass it.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    current
        The fit without the law.
    best
        The law that was found.
    laws
        Laws from the library that may be weighed.
    settings
        Thresholds of the diagnosis.
    """
    last = best.fitted.hypothesis.causes[-1]
    if last.motion is None or not isinstance(last.physics, LimitedPhysics):
        return []
    if not last.physics.strained(last.values, last.motion):
        return []
    beyond = [one for one in laws if answer_name(one) == last.physics.beyond]
    return laws_in_place(lines, current, best, beyond, settings)


def laws_in_place(
    lines: list[WindowedSpectrum], current: Fit, best: Proposal[Fit], laws: Sequence[JointPhysics], settings: Settings
) -> list[Proposal[Fit]]:
    """Fit other laws in the place of one that was found, each from its start.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    current
        The fit without the law.
    best
        The law that was found; a linear cause has no place for them.
    laws
        Laws that are fitted.
    settings
        Thresholds of the diagnosis.
    """
    axis = best.fitted.hypothesis.causes[-1].axis
    if axis is None:
        return []
    begun = in_processes([partial(_begun_there, lines, current, one, axis, settings) for one in laws])
    return [
        Proposal(answer_name(law), best.location, one, current.score - one.score)
        for law, one in zip(laws, begun, strict=True)
        if one is not None and np.isfinite(one.score)
    ]


def _begun_there(
    lines: list[WindowedSpectrum], current: Fit, law: JointPhysics, axis: JointAxis, settings: Settings
) -> Fit | None:
    """A law begun at the place of another, with phases of the modes where these gain."""
    begun = begun_at(lines, current, law, axis)
    return None if begun is None else with_phases(lines, begun, settings.evidence.least, current.score - begun.score)
