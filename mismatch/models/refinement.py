"""Where a fit comes to rest: evidence counts from there."""

from dataclasses import replace

from estimation import WindowedSpectrum

from ..physics import ChainPhysics
from .fitting import Fit, fit, modes_are_odd
from .hypothesis import Cause, Hypothesis

ITERATIONS, FROM_BELIEF = 60, 20


def settled(lines: list[WindowedSpectrum], fitted: Fit) -> Fit:
    """Fit until it rests; if the modes then look odd, fit again from the lab's model and keep the better of both.

    A cause of changed stiffness and the modes it changes run along one long valley: a search that began beside it may
    stop where modes carry what the cause should. A next cause must not live on what this one left undone.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    fitted
        A fit of a few steps, from which the search goes on.
    """
    rested = fit(lines, fitted.hypothesis, fitted.noises, iterations=ITERATIONS)
    if not modes_are_odd(rested) or not rested.hypothesis.has_added_physics:
        return rested
    again = fit(lines, believed(rested.hypothesis), rested.noises, iterations=ITERATIONS)
    return min(rested, again, key=lambda one: one.score)


def with_chain(lines: list[WindowedSpectrum], current: Fit, cause: Cause) -> Fit:
    """Fit a linear cause together with the modes: from where they are and, if they look odd, from the lab's model.

    Modes that have taken up all that a cause does leave it nothing to begin with.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    current
        The fit without the cause.
    cause
        The linear cause, with numbers to begin with.
    """
    hypothesis = current.hypothesis
    fitted = fit(lines, hypothesis.with_cause(cause), current.noises)
    if not modes_are_odd(current) or not isinstance(cause.physics, ChainPhysics):
        return fitted
    absent = replace(cause, values=cause.physics.start(hypothesis.shape.nominal))
    fresh = believed(hypothesis).with_cause(absent)
    return min(fitted, fit(lines, fresh, iterations=FROM_BELIEF), key=lambda one: one.score)


def believed(hypothesis: Hypothesis) -> Hypothesis:
    """The same causes and added modes on the lab's own model."""
    shape, u = hypothesis.shape, hypothesis.u.copy()
    u[: shape.per_mode * shape.believed] = 0.0
    return replace(hypothesis, u=u)
