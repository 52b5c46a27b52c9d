"""Joint laws of one round: sighted along the likeliest direction, driven by the seen motion, then simulated freely."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from estimation import WindowedSpectrum

from ..adapters.structure.acceptance import LEAST_EVIDENCE, Option
from ..inference.diagnosis import Candidate
from ..inference.process_pool import side_by_side
from ..models.fitting import Fit, fit
from ..models.hypothesis import direction_of
from ..physics import JointPhysics, answer_name
from .joint_direction import find_direction
from .joint_screening import Screened, screen_joints
from .linear_floor import linear_floor

PROMISING = 0.15
"""Screened gain, as a share of the best law's, from which a law is fitted."""

MOST_LAWS, MOST_SIMULATED = 4, 2
"""Laws that are fitted to the motion seen, and the best of them that are then simulated freely."""

LEAST_GAIN = 60.0
"""Screened gain below which no law is fitted."""

NEARLY = 0.6
"""Gain of a law driven by the motion seen, as a share of the best law's, from which it is simulated."""

RIVAL = 0.3
"""Gain of a law driven by the motion seen, as a share of the best linear cause's, from which it is simulated."""

FEW = 1000
"""Lines of a recording on which shapes of a law are compared."""

STANDS_OUT = 50.0
"""Gain a recording from which a direction is believed."""


@dataclass(frozen=True)
class SightedLaws:
    """Laws along the likeliest direction, best first, and what is told of them."""

    screened: tuple[Screened, ...]
    weighed: tuple[Candidate, ...]

    @property
    def gain(self) -> float:
        """Screened, of the best."""
        return self.screened[0].gain if self.screened else 0.0


def sighted_laws(lines: list[WindowedSpectrum], current: Fit, laws: list[JointPhysics]) -> SightedLaws:
    """Screen joint laws along the direction that stands out; nothing where none does."""
    taken = {answer_name(cause.physics) for cause in current.explanation.causes}
    laws = [law for law in laws if answer_name(law) not in taken]
    floor = linear_floor(current, lines)
    sighting = find_direction(floor, current.explanation)
    # along a single axis there is no direction to stand out, and a broad force looks like a higher floor
    if not laws or (len(sighting.direction) > 1 and sighting.gain < STANDS_OUT * len(lines)):
        return SightedLaws((), ())
    location = {"direction": [round(float(x), 6) for x in sighting.direction]}
    screened = screen_joints(floor, current.explanation, sighting.direction, laws)
    weighed = [Candidate(answer_name(one.causes[0].physics), one.gain, "screened", location) for one in screened]
    return SightedLaws(tuple(screened), tuple(weighed))


def joint_options(
    lines: list[WindowedSpectrum], current: Fit, sighted: SightedLaws, least: float, gained: float = 0.0
) -> list[Option]:
    """Fit the laws that promise most.

    Parameters
    ----------
    lines
        Recordings.
    current
        Without a law.
    sighted
        Laws to try.
    least
        Screened gain from which one is fitted.
    gained
        Score that the best linear cause gains.
    """
    promising = [one for one in sighted.screened if one.gain > max(LEAST_GAIN, least, PROMISING * sighted.gain)]
    driven = side_by_side([partial(_driven, lines, current, one) for one in promising[:MOST_LAWS]])
    driven.sort(key=lambda one: one.score)
    gains = [current.score - one.score for one in driven]
    enough = max([LEAST_EVIDENCE / 2, RIVAL * gained, *(NEARLY * gain for gain in gains[:1])])
    # forms of different causes may differ by a linear spring alone: all that are as good are simulated
    near = [
        one
        for place, (one, gain) in enumerate(zip(driven, gains, strict=True))
        if gain >= enough and (place < MOST_SIMULATED or gain > gains[0] - LEAST_EVIDENCE)
    ]
    simulated = side_by_side([partial(_simulated, lines, one) for one in near])
    return [option for option in simulated if option is not None]


def _driven(lines: list[WindowedSpectrum], current: Fit, screened: Screened) -> Fit:
    """A law fitted to the motion seen, from the better of its two best shapes."""
    rough = [one.thinned(FEW) for one in lines]
    starts = [
        fit(rough, current.explanation.with_cause(cause), current.noises, iterations=2) for cause in screened.causes[:2]
    ]
    best = min(starts, key=lambda start: start.score)
    return fit(lines, best.explanation, best.noises, iterations=4)


def _simulated(lines: list[WindowedSpectrum], near: Fit) -> Option | None:
    """The law of a driven fit, now free to move as it makes the structure move; None if that runs away."""
    last = near.explanation.causes[-1]
    free = replace(near.explanation, causes=(*near.explanation.causes[:-1], replace(last, seen=None)))
    # the one that is accepted is fitted to the end
    try:
        fitted = fit(lines, free, near.noises, iterations=10, tolerance=10.0)
    except np.linalg.LinAlgError:
        return None
    return Option(answer_name(last.physics), direction_of(fitted.explanation.causes[-1]), fitted)
