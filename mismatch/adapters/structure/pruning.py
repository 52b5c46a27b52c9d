"""Causes that were found first and that later ones have made needless are let go of."""

from dataclasses import replace

import numpy as np

from estimation import WindowedSpectrum

from ...inference.diagnosis import AcceptedCause, Candidate
from ...models.fitting import Fit, fit
from ...models.hypothesis import Explanation
from ...models.model_shape import ModelShape
from ...physics import answer_name
from .acceptance import evidence_needed

ITERATIONS = 20


def pruned(
    lines: list[WindowedSpectrum], steps: list[Fit], accepted: list[AcceptedCause]
) -> tuple[list[Fit], list[AcceptedCause], list[Candidate]]:
    """Try the last explanation without each cause that came before its last; keep what is not worth its evidence out.

    What one cause leaves may look like another: a mode that imitates a joint is found before the joint is.

    Parameters
    ----------
    lines
        Recordings.
    steps
        Fits without any cause, with the first, and so on.
    accepted
        Causes, plain faults first; the last of them belong to ``steps``.

    Returns
    -------
    steps, accepted
        With fewer causes, or as they were.
    rejected
        Those let go of.
    """
    faults = len(accepted) - (len(steps) - 1)
    rejected: list[Candidate] = []
    place = len(steps) - 3
    while place >= 0 and len(steps) > 2:
        base, last, cause = steps[0], steps[-1], accepted[faults + place]
        less = fit(lines, without_cause(last.explanation, cause), last.noises, iterations=ITERATIONS)
        if less.score - last.score < evidence_needed(less, base):
            rejected.append(Candidate(cause.name, less.score - last.score, "rejected", cause.location))
            accepted = accepted[: faults + place] + accepted[faults + place + 1 :]
            steps = [*steps[: place + 1], *steps[place + 2 : -1], less]
        place -= 1
    return steps, accepted, rejected


def without_cause(explanation: Explanation, cause: AcceptedCause) -> Explanation:
    """An explanation without one of its causes."""
    if cause.name == "missing_mode":
        shape, u = without_added(explanation.shape), explanation.u
        kept_u = np.concatenate([u[: shape.modal_size], u[explanation.shape.modal_size :]])
        return replace(explanation, shape=shape, u=kept_u)
    kept = list(explanation.causes)
    kept.pop(next(k for k, one in enumerate(kept) if answer_name(one.physics) == cause.name))
    return replace(explanation, causes=tuple(kept))


def without_added(shape: ModelShape) -> ModelShape:
    """The believed modes alone."""
    count = len(shape.nominal.poles) - shape.added
    model = shape.nominal
    bare = replace(
        model, poles=model.poles[:count], right=model.right[:count], left=model.left[:count], covariance=None
    )
    return replace(shape, nominal=bare, added=0)


def zero_of(shape: ModelShape) -> Explanation:
    """The nominal model without causes."""
    bare = without_added(shape)
    return Explanation(bare, np.zeros(bare.size))
