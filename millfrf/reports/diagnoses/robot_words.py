"""Sentences and numbers of the diagnosis of a robot."""

import numpy as np

from millfrf.mismatch import ROBOT, AcceptedCause, Candidate, number_of, standard_error_of

from ..tables import with_error

UNITS = {"rad": ("deg", 180 / np.pi), "m/N": ("µm/N", 1e6), "m": ("m", 1.0)}  # printed unit, and factor from SI


def what_is_asked() -> str:
    """State the conditions under which a change is reported."""
    return (
        "A change is reported if it lowers the error on recordings left out of the fit with "
        f"p < {ROBOT.proof.significance:g}. Its ± is one standard error: root of the sum of squares of the fit's own, "
        "of the spread between fits that leave one recording out, and of the largest shift if another change is "
        "fitted as well."
    )


def refusal(candidate: Candidate) -> str:
    """Return the reason why a change was rejected in spite of its evidence; an empty text if it was not rejected."""
    return "" if candidate.stage == "fitted" else candidate.stage


def told_number(cause: AcceptedCause | Candidate) -> tuple[str, str]:
    """Format the number of a change with its standard error in printed units; return the text and the unit."""
    unit, factor = UNITS.get(cause.location["unit"], (cause.location["unit"], 1.0))
    signed = cause.location["kind"] in ("posture", "payload")
    text = with_error(factor * number_of(cause), factor * standard_error_of(cause), sign=signed)
    return text, unit
