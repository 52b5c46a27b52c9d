"""Which causes are worth accepting: added one by one, best first, and let go of again."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..structure.acceptance import CLEAR, HELD_OUT, LEAST_EVIDENCE
from .cut_fit import CutFit
from .cut_held_out import fit_halves, held_out_gain
from .cut_setting import Attempt, CutSetting
from .cut_start import fit_turned
from .physics import CutPhysics

Real = NDArray[np.float64]


@dataclass(frozen=True)
class Round:
    """One cause fitted beside those accepted before."""

    name: str
    evidence: float
    fitted: CutFit


def search(setting: CutSetting, base: CutFit, names: Sequence[str]) -> tuple[CutFit, list[list[Round]]]:
    """Add the best cause as long as one is worth it; then let go of those that later ones have replaced."""
    current, rounds = base, []
    while True:
        rest = [name for name in names if name not in current.freed]
        ranked = sorted((_tried(setting, current, name) for name in rest), key=lambda one: -one.evidence)
        rounds.append(ranked)
        best = next((one for one in ranked if _worth_it(setting, current, one)), None)
        if best is None:
            return _pruned(setting, base, current), rounds
        current = best.fitted


def _tried(setting: CutSetting, current: CutFit, name: str) -> Round:
    fitted = fit_turned(setting, current.attempt, (*current.freed, name))
    return Round(name, current.score - fitted.score, fitted)


def _worth_it(setting: CutSetting, current: CutFit, option: Round) -> bool:
    """Evidence, a number that stands out, and a gain on blocks that were not fitted."""
    if option.evidence < LEAST_EVIDENCE or not _clear(setting, option.fitted, option.name):
        return False
    # both begin where the cause is absent: a half that says nothing of it must not know it from the whole
    here = fit_halves(setting, current.attempt, current.freed)
    there = fit_halves(setting, _renumbered(current, option), option.fitted.freed)
    return held_out_gain(here, there) > HELD_OUT


def _renumbered(current: CutFit, option: Round) -> Attempt:
    """The current numbers, with teeth counted as the option does in each recording."""
    return replace(current.attempt, laws=option.fitted.attempt.laws)


def _pruned(setting: CutSetting, base: CutFit, current: CutFit) -> CutFit:
    for name in current.freed[:-1]:
        fewer = tuple(one for one in current.freed if one != name)
        stated = cause_of(base.attempt, name).stated(setting.belief.process)
        fitted = fit_turned(setting, current.attempt.with_values(name, stated), fewer)
        if fitted.score - current.score < LEAST_EVIDENCE:
            current = fitted
    return current


def _clear(setting: CutSetting, fitted: CutFit, name: str) -> bool:
    """Whether a number of the cause differs from the stated one by four of its errors."""
    off = fitted.attempt.values(name) - cause_of(fitted.attempt, name).stated(setting.belief.process)
    return bool(np.any(np.abs(off) > CLEAR * np.sqrt(np.diag(covariance_of(setting, fitted, name)))))


def covariance_of(setting: CutSetting, fitted: CutFit, name: str) -> Real:
    """Covariance of one freed cause's numbers, SI.

    Noise and the force model's usual error: as each line is off by its share, so may all be together, and a number that
    scales with the force with them.
    """
    at, process = 6, setting.belief.process
    for freed in fitted.freed[: fitted.freed.index(name)]:
        at += len(cause_of(fitted.attempt, freed).parameters(process))
    units = np.array([parameter.unit_step for parameter in cause_of(fitted.attempt, name).parameters(process)])
    block = slice(at, at + len(units))
    own = np.diag((setting.force_error * fitted.attempt.values(name)) ** 2)
    return np.asarray(fitted.covariance[block, block] * np.outer(units, units) + own)


def cause_of(attempt: Attempt, name: str) -> CutPhysics:
    """A cause by its name."""
    return next(cause for cause, _ in attempt.acting if cause.name == name)
