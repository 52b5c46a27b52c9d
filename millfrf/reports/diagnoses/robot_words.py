"""The diagnosis of a robot in words."""

from typing import TYPE_CHECKING

import numpy as np

from millfrf.mismatch import ROBOT, AcceptedCause, Candidate, number_of, standard_error_of

from ..tables import with_error

if TYPE_CHECKING:
    pass


UNITS = {"rad": ("deg", 180 / np.pi), "m/N": ("µm/N", 1e6), "m": ("m", 1.0)}
"""How numbers are told to a reader: unit and factor from SI."""


def what_is_asked() -> str:
    """State the conditions under which a change is told."""
    return (
        "A change is told if it lowers the error on recordings left out of the fit with "
        f"p < {ROBOT.proof.significance:g}. Its ± is one standard error: root of the sum of squares of the fit's own, "
        "of the spread between fits that leave one recording out, and of the largest shift with another change free "
        "beside it."
    )


def refusal(candidate: Candidate) -> str:
    """Why a change with evidence was not chosen; empty where nothing speaks against it."""
    return "" if candidate.stage == "fitted" else candidate.stage


def told_number(cause: AcceptedCause | Candidate) -> tuple[str, str]:
    """The number with its error, and its unit, in a user's units."""
    unit, factor = UNITS.get(cause.location["unit"], (cause.location["unit"], 1.0))
    signed = cause.location["kind"] in ("posture", "payload")
    text = with_error(factor * number_of(cause), factor * standard_error_of(cause), sign=signed)
    return text, unit
