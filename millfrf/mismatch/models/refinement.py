"""Final fits: other starting points, and least squares without inferred noise."""

from dataclasses import replace

import numpy as np

from estimation import WindowedSpectrum

from ..noise.noise_model import flat_noise
from ..physics.protocol import ChainPhysics
from .fitting import Fit, fit, modes_are_odd
from .hypothesis import Hypothesis
from .misfit import shares_left

PLAIN_FITS_EXACT = 0.01
"""Error, over the response, that a plain fit takes every line to have."""


def plain_fit(
    lines: list[WindowedSpectrum], start: Hypothesis, *, iterations: int, exact: float = PLAIN_FITS_EXACT
) -> Fit:
    """Fit by unweighted least squares: every line counts alike, at whatever frequency and level.

    No noise is inferred. Each response is scaled by its power over all recordings, and the lab's belief hardly counts.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    start
        Hypothesis that the fit begins with.
    iterations
        Number of steps at most.
    exact
        Error, over the response, that every line is taken to have: the larger it is, the more the lab's belief counts.
    """
    power = np.mean([np.mean(np.abs(one.measured) ** 2, axis=0) for one in lines], axis=0)
    noises = tuple(flat_noise(one.frequencies, exact**2 * power, one.force_here.shape[1]) for one in lines)
    return fit(lines, start, noises, iterations=iterations, held=True)


def even_fit(lines: list[WindowedSpectrum], fitted: Fit, *, iterations: int, exact: float = PLAIN_FITS_EXACT) -> Fit:
    """Fit by least squares on shares of the response: a weak recording counts as much as a loud one.

    ``sum_k sum |r_k|^2 / P_k`` is minimised, with the power P_k of each response in recording k. Where no law has the
    true form, no noise describes what is left: a likelihood then follows the lines it takes for quiet, and plain least
    squares follow the loudest recording. The noise of the answer is estimated at its end.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    fitted
        A fit under inferred noise, with which this one begins; it may know of no noise.
    iterations
        Number of steps at most.
    exact
        Error, over the response, that every line is taken to have: the larger it is, the more the lab's belief counts.

    Returns
    -------
    Fit
        Its score is that of the likelihood, as for :func:`fit`; infinite where it runs away.
    """
    noises = tuple(
        flat_noise(one.frequencies, exact**2 * np.mean(np.abs(one.measured) ** 2, axis=0), one.force_here.shape[1])
        for one in lines
    )
    even = fit(lines, fitted.hypothesis, noises, iterations=iterations, held=True)
    return fit(lines, even.hypothesis, fitted.noises or None, iterations=0) if np.isfinite(even.score) else even


ITERATIONS, FROM_BELIEF, FROM_PLAIN = 60, 60, 20

TOLERANCE, AT_REST = 3.0, 5e-4
"""Gain of a step from which a fit has come to rest, and as a share of what its causes have gained."""

REFINEMENT_EXACT = 0.03
"""Error, over the response, that a plain fit takes every line to have: where a fit that gave up a recording begins."""

FAR_WORSE = 2.0
"""Share left of one recording over that of another from which the fit has given the first up."""


def gain_at_rest(gained: float) -> float:
    """Gain of a step, in score, from which a fit has come to rest.

    Parameters
    ----------
    gained
        What the causes of the fit have gained in score.

    Examples
    --------
    >>> gain_at_rest(100.0), gain_at_rest(50_000.0)
    (3.0, 25.0)
    """
    return max(TOLERANCE, AT_REST * gained)


def settled(lines: list[WindowedSpectrum], fitted: Fit, gained: float = 0.0) -> Fit:
    """Fit until it rests; if the modes then look odd, fit again from the lab's model and keep the better of both.

    A cause of changed stiffness and the modes it changes run along one long valley: a search that began beside it may
    stop where modes carry what the cause should. A next cause must not live on what this one left undone.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    fitted
        A fit of a few steps, from which the search goes on.
    gained
        What its causes have gained in score.
    """
    least = gain_at_rest(gained)
    rested = fit(lines, fitted.hypothesis, fitted.noises, iterations=ITERATIONS, tolerance=least)
    if not modes_are_odd(rested) or not rested.hypothesis.has_added_physics:
        return rested
    again = fit(lines, believed(rested.hypothesis), rested.noises, iterations=ITERATIONS, tolerance=least)
    return min(rested, again, key=lambda one: one.score)


def gives_one_up(lines: list[WindowedSpectrum], hypothesis: Hypothesis, most: float) -> bool:
    """Whether a hypothesis leaves much of one recording and far less of another: the first draws its fit no more.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    hypothesis
        What predicts them.
    most
        Root mean square that may be left of a recording, over its response.
    """
    left = [float(np.sqrt(np.mean(shares_left(hypothesis, one)))) for one in lines]
    return max(left) > max(most, FAR_WORSE * min(left))


def following_all(lines: list[WindowedSpectrum], fitted: Fit, most: float) -> Fit:
    """The fit; where it leaves much of one recording, the better of this and of one begun by plain least squares.

    Noise is inferred from what a fit leaves. A recording that a law cannot follow yet counts as noise, so that it
    draws the fit no more, however well the law would follow it with other numbers. Plain least squares counts all
    recordings whatever is left of them.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    fitted
        A fit of a few steps.
    most
        Root mean square that may be left of a recording, over its response.
    """
    if not np.isfinite(fitted.score) or not gives_one_up(lines, fitted.hypothesis, most):
        return fitted
    plain = plain_fit(lines, fitted.hypothesis, iterations=FROM_PLAIN, exact=REFINEMENT_EXACT)
    again = fit(lines, plain.hypothesis, iterations=FROM_PLAIN)
    return min(fitted, again, key=lambda one: one.score)


def with_chain_from_belief(lines: list[WindowedSpectrum], fitted: Fit) -> Fit:
    """The fit whose last cause is a linear one, or a better one from the lab's model, where the cause is absent yet.

    Modes that have taken up all that a cause does leave it nothing to begin with.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    fitted
        A fit with the cause, from where the modes were.
    """
    *others, cause = fitted.hypothesis.causes
    assert isinstance(cause.physics, ChainPhysics)
    absent = replace(cause, values=cause.physics.start(fitted.hypothesis.shape.nominal))
    fresh = believed(replace(fitted.hypothesis, causes=(*others, absent)))
    again = fit(lines, fresh, iterations=FROM_BELIEF)
    return min(fitted, again, key=lambda one: one.score)


def believed(hypothesis: Hypothesis) -> Hypothesis:
    """The same causes and added modes on the lab's own model."""
    shape, u = hypothesis.shape, hypothesis.u.copy()
    u[: shape.per_mode * shape.believed] = 0.0
    return replace(hypothesis, u=u)
