"""One round of the search: everything is screened, what promises most is fitted."""

from dataclasses import replace
from typing import Any

import numpy as np

from .acceptance import LEAST_EVIDENCE, NOISE_LIKE, SMALL, Option, evidence_needed
from .chain_screening import ScreenedChain, screen_chains
from .diagnosis import Candidate
from .explanation import Cause, Explanation
from .fitting import Fit, fit
from .joint_direction import find_direction
from .joint_screening import screen_joints
from .leftover import Leftover, leftover
from .linear_floor import Floor, linear_floor, noise_floor
from .missing_mode import SightedMode, find_mode
from .physics import ChainPhysics, JointPhysics, Physics, answer_name
from .settling import with_chain
from .windowed_lines import WindowedLines

MOST_CHAINS = 3
"""Linear causes that are fitted in a round."""

WITHIN_REACH = 0.5
"""Screened gain of a linear cause, as a share of the evidence it needs, from which it is fitted."""

RESOLVED = 2.0
"""Least half-power bandwidth of an added mode, in spacings of lines."""

PROMISING = 0.1
"""Screened gain, as a share of the best law's, from which a law is fitted."""

MOST_LAWS = 4
"""Joint laws that are fitted to the motion seen; the two best are then simulated freely."""


def fitted_options(
    lines: list[WindowedLines], current: Fit, base: Fit, causes: dict[str, Physics], before: Leftover
) -> tuple[list[Option], list[Candidate]]:
    """Screen everything, fit what promises most."""
    own_noise = noise_floor(current, lines)
    taken = {(cause.physics.name, cause.place) for cause in current.explanation.causes}
    chains = [
        one
        for one in screen_chains(
            own_noise, current.explanation, [p for p in causes.values() if isinstance(p, ChainPhysics)]
        )
        if (one.cause.physics.name, one.cause.place) not in taken
    ]
    options: list[Option] = []
    weighed = [Candidate(answer_name(one.cause.physics), one.gain, "screened", _place(one.cause)) for one in chains]
    mode = find_mode(own_noise, current.explanation)
    weighed.append(Candidate("missing_mode", mode.gain, "screened"))
    least = WITHIN_REACH * evidence_needed(current, base)
    options += _linear_options(lines, current, chains, mode, least)
    best = min(options, key=lambda option: option.fitted.score, default=None)
    if best is not None and best.fitted.score > current.score - LEAST_EVIDENCE:
        best = None
    left = leftover((best.fitted if best else current).explanation, lines)
    first = best is None and not current.explanation.causes
    # modes are many-sided: a joint that drifts or rubs is imitated by a few of them
    imitated = best is not None and best.name == "missing_mode"
    if first or imitated or (left.share > NOISE_LIKE and left.power > 3 * SMALL * before.power):
        joint_options, joint_weighed = _joints(lines, current, base, linear_floor(current, lines), causes)
        weighed += joint_weighed
        options += joint_options
    for option in options:
        weighed.append(Candidate(option.name, current.score - option.fitted.score, "fitted", option.location))
    return options, weighed


def _linear_options(
    lines: list[WindowedLines], current: Fit, chains: list[ScreenedChain], mode: SightedMode, least: float
) -> list[Option]:
    """Fit the linear causes that promise most: of the chain, and a further mode."""
    options = []
    cost = float(np.log(2 * sum(one.measured.size for one in lines)))
    largest = max([one.gain for one in chains] + [mode.gain, 0.0])
    for place, one in enumerate(chains[:MOST_CHAINS]):
        if one.gain > max(least, one.cause.size * cost, 0.03 * largest):
            again = with_chain if place == 0 else _fit_with
            fitted = again(lines, current, one.cause)
            options.append(Option(answer_name(one.cause.physics), _place(one.cause), fitted))
    numbers = current.explanation.shape.per_mode - 2
    if not current.explanation.causes and mode.gain > max(least, numbers * cost, 0.03 * largest):
        shape = current.explanation.shape.with_mode(mode.pole, mode.right, mode.left)
        start = Explanation(shape, np.concatenate([current.explanation.u, np.zeros(shape.per_mode)]))
        fitted = fit(lines, start, current.noises, iterations=12)
        if _is_resolved(fitted, lines):
            options.append(Option("missing_mode", {}, fitted))
    return options


def _fit_with(lines: list[WindowedLines], current: Fit, cause: Cause) -> Fit:
    return fit(lines, _added(current.explanation, cause), current.noises)


def _is_resolved(fitted: Fit, lines: list[WindowedLines]) -> bool:
    """Whether the added mode is wider than the lines of a record: else it is a tone, or an accident of some lines."""
    pole = fitted.explanation.model.poles[-1]
    width = -float(pole.real) / np.pi
    return width > RESOLVED * max(one.trial.rate / len(one.window) for one in lines)


def _joints(
    lines: list[WindowedLines], current: Fit, base: Fit, floor: Floor, causes: dict[str, Physics]
) -> tuple[list[Option], list[Candidate]]:
    """Joint laws along the likeliest direction: driven by the seen motion first, the best then simulated freely."""
    laws = [p for p in causes.values() if isinstance(p, JointPhysics)]
    laws = [
        p for p in laws if answer_name(p) not in {answer_name(cause.physics) for cause in current.explanation.causes}
    ]
    sighting = find_direction(floor, current.explanation)
    # along a single axis there is no direction to stand out, and a broad force looks like a higher floor
    if not laws or (len(sighting.direction) > 1 and sighting.gain < 50 * len(lines)):
        return [], []
    location = {"direction": [round(float(x), 6) for x in sighting.direction]}
    screened = screen_joints(floor, current.explanation, sighting.direction, laws)
    weighed = [Candidate(answer_name(one.causes[0].physics), one.gain, "screened", location) for one in screened]
    least = max(60.0, WITHIN_REACH * evidence_needed(current, base))
    promising = [one for one in screened if one.gain > max(least, PROMISING * screened[0].gain)][:MOST_LAWS]
    driven = []
    for one in promising:
        starts = [
            fit(lines, _added(current.explanation, cause), current.noises, iterations=2) for cause in one.causes[:2]
        ]
        best = min(starts, key=lambda start: start.score)
        driven.append(fit(lines, best.explanation, best.noises, iterations=4))
    driven.sort(key=lambda one: one.score)
    options = []
    for k, near in enumerate(driven):
        gain = current.score - near.score
        if k > 1 or gain < max(LEAST_EVIDENCE / 2, 0.6 * (current.score - driven[0].score)):
            continue
        last = near.explanation.causes[-1]
        free = replace(near.explanation, causes=(*near.explanation.causes[:-1], replace(last, seen=None)))
        fitted = fit(lines, free, near.noises, iterations=10)
        options.append(Option(answer_name(last.physics), _place(fitted.explanation.causes[-1]), fitted))
    return options, weighed


def _added(explanation: Explanation, cause: Cause) -> Explanation:
    return replace(explanation, causes=(*explanation.causes, cause))


def _place(cause: Cause) -> dict[str, Any]:
    if cause.direction is not None:
        direction = cause.direction * np.sign(cause.direction[np.argmax(np.abs(cause.direction))])
        return {"direction": [round(float(x), 6) for x in direction]}
    kind, _, label = cause.place.partition(" ")
    return {"channel": label, "role": kind} if kind in ("response", "force") else {}
