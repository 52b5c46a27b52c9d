"""Whether a refinement holds on lines that it has not seen."""

import numpy as np

from .elimination import Elimination, Modes, eliminate, predicted
from .refinement import refine
from .whitened_lines import MeasuredLines

_EVERY = 4  # each fourth line is held out
_STEPS, _TOLERANCE = 10, 1e-4


def holds_on_held_out_lines(start: Modes, refined: Modes, lines: MeasuredLines) -> bool:
    """Decide whether refined modes predict held-out lines better than the start does.

    Every fourth line is left out. Both sets of modes get their linear part, and the refined ones a further refinement,
    from the lines that stay.

    Parameters
    ----------
    start, refined
        Modes before and after the refinement.
    lines
        All lines of the fit, of which some are held out.
    """
    left_out = np.arange(len(lines.s)) % _EVERY == _EVERY // 2
    seen, unseen = lines.part(~left_out), lines.part(left_out)
    if len(unseen.s) < 2 or not len(start.poles):
        return True
    again = refine(refined, seen, steps=_STEPS, tolerance=_TOLERANCE)
    before, after = eliminate(start, seen), again.elimination
    return prediction_error(again.modes, after, unseen) <= prediction_error(start, before, unseen)


def prediction_error(modes: Modes, found: Elimination, lines: MeasuredLines) -> float:
    """Squared error on lines that the linear part was not fitted to."""
    return float(np.sum(np.abs(lines.values - predicted(modes, found, lines)) ** 2))
