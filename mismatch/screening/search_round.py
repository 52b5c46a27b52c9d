"""One round of the search: everything is screened, what promises most is fitted."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from estimation import WindowedSpectrum

from ..adapters.structure.acceptance import NOISE_LIKE, SMALL, Option, evidence_needed, gains, impossible, unexplained
from ..inference.diagnosis import Candidate
from ..inference.process_pool import side_by_side
from ..models.fitting import Fit
from ..physics import ChainPhysics, JointPhysics, Physics, answer_name
from ..remainder.leftover import Leftover, leftover
from .chain_screening import ScreenedChain, screen_chains
from .joint_candidates import SightedLaws, joint_options, sighted_laws
from .linear_candidates import channel_of, linear_options
from .linear_floor import noise_floor
from .missing_mode import SightedMode, find_mode

WITHIN_REACH = 0.5
"""Screened gain of a cause, as a share of the evidence it needs, from which it is fitted."""

FAR_AHEAD = 100.0
"""Screened gain of a joint's law over that of any linear cause from which laws are fitted first."""


@dataclass(frozen=True)
class Round:
    """What a round found.

    Parameters
    ----------
    options
        Fitted candidates.
    weighed
        All candidates, screened and fitted.
    sighted
        Whether joint laws were tried along a direction.
    """

    options: list[Option]
    weighed: list[Candidate]
    sighted: bool


def fitted_options(
    lines: list[WindowedSpectrum],
    current: Fit,
    base: Fit,
    causes: dict[str, Physics],
    moving: tuple[Leftover, Leftover],
) -> Round:
    """Screen everything, fit what promises most.

    Parameters
    ----------
    lines
        Recordings.
    current, base
        Fits with the causes found so far, and with none.
    causes
        By name.
    moving
        What of the residual moves with the signal, under ``current`` and under ``base``.
    """
    laws = [p for p in causes.values() if isinstance(p, JointPhysics)]
    much = moving[0].share > NOISE_LIKE and moving[0].power > 3 * SMALL * moving[1].power
    chains, mode, sighted = _screened(lines, current, causes, laws if much else [])
    weighed = [Candidate(answer_name(one.cause.physics), one.gain, "screened", channel_of(one.cause)) for one in chains]
    weighed.append(Candidate("missing_mode", mode.gain, "screened"))
    least = WITHIN_REACH * evidence_needed(current, base)
    options: list[Option] = []
    if sighted.gain > FAR_AHEAD * max([one.gain for one in chains] + [mode.gain, 0.0]):
        options = joint_options(lines, current, sighted, least)
    if not _explains(_best(options, current), lines, moving[1]):
        tried = bool(options)
        options += linear_options(lines, current, chains, mode, least)
        if not tried and _joints_are_due(_best(options, current), current, moving, lines):
            sighted = sighted if much else sighted_laws(lines, current, laws)
            best = _best(options, current)
            gained = current.score - best.fitted.score if best is not None else 0.0
            options += joint_options(lines, current, sighted, least, gained)
    weighed += sighted.weighed
    weighed += [_weighed(one, current) for one in options]
    return Round(options, weighed, sighted.gain > 0)


def _screened(
    lines: list[WindowedSpectrum], current: Fit, causes: dict[str, Physics], laws: list[JointPhysics]
) -> tuple[list[ScreenedChain], SightedMode, SightedLaws]:
    """What every cause promises, without a fit: linear ones not found yet, a further mode, joint laws."""
    own_noise, explanation = noise_floor(current, lines), current.explanation
    physics = [p for p in causes.values() if isinstance(p, ChainPhysics)]
    makers: list[Callable[[], Any]] = [
        lambda: sighted_laws(lines, current, laws) if laws else SightedLaws((), ()),
        lambda: find_mode(own_noise, explanation),
        lambda: screen_chains(own_noise, explanation, physics),
    ]
    sighted, mode, chains = side_by_side(makers)
    taken = {(cause.physics.name, cause.place) for cause in explanation.causes}
    return [one for one in chains if (one.cause.physics.name, one.cause.place) not in taken], mode, sighted


def _weighed(one: Option, current: Fit) -> Candidate:
    """A fitted option as it is told; one whose numbers cannot be says so."""
    reason = impossible(one)
    place = one.location | ({"impossible": reason} if reason else {})
    return Candidate(one.name, current.score - one.fitted.score, "impossible" if reason else "fitted", place)


def _best(options: list[Option], current: Fit) -> Option | None:
    best = min((one for one in options if not impossible(one)), key=lambda one: one.fitted.score, default=None)
    return best if best is not None and gains(best, current) else None


def _explains(best: Option | None, lines: list[WindowedSpectrum], before: Leftover) -> bool:
    """Whether an option leaves too little that moves with the signal to look further."""
    if best is None:
        return False
    return not unexplained(best.fitted.explanation, leftover(best.fitted.explanation, lines), before)


def _joints_are_due(
    best: Option | None, current: Fit, moving: tuple[Leftover, Leftover], lines: list[WindowedSpectrum]
) -> bool:
    """Whether joint laws are tried beside linear causes: none was found, a mode may imitate them, or much is left."""
    if best is None and not current.explanation.causes:
        return True
    # modes are many-sided: a joint that drifts or rubs is imitated by a few of them
    if best is not None and best.name == "missing_mode":
        return True
    left = leftover(best.fitted.explanation, lines) if best is not None else moving[0]
    return left.share > NOISE_LIKE and left.power > 3 * SMALL * moving[1].power
