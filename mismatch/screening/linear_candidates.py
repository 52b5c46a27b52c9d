"""Linear causes of one round: those of the measuring chain that promise most, and a further mode, fitted."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from estimation import WindowedSpectrum

from ..adapters.structure.acceptance import Option
from ..adapters.structure.settling import with_chain
from ..inference.process_pool import side_by_side
from ..models.fitting import Fit, fit
from ..models.hypothesis import Cause, Explanation
from ..physics import FormedPhysics, answer_name
from .chain_screening import ScreenedChain
from .missing_mode import SightedMode

MOST_CHAINS = 3
"""Linear causes that are fitted in a round."""

PROMISING = 0.03
"""Screened gain, as a share of the best linear cause's, from which one is fitted."""

RESOLVED = 2.0
"""Least half-power bandwidth of an added mode, in spacings of lines."""


def linear_options(
    lines: list[WindowedSpectrum], current: Fit, chains: list[ScreenedChain], mode: SightedMode, least: float
) -> list[Option]:
    """Fit the linear causes that promise most.

    Parameters
    ----------
    lines
        Recordings.
    current
        Without them.
    chains
        Screened, best first.
    mode
        That would explain most.
    least
        Screened gain from which anything is fitted.
    """
    cost = float(np.log(2 * sum(one.measured.size for one in lines)))
    largest = max([one.gain for one in chains] + [mode.gain, 0.0])
    tasks: list[Callable[[], Option | None]] = []
    for one in chains[:MOST_CHAINS]:
        if one.gain > max(least, one.cause.size * cost, PROMISING * largest):
            tasks.append(partial(_chain_option, lines, current, one.cause))
    numbers = current.explanation.shape.per_mode - 2
    if not current.explanation.causes and mode.gain > max(least, numbers * cost, PROMISING * largest):
        tasks.append(partial(_mode_option, lines, current, mode))
    return [option for option in side_by_side(tasks) if option is not None]


def _chain_option(lines: list[WindowedSpectrum], current: Fit, cause: Cause) -> Option:
    return Option(answer_name(cause.physics), channel_of(cause), with_chain(lines, current, cause))


def _mode_option(lines: list[WindowedSpectrum], current: Fit, mode: SightedMode) -> Option | None:
    before, u = current.explanation.shape, current.explanation.u
    shape = before.with_mode(mode.pole, mode.right, mode.left)
    own, outside = u[: before.modal_size], u[before.modal_size :]
    start = Explanation(shape, np.concatenate([own, np.zeros(shape.per_mode), outside]))
    fitted = fit(lines, start, current.noises, iterations=12)
    return Option("missing_mode", {}, fitted) if _is_resolved(fitted, lines) else None


def _is_resolved(fitted: Fit, lines: list[WindowedSpectrum]) -> bool:
    """Whether the added mode is wider than the lines of a record: else it is a tone, or an accident of some lines."""
    pole = fitted.explanation.model.poles[-1]
    width = -float(pole.real) / np.pi
    return width > RESOLVED * max(one.recording.rate / len(one.window) for one in lines)


def channel_of(cause: Cause) -> dict[str, Any]:
    """Location of a linear cause, as a diagnosis states it."""
    if isinstance(cause.physics, FormedPhysics):
        return {"form": cause.place or "one stage"}
    kind, _, label = cause.place.partition(" ")
    return {"channel": label, "role": kind} if kind in ("response", "force") else {}
