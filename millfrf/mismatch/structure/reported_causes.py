"""Fitted coordinates told as causes: parameters with standard errors, in the units of files."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from millfrf.core import Real, listed

from ..inference.diagnosis import AcceptedCause
from ..inference.search import Proposal
from ..models.fitting import Fit, modes_are_odd, oddity_of_modes
from ..models.hypothesis import Cause, held_values, location_of
from ..models.model_terms import spread_with_scale
from ..physics.protocol import ModePhysics, answer_name
from ..physics.structural import MODAL_PARAMETERS

CLEAR = 2.0
"""Errors by which the damping of a further mode must differ from none. Of 22 that were there in cases of two trials and
in harder practice cases, the least differed by 8; of one that was not, by 0.8."""


def accepted_cause(fitted: Fit, location: Mapping[str, Any], evidence: float, place: int = -1) -> AcceptedCause:
    """One cause of a fit, the last if not told, with its numbers and their standard errors (to first order)."""
    causes = fitted.hypothesis.causes
    cause, place = causes[place], place % len(causes)
    covariance = spread_with_scale(fitted, place)
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    parameters, errors = {}, {}
    # beyond a limit that the motion sets a number changes nothing, and its error says so
    for parameter, value, error in zip(cause.physics.parameters, held_values(cause), spread, strict=False):
        parameters[parameter.name] = float(value)
        errors[parameter.name] = float(error * parameter.unit_step * (abs(value) if parameter.logarithmic else 1.0))
    derived, their_errors = _derived(cause, covariance)
    parameters, errors = parameters | derived, errors | their_errors
    return AcceptedCause(answer_name(cause.physics), dict(location), parameters, errors, evidence)


def told_causes(fitted: Fit, accepted: Sequence[Proposal[Fit]]) -> list[AcceptedCause]:
    """Accepted causes with the numbers, errors and directions of the final fit, which is that of the improved model.

    Parameters
    ----------
    fitted
        The fit with all accepted causes.
    accepted
        Accepted causes in the order found, which is that of the hypothesis.
    """
    told: list[AcceptedCause] = []
    believed, added = fitted.hypothesis.shape.believed, 0
    for place, (one, cause) in enumerate(zip(accepted, fitted.hypothesis.causes, strict=True)):
        if isinstance(cause.physics, ModePhysics):
            told.append(accepted_mode(fitted, cause.physics, one.evidence, believed + added))
            added += 1
        else:
            location = dict(one.location)
            if cause.axis is not None:
                location |= location_of(cause.axis, fitted.hypothesis.model)
            told.append(accepted_cause(fitted, location, one.evidence, place))
    return told


def _derived(cause: Cause, covariance: Real) -> tuple[dict[str, float], dict[str, float]]:
    """Numbers that a laboratory knows better than those of the equation, if the physics has a ``derived``."""
    numbers: Callable[[Real], dict[str, float]] | None = getattr(cause.physics, "derived", None)
    if numbers is None:
        return {}, {}
    here, at = numbers(cause.values), cause.coordinates()
    count = len(cause.values)
    slopes: dict[str, Real] = {name: np.zeros(count) for name in here}
    for k in range(count):
        step = 1e-4 * max(1.0, abs(float(at[k])))
        aside = [numbers(cause.moved(at + sign * step * np.eye(len(at))[k]).values) for sign in (1, -1)]
        for name in here:
            slopes[name][k] = (aside[0].get(name, here[name]) - aside[1].get(name, here[name])) / (2 * step)
    return here, {name: float(np.sqrt(np.maximum(slope @ covariance @ slope, 0.0))) for name, slope in slopes.items()}


def accepted_mode(fitted: Fit, physics: ModePhysics, evidence: float, number: int) -> AcceptedCause:
    """A mode that was added to a fit: frequency, damping ratio and shape at the responses.

    Parameters
    ----------
    fitted
        The fit with the mode.
    physics
        The cause that added it.
    evidence
        Gain in score by the mode.
    number
        Which of the model's modes it is; those that the lab believes come first.
    """
    shape, model = fitted.hypothesis.shape, fitted.hypothesis.model
    first = shape.per_mode * number
    spread = np.sqrt(np.maximum(np.diag(fitted.covariance)[first : first + 2], 0.0))
    frequency, damping = float(model.natural_frequencies[number]), float(model.damping_ratios[number])
    right = np.abs(model.right[number]) / np.abs(model.right[number]).max()
    place = {"shape": dict(zip(model.responses, [round(float(x), 4) for x in right], strict=True))}
    return AcceptedCause(
        physics.name,
        place,
        {"frequency_hz": frequency, "damping_ratio": damping},
        {
            "frequency_hz": float(spread[0]) * shape.lab.frequency * frequency,
            "damping_ratio": float(spread[1]) * shape.lab.damping * damping,
        },
        evidence,
    )


def undamped_modes(fitted: Fit) -> list[int]:
    """Places of the causes whose added mode has a damping that cannot be told from none: it may be hum, or an edge.

    Parameters
    ----------
    fitted
        The final fit, with errors that hold the form of its laws.
    """
    shape = fitted.hypothesis.shape
    spread = np.sqrt(np.maximum(shape.modal_rows(np.diag(fitted.covariance)), 0.0))[shape.believed :, 1]
    places = [k for k, cause in enumerate(fitted.hypothesis.causes) if isinstance(cause.physics, ModePhysics)]
    ratios = fitted.hypothesis.model.damping_ratios[shape.believed :]
    errors = spread * shape.lab.damping * ratios
    return [k for k, ratio, error in zip(places, ratios, errors, strict=True) if ratio < CLEAR * error]


def modal_deviation(fitted: Fit) -> AcceptedCause | None:
    """The modal parameters as a cause, where the refit lies farther from the nominal model than a lab's own error.

    Parameters
    ----------
    fitted
        The final fit.
    """
    if not modes_are_odd(fitted):
        return None
    shape = fitted.hypothesis.shape
    count = shape.believed
    rows = shape.modal_rows(fitted.hypothesis.u)[:count]
    spread = np.sqrt(shape.modal_rows(np.diag(fitted.covariance)))[:count]
    model, nominal = fitted.hypothesis.model, shape.nominal
    modes = [k for k in range(count) if np.sum(rows[k] ** 2) > shape.per_mode + 3 * np.sqrt(2 * shape.per_mode)]
    parameters, errors = {}, {}
    for k in range(count):
        parameters[f"frequency_{k + 1}_hz"] = float(model.natural_frequencies[k])
        errors[f"frequency_{k + 1}_hz"] = float(spread[k, 0] * shape.lab.frequency * nominal.natural_frequencies[k])
        parameters[f"damping_ratio_{k + 1}"] = float(model.damping_ratios[k])
        errors[f"damping_ratio_{k + 1}"] = float(spread[k, 1] * shape.lab.damping * nominal.damping_ratios[k])
    place = {"modes": [k + 1 for k in modes]}
    return AcceptedCause(MODAL_PARAMETERS.name, place, parameters, errors, oddity_of_modes(fitted))


def unknown_scales(causes: Sequence[AcceptedCause]) -> tuple[str, ...]:
    """A word about numbers of joints inside, whose own deflection no channel shows.

    ``x' = x / a`` with ``g' = a g`` is the same joint: each mode's part is as much smaller, and all motions are alike.
    It is counted in the tip's motion, by convention (:func:`millfrf.mismatch.models.model_terms.counted_at_tip`).

    Parameters
    ----------
    causes
        Causes that are told.

    Examples
    --------
    >>> unknown_scales([AcceptedCause("gain_error", {"channel": "TCP:+X"}, {}, {}, 30.0)])
    ()
    """
    names = [one.name for one in causes if "participation" in one.location]
    if not names:
        return ()
    return (
        f"No channel shows the deflection of the joint inside ({listed(names)}): it is counted in the tip's motion, "
        "and lengths a times as large with forces a times as small fit as well",
    )
