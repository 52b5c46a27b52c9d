"""Linear causes of one round: those of the measuring chain that promise most, and a further mode, fitted."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from estimation import WindowedSpectrum

from ..inference import Proposal, ScreeningSettings, in_processes
from ..models import Cause, Fit, believed, fit, modes_are_odd, with_chain_from_belief
from ..physics import ChainPhysics, FormedPhysics, ModePhysics, answer_name
from .chain_screening import ScreenedChain
from .missing_mode import SightedMode, find_mode
from .whitened_residual import noise_floor

MODE_STEPS = 12
"""Steps at most of the fit of a further mode."""

BEHIND, CLEAR_LEAD = 0.1, 10.0
"""Share of the best cause's gain below which another is not fitted from the lab's model, too, and gain of the best one
from which that counts, over the least gain. It comes next where the best one leaves it anything."""


def linear_candidates(
    lines: list[WindowedSpectrum],
    current: Fit,
    chains: list[ScreenedChain],
    mode: SightedMode | None,
    settings: ScreeningSettings,
    least: float,
) -> list[Proposal[Fit]]:
    """Fit the linear causes that promise most.

    Where the modes look odd and no law moves them, a further mode is also sought from the lab's own: one of them may
    have gone to where the further one is.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    current
        The fit without them.
    chains
        Linear causes at their places as they were screened, best first.
    mode
        The further mode that would explain most; None: none is looked for.
    settings
        Thresholds of what is fitted.
    least
        Screened gain from which anything is fitted.
    """
    cost = float(np.log(2 * sum(one.measured.size for one in lines)))
    promising = settings.promising_linear * max([one.gain for one in chains] + [mode.gain if mode else 0.0, 0.0])
    tasks: list[Callable[[], Proposal[Fit] | None]] = []
    for one in chains[: settings.most_linear]:
        if one.gain > max(least, one.cause.size * cost, promising):
            tasks.append(partial(_with_chain, lines, current, one.cause))
    numbers = current.hypothesis.shape.per_mode - 2
    if mode is not None and mode.gain > max(least, numbers * cost, promising):
        tasks.append(partial(_with_mode, lines, current, mode, settings.resolved))
    if mode is not None and not current.hypothesis.laws and modes_are_odd(current):
        tasks.append(partial(_with_mode_from_belief, lines, current, mode.physics, settings.resolved))
    found = [one for one in in_processes(tasks) if one is not None]
    others = [one for one in found if not _adds_mode(one)]
    modes = sorted((one for one in found if _adds_mode(one)), key=lambda one: -one.evidence)
    if modes_are_odd(current):
        others = _also_from_belief(lines, current, others, max((one.evidence for one in found), default=0.0), least)
    # of one mode from two beginnings the better counts
    return [one for one in [*others, *modes[:1]] if np.isfinite(one.evidence)]


def _also_from_belief(
    lines: list[WindowedSpectrum], current: Fit, found: list[Proposal[Fit]], most: float, least: float
) -> list[Proposal[Fit]]:
    """Causes of chains, each as it was fitted or from the lab's own model; those far behind as they were fitted.

    A fit that ends far worse than the one without the cause is lost, and says nothing of the cause.
    """
    hopeless = BEHIND * most if most > CLEAR_LEAD * least else -np.inf
    again = [k for k, one in enumerate(found) if not -least < one.evidence < hopeless]
    fitted = in_processes([partial(_from_belief, lines, current, found[k]) for k in again])
    better = dict(zip(again, fitted, strict=True))
    return [better.get(k, one) for k, one in enumerate(found)]


def _adds_mode(proposal: Proposal[Fit]) -> bool:
    return isinstance(proposal.fitted.hypothesis.causes[-1].physics, ModePhysics)


def _with_chain(lines: list[WindowedSpectrum], current: Fit, cause: Cause) -> Proposal[Fit]:
    fitted = fit(lines, current.hypothesis.with_cause(cause), current.noises)
    return Proposal(answer_name(cause.physics), channel_of(cause), fitted, current.score - fitted.score)


def _from_belief(lines: list[WindowedSpectrum], current: Fit, one: Proposal[Fit]) -> Proposal[Fit]:
    """A linear cause, or a better fit of it from the lab's own model."""
    cause = one.fitted.hypothesis.causes[-1]
    if not isinstance(cause.physics, ChainPhysics):
        return one
    fitted = with_chain_from_belief(lines, one.fitted)
    return Proposal(one.name, channel_of(fitted.hypothesis.causes[-1]), fitted, current.score - fitted.score)


def _with_mode(lines: list[WindowedSpectrum], current: Fit, mode: SightedMode, resolved: float) -> Proposal[Fit] | None:
    """The mode fitted; None where it is no wider than the lines of a record."""
    start = current.hypothesis.with_mode(mode.pole, mode.right, mode.left, mode.physics)
    fitted = fit(lines, start, current.noises, iterations=MODE_STEPS)
    spacing = max(one.recording.rate / len(one.window) for one in lines)
    if not mode.physics.resolved(complex(fitted.hypothesis.model.poles[-1]), spacing, resolved):
        return None
    return Proposal(mode.physics.name, {}, fitted, current.score - fitted.score)


def _with_mode_from_belief(
    lines: list[WindowedSpectrum], current: Fit, physics: ModePhysics, resolved: float
) -> Proposal[Fit] | None:
    """The mode that would explain most beside the lab's own modes, fitted."""
    lab = fit(lines, believed(current.hypothesis), iterations=0)
    if not np.isfinite(lab.score):
        return None
    found = _with_mode(lines, lab, find_mode(noise_floor(lab, lines), lab.hypothesis, physics), resolved)
    return None if found is None else replace(found, evidence=current.score - found.fitted.score)


def channel_of(cause: Cause) -> dict[str, Any]:
    """Location of a linear cause, as a diagnosis states it."""
    if isinstance(cause.physics, FormedPhysics):
        return {"form": cause.place or "one stage"}
    kind, _, label = cause.place.partition(" ")
    return {"channel": label, "role": kind} if kind in ("response", "force") else {}
