"""When a fitted cause is worth accepting, and when so much is left that none is named."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation import WindowedSpectrum

from ...models.fitting import Fit, fit
from ...models.hypothesis import Cause, Explanation
from ...physics import ChainPhysics, LimitedPhysics
from ...remainder.leftover import Leftover

Real = NDArray[np.float64]

LEAST_EVIDENCE = 20.0
"""Gain in score below which nothing is accepted: odds of some twenty thousand to one."""

NOISE_LIKE = 0.05
"""Share of a residual that may seem to move with the signal by chance, hum or force noise."""

EXPLAINED = 0.95
"""Share of what moved with the signal that causes must have taken away, if what is left is not noise-like."""

HELD_OUT = 10.0
"""Gain in misfit on a held-out recording below which a cause that mends the residual is let go again."""

CLEAR = 4.0
"""Standard errors by which a cause's number must differ from none."""

SMALL = 0.01
"""Evidence of a further cause, as a share of what the first ones had, below which it may mend the form of their law."""

AFTER_A_LAW = 0.1
"""The same once a joint's law was accepted, whose form is never quite the true one."""

UNCLEAR = 5.0
"""Times the evidence that a linear cause needs whose number does not stand out of its error."""

TO_REST = 60
"""Iterations at most for modes to make up for a cause that is taken away."""


@dataclass(frozen=True)
class Option:
    """A fitted candidate."""

    name: str
    location: dict[str, Any]
    fitted: Fit


def gains(option: Option, current: Fit) -> bool:
    """Whether an option has the least evidence that counts."""
    return option.fitted.score <= current.score - LEAST_EVIDENCE


def impossible(option: Option) -> str:
    """Why the numbers of an option's last cause cannot be, beyond their errors; empty where they can."""
    causes = option.fitted.explanation.causes
    if option.name == "missing_mode" or not causes:
        return ""
    cause = causes[-1]
    said: Callable[[Real, Real], str] | None = getattr(cause.physics, "impossible", None)
    if said is None:
        return ""
    first = option.fitted.explanation.size - cause.size
    spread = np.sqrt(np.maximum(np.diag(option.fitted.covariance)[first : first + len(cause.values)], 0.0))
    steps = np.array([parameter.unit_step for parameter in cause.physics.parameters])
    return said(cause.values, CLEAR * spread * steps)


def plainest(options: list[Option]) -> Option | None:
    """The option with the best score, or the form of the same cause that is as good with fewer numbers."""
    best = min(options, key=lambda option: option.fitted.score, default=None)
    if best is None:
        return None
    line = best.fitted.score + LEAST_EVIDENCE / 2
    forms = [option for option in options if option.name == best.name and option.fitted.score < line]
    return min(forms, key=lambda option: (option.fitted.explanation.size, option.fitted.score))


def unexplained(explanation: Explanation, left: Leftover, before: Leftover) -> bool:
    """Whether too much still moves with the signal for the causes found, if any.

    A law that had to be held within what its name means may leave nothing: it is another law.
    """
    if left.share <= NOISE_LIKE:
        return False
    return left.power > (1 - EXPLAINED) * before.power or any(_strained(cause) for cause in explanation.causes)


def _strained(cause: Cause) -> bool:
    """Whether the data ask of a law what its name excludes."""
    limited = cause.physics
    return (
        isinstance(limited, LimitedPhysics)
        and cause.motion is not None
        and limited.strained(cause.values, cause.motion)
    )


def evidence_needed(current: Fit, base: Fit) -> float:
    """Gain in score that a further cause needs: a small one may only mend the form of those found.

    Parameters
    ----------
    current
        With the causes found so far.
    base
        Without any.
    """
    a_law = any(cause.direction is not None for cause in current.explanation.causes)
    share = AFTER_A_LAW if a_law else SMALL
    return max(LEAST_EVIDENCE, share * (base.score - current.score))


def worth_it(option: Option, current: Fit, base: Fit, lines: list[WindowedSpectrum]) -> bool:
    """Enough evidence; and if it lies in the lab's belief alone, most of what the belief found odd.

    It must then be more likely, too, than that the lab was wrong in nothing but all dampings, or all frequencies.
    """
    gain = current.score - option.fitted.score
    needed = evidence_needed(current, base)
    if option.name == "missing_mode":
        needed, clear = needed + _places_of_a_mode(option.fitted, lines), _mode_measured(option.fitted)
    else:
        clear = _measured(option.fitted)
        needed *= 1.0 if clear else UNCLEAR
    if gain < needed or not (clear or _is_missed(option, lines, needed)):
        return False
    if current.misfit - option.fitted.misfit > LEAST_EVIDENCE:
        return True
    size = current.explanation.shape.size
    odd = max(current.deviation - size, 1.0)
    if current.deviation - option.fitted.deviation <= 0.6 * odd:
        return False
    return gain > _plainer_gain(current, lines)


def _plainer_gain(current: Fit, lines: list[WindowedSpectrum]) -> float:
    """What the score would gain if nothing were believed of the dampings, or of the frequencies."""
    shape = current.explanation.shape
    rows = shape.modal_rows(current.explanation.u)[: len(shape.nominal.poles) - shape.added]
    cost = float(np.log(2 * sum(one.measured.size for one in lines)))
    return max(float(np.sum(rows[:, k] ** 2 - cost)) for k in (0, 1))


def _places_of_a_mode(fitted: Fit, lines: list[WindowedSpectrum]) -> float:
    """Evidence that chance finds for the mode added last among all the places where one as narrow might lie."""
    pole = fitted.explanation.model.poles[-1]
    band = max(one.frequencies[-1] for one in lines) - min(one.frequencies[0] for one in lines)
    return 2 * float(np.log(max(band / (-float(pole.real) / np.pi), 1.0)))


def _is_missed(option: Option, lines: list[WindowedSpectrum], needed: float) -> bool:
    """Whether modes, from where they are with a cause of the measuring chain, cannot make up for it.

    A delay is taken up by real modes to first order: its number has a wide error, and still it is not none.
    """
    fitted, explanation = option.fitted, option.fitted.explanation
    if option.name == "missing_mode" or not isinstance(explanation.causes[-1].physics, ChainPhysics):
        return False
    without = replace(explanation, causes=explanation.causes[:-1])
    return fit(lines, without, fitted.noises, iterations=TO_REST).score - fitted.score > needed


def _mode_measured(fitted: Fit) -> bool:
    """Whether the damping of the mode added last stands out of its error: else no resonance was seen."""
    shape = fitted.explanation.shape
    place = shape.per_mode * (len(shape.nominal.poles) - 1) + 1
    return float(np.sqrt(np.maximum(fitted.covariance[place, place], 0.0))) * shape.lab.damping < 1 / CLEAR


def _measured(fitted: Fit) -> bool:
    """Whether any number of the last cause stands out of its own error: else the gain came from elsewhere."""
    cause = fitted.explanation.causes[-1]
    first = fitted.explanation.size - cause.size
    spread = np.sqrt(np.maximum(np.diag(fitted.covariance)[first : first + len(cause.values)], 0.0))
    absent = cause.physics.start(fitted.explanation.shape.nominal) if isinstance(cause.physics, ChainPhysics) else None
    clear = []
    for k, (parameter, error) in enumerate(zip(cause.physics.parameters, spread, strict=True)):
        if parameter.logarithmic:
            clear.append(error * parameter.unit_step < 1 / CLEAR)
        else:
            zero = 0.0 if absent is None else float(absent[k])
            clear.append(abs(float(cause.values[k]) - zero) > CLEAR * error * parameter.unit_step)
    return any(clear) if isinstance(cause.physics, ChainPhysics) else clear[0]
