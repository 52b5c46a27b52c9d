"""Which change is chosen: ranked by evidence, confirmed on recordings held out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robot_model import Change

from .robot_fit import RobotFit
from .robot_held_out import Fold, Tested, lowers, tested
from .robot_search import FreeFit, best_starts, fit_from, numbered
from .robot_setting import Setting

LEAST_EVIDENCE = 20.0
"""Gain in score below which no change is accepted, as everywhere in :mod:`mismatch`."""

AS_GOOD = 6.0
"""Score by which another change may be worse and still not be told from the best: a likelihood ratio of 20."""

MOST_TRIED = 4
"""Changes with enough evidence, best first, that are tried on recordings held out."""

BEATEN = 0.25
"""Share of another change's error beyond noise on recordings held out, at or below which a change beats the other."""

NO_GAIN = "does not lower the error held out"
"""Stage of a change with evidence that was fitted but not confirmed."""


@dataclass(frozen=True)
class Option:
    """A further change, fitted beside those accepted; ``evidence`` is its gain in score."""

    change: Change
    fitted: RobotFit
    evidence: float


@dataclass(frozen=True)
class Choice:
    """What a round of the search ends in.

    Parameters
    ----------
    ranked
        Every option, best evidence first.
    best
        The one that is confirmed, with what it is worth on recordings held out; None where there is none.
    stages
        What became of options that have the evidence and are not chosen, by name.
    """

    ranked: tuple[Option, ...]
    best: tuple[Option, Tested] | None
    stages: dict[str, str]

    @property
    def equivalents(self) -> tuple[str, ...]:
        """Names of changes that nothing tells from the best."""
        if self.best is None:
            return ()
        chosen = self.best[0]
        near = [one for one in self.ranked if one is not chosen and one.evidence > chosen.evidence - AS_GOOD]
        return tuple(one.change.name for one in near if one.change.name not in self.stages)


def chosen(
    setting: Setting,
    current: RobotFit,
    changes: Sequence[Change],
    free: FreeFit,
    folds: Sequence[Fold],
    before: Tested,
) -> Choice:
    """Rank every further change, and choose the first that lowers the error on recordings held out.

    Another with evidence takes its place where it leaves a quarter or less of its error there: evidence alone allows
    every mode to be off a little in each posture, and so does not see that one number mends all postures. Halves of one
    recording, or recordings in one posture, do not show that: there nothing is beaten.
    """
    ranked = _ranked(setting, current, changes, free)
    first = setting.recordings[0].q
    several = any(not np.allclose(one.q, first) for one in setting.recordings)
    stages: dict[str, str] = {}
    best: tuple[Option, Tested] | None = None
    for option in [one for one in ranked if one.evidence >= LEAST_EVIDENCE][:MOST_TRIED]:
        after = tested(folds, option.fitted.changes)
        if not lowers(before, after):
            stages[option.change.name] = NO_GAIN
        elif best is None:
            best = option, after
        elif not several:
            continue
        elif after.beyond <= BEATEN * best[1].beyond:
            stages[best[0].change.name] = f"beaten by {option.change.name} on what was held out"
            best = option, after
        elif best[1].beyond <= BEATEN * after.beyond:
            stages[option.change.name] = f"beaten by {best[0].change.name} on what was held out"
    return Choice(ranked, best, stages)


def _ranked(setting: Setting, current: RobotFit, changes: Sequence[Change], free: FreeFit) -> tuple[Option, ...]:
    """Every further change fitted, best first."""
    cost = float(np.log(2 * sum(one.lines.measured.size for one in setting.recordings)))
    there = {other.name for other, _ in current.changes}
    ranked = []
    for change in changes:
        if change.name in there:
            continue
        starts = [(*current.changes, *numbered(change, change.neutral))]
        starts += [one.changes for one in best_starts(setting, current.changes, change) if np.isfinite(one.left)]
        fitted = min((fit_from(setting, start, free) for start in starts), key=lambda one: one.cost)
        price = cost + fitted.price - current.price
        ranked.append(Option(change, fitted, max(current.cost - fitted.cost, 0.0) - price))
    return tuple(sorted(ranked, key=lambda one: -one.evidence))


def pruned(setting: Setting, current: RobotFit, free: FreeFit) -> RobotFit:
    """Without the changes that those accepted later have replaced."""
    cost = float(np.log(2 * sum(one.lines.measured.size for one in setting.recordings)))
    mains = [change for change, _ in current.changes if isinstance(change, Change)]
    for change in mains[:-1]:
        own = (change, *change.companions)
        fewer = tuple(pair for pair in current.changes if pair[0] not in own)
        fitted = fit_from(setting, fewer, free)
        if fitted.cost - current.cost - cost - current.price + fitted.price < LEAST_EVIDENCE:
            current = fitted
    return current
