"""Where a fit comes to rest: evidence counts from there."""

from dataclasses import replace

from .fitting import Fit, fit
from .reporting_numbers import modal_deviation
from .windowed_lines import WindowedLines

ITERATIONS = 60


def settled(lines: list[WindowedLines], fitted: Fit) -> Fit:
    """Fit until it rests; if the lab's model then looks odd, once more from that model, and the better of both.

    A cause of changed stiffness and the modes it changes run along one long valley: a search that began beside it may
    stop where modes carry what the cause should. A next cause must not live on what this one left undone.

    Parameters
    ----------
    lines
        Recordings.
    fitted
        From a few steps.
    """
    rested = fit(lines, fitted.explanation, fitted.noises, iterations=ITERATIONS)
    if modal_deviation(rested) is None or not rested.explanation.causes:
        return rested
    believed = rested.explanation.u.copy()
    shape = rested.explanation.shape
    believed[: shape.per_mode * (len(shape.nominal.poles) - shape.added)] = 0.0
    again = fit(lines, replace(rested.explanation, u=believed), rested.noises, iterations=ITERATIONS)
    return min(rested, again, key=lambda one: one.score)
