"""Joint laws found in one recording and carried to the others, one level after the other.

A strong law shifts a resonance by more than its width. The refit to all levels is then an average that no level shows,
and the motion that starts a law is wrong. Hardening and softening shift least where the motion is small, dry friction
and play where it is large. So modes and law are found in the weakest and in the strongest recording alone, and each
further recording begins where the ones before ended (continuation in the level: Allgower & Georg, Introduction to
Numerical Continuation Methods, SIAM 2003).
"""

from dataclasses import replace
from functools import partial

import numpy as np

from estimation import WindowedSpectrum

from ..inference import Proposal, Settings, in_processes
from ..models import Fit, Hypothesis, fit, location_of, predict_lines
from ..physics import JointPhysics
from .joint_direction import motion_of
from .joint_laws_fitted import joint_candidates, sighted_laws

CARRIED = 2
"""Laws that are carried from one recording to the others at most."""

FROM_NOMINAL, PER_LEVEL, TO_END = 30, 12, 15
"""Steps at most of the refit of one recording, of each level that joins, and of the fit to all of them."""

LONGEST_REACH = 100.0
"""Growth of a joint's motion beyond which a simulation has run away."""


def laws_by_level(
    lines: list[WindowedSpectrum], current: Fit, laws: list[JointPhysics], settings: Settings
) -> list[Proposal[Fit]]:
    """Fit joint laws to the weakest and the strongest recording, and carry the best to all others.

    Where all levels are alike, there is nothing to carry.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    current
        The fit of all recordings with the causes found so far.
    laws
        Laws from the library.
    settings
        Thresholds of the diagnosis.
    """
    order = np.argsort([_level(one) for one in lines])
    ordered = [lines[k] for k in order]
    if _level(ordered[-1]) < settings.search.levels_apart * _level(ordered[0]):
        return []
    ways = ordered, ordered[::-1]
    ends = in_processes([partial(_at_the_end, way, current, laws, settings) for way in ways])
    tasks = [partial(_carried, lines, way, current, one) for way, end in zip(ways, ends, strict=True) for one in end]
    return [one for one in in_processes(tasks) if one is not None]


def _at_the_end(
    way: list[WindowedSpectrum], current: Fit, laws: list[JointPhysics], settings: Settings
) -> list[Proposal[Fit]]:
    """Laws fitted to the first recording of a way alone, from the lab's modes, those with most evidence first."""
    start = replace(current.hypothesis, u=np.zeros_like(current.hypothesis.u))
    alone = fit(way[:1], start, iterations=FROM_NOMINAL)
    if not np.isfinite(alone.score):
        return []
    found = joint_candidates(way[:1], alone, sighted_laws(way[:1], alone, laws, settings), settings, 0.0)
    return sorted(found, key=lambda one: -one.evidence)[:CARRIED]


def _carried(
    lines: list[WindowedSpectrum], way: list[WindowedSpectrum], current: Fit, first: Proposal[Fit]
) -> Proposal[Fit] | None:
    """A law of a way's first recording fitted to one more level after the other; None where it runs away."""
    reached = first.fitted.hypothesis
    for count in range(2, len(way)):
        reached = fit(way[:count], _with_motion(reached, way[:count]), iterations=PER_LEVEL).hypothesis
    fitted = fit(lines, _with_motion(reached, lines), iterations=TO_END, tolerance=10.0)
    if not np.isfinite(fitted.score):
        return None
    axis = fitted.hypothesis.causes[-1].axis
    assert axis is not None
    location = {**first.location, **location_of(axis, fitted.hypothesis.model)}
    return Proposal(first.name, location, fitted, current.score - fitted.score)


def _with_motion(hypothesis: Hypothesis, lines: list[WindowedSpectrum]) -> Hypothesis:
    """The hypothesis whose last law reaches as far as its joint now moves; as it was where that runs away."""
    last = hypothesis.causes[-1]
    assert last.motion is not None
    joints = [predict_lines(hypothesis, one).joints[-1] for one in lines]
    motion = motion_of(joints, last.motion.stiffness)
    # NaN is no smaller
    if not motion.reach <= LONGEST_REACH * last.motion.reach:
        return hypothesis
    return replace(hypothesis, causes=(*hypothesis.causes[:-1], replace(last, motion=motion)))


def _level(lines: WindowedSpectrum) -> float:
    """Root mean square of what drives the recording in the compared band."""
    # not `BandRecording.level`: it counts force outside the band, which says little of how far these modes move
    return float(np.sqrt(np.mean(np.abs(lines.force_here) ** 2)))
