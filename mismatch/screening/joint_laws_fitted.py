"""Joint laws of one round: sighted at the likeliest place, driven by the seen motion, then simulated freely."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from estimation import WindowedSpectrum

from ..inference import Candidate, Proposal, Settings, in_processes
from ..models import Fit, fit, location_of
from ..physics import JointPhysics, answer_name
from .joint_places import JointPlace, joint_places
from .joint_screening import Screened, screen_joints
from .whitened_residual import linear_floor

FEW = 1000
"""Lines of a recording on which shapes of a law are compared."""


@dataclass(frozen=True)
class SightedLaws:
    """Laws at the likeliest place of a joint, best first, what a diagnosis tells about them, and places as likely."""

    screened: tuple[Screened, ...]
    weighed: tuple[Candidate, ...]
    places: tuple[JointPlace, ...] = ()

    @property
    def gain(self) -> float:
        """Screened gain of the best law, in misfit; zero where there is none."""
        return self.screened[0].gain if self.screened else 0.0


def sighted_laws(
    lines: list[WindowedSpectrum], current: Fit, laws: list[JointPhysics], settings: Settings
) -> SightedLaws:
    """Screen joint laws at the place that stands out; nothing where none does.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    current
        The fit with the causes found so far.
    laws
        Laws from the library that are screened.
    settings
        Thresholds of the diagnosis.
    """
    taken = {answer_name(cause.physics) for cause in current.hypothesis.causes}
    laws = [law for law in laws if answer_name(law) not in taken]
    floor = linear_floor(current, lines)
    places = joint_places(floor, current.hypothesis, settings.screening.place)
    axis, gain = places[0].axis, places[0].gain
    # along a single axis there is no direction to stand out, and a broad force looks like a higher floor
    if not laws or (len(axis.entries) > 1 and gain < settings.screening.direction * len(lines)):
        return SightedLaws((), ())
    location = location_of(axis, current.hypothesis.model)
    screened = screen_joints(floor, current.hypothesis, axis, laws)
    weighed = [Candidate(answer_name(one.causes[0].physics), one.gain, "screened", location) for one in screened]
    return SightedLaws(tuple(screened), tuple(weighed), places)


def joint_candidates(
    lines: list[WindowedSpectrum],
    current: Fit,
    sighted: SightedLaws,
    settings: Settings,
    least: float,
    gained: float = 0.0,
) -> list[Proposal[Fit]]:
    """Fit the laws that promise most.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    current
        The fit without a further law.
    sighted
        Laws to try, as they were screened, best first.
    settings
        Thresholds of the diagnosis.
    least
        Screened gain from which a law is fitted.
    gained
        Score that the best linear cause gains.
    """
    limits = settings.screening
    enough = max(limits.least_law, least, limits.promising_law * sighted.gain)
    promising = [one for one in sighted.screened if one.gain > enough]
    driven = in_processes([partial(_driven, lines, current, one) for one in promising[: limits.most_laws]])
    driven = [one for one in driven if np.isfinite(one.score)]
    driven.sort(key=lambda one: one.score)
    gains = [current.score - one.score for one in driven]
    nearly = [limits.nearly * gain for gain in gains[:1]]
    enough = max([settings.evidence.least / 2, limits.rival * gained, *nearly])
    # forms of different causes may differ by a linear spring alone: all that are as good are simulated
    near = [
        one
        for place, (one, gain) in enumerate(zip(driven, gains, strict=True))
        if gain >= enough and (place < limits.most_simulated or gain > gains[0] - settings.evidence.least)
    ]
    # a direction at the tip that nothing else comes near to says all
    told = {"places": [one.told() for one in sighted.places]}
    if len(sighted.places) == 1 and sighted.places[0].axis.scales is None:
        told = {}
    simulated = in_processes([partial(_simulated, lines, current, one, told) for one in near])
    return [one for one in simulated if one is not None]


def _driven(lines: list[WindowedSpectrum], current: Fit, screened: Screened) -> Fit:
    """A law fitted to the motion seen, from the better of its two best shapes."""
    rough = [one.thinned(FEW) for one in lines]
    starts = [
        fit(rough, current.hypothesis.with_cause(cause), current.noises, iterations=2) for cause in screened.causes[:2]
    ]
    best = min(starts, key=lambda start: start.score)
    if not np.isfinite(best.score):
        return best
    return fit(lines, best.hypothesis, best.noises, iterations=4)


def _simulated(lines: list[WindowedSpectrum], current: Fit, near: Fit, told: Mapping[str, Any]) -> Proposal[Fit] | None:
    """The law of a driven fit, now free to move as it makes the structure move; None if that runs away."""
    last = near.hypothesis.causes[-1]
    free = replace(near.hypothesis, causes=(*near.hypothesis.causes[:-1], replace(last, seen=None)))
    # the one that is accepted is fitted to the end
    fitted = fit(lines, free, near.noises, iterations=10, tolerance=10.0)
    if not np.isfinite(fitted.score):
        return None
    axis = fitted.hypothesis.causes[-1].axis
    assert axis is not None
    location = {**location_of(axis, fitted.hypothesis.model), **told}
    return Proposal(answer_name(last.physics), location, fitted, current.score - fitted.score)
