"""A robot's diagnosis in words: the lines that the terminal and the head of the report show."""

import numpy as np

from millfrf.mismatch import (
    ROBOT,
    AcceptedCause,
    Candidate,
    CompanionNumber,
    RobotDiagnosis,
    companions_of,
    number_of,
    standard_error_of,
)

from ...tables import evidence_in_words, with_error

UNITS = {"rad": ("deg", 180 / np.pi), "m/N": ("µm/N", 1e6), "m": ("m", 1.0)}
"""How numbers are told to a reader: unit and factor from SI."""

SENTENCES = {
    "none": "the robot's model agrees with the recordings as well as such a model can: nothing to change",
    "unexplained": (
        "the robot's model is wrong in a way that none of the changes explains, and so nothing is told of a cause"
    ),
    "class": "one of several changes explains the recordings; they cannot say which",
    "partly explained": (
        "changes lower the error on recordings left out, but leave more than an explanation may, or raise it on one of "
        "them: something else is wrong too, and the numbers may stand in for it"
    ),
}


def summary(found: RobotDiagnosis) -> list[str]:
    """A few lines for the terminal and the head of the report."""
    lines = [f"verdict: {found.verdict}", _sentence(found)]
    for cause in found.physics:
        lines += [describe(cause), *_beside(cause)]
    if found.equivalents:
        lines.append(f"cannot be told from: {', '.join(found.equivalents)}; record in another posture")
    if found.physics or found.verdict == "unexplained":
        lines.append(what_is_left(found))
    for one in found.held_out:
        changed = f"{100 * one.after:.3g} % changed, " if found.physics else ""
        lines.append(
            f"error on {one.name}, held out: {100 * one.before:.3g} % as modelled, {changed}"
            f"{100 * one.floor:.3g} % with modes fitted freely"
        )
    if found.physics:
        lines.append(f"that the change does not lower the error held out has p = {found.improvement.p_value:.1g}")
    else:
        lines += [f"{one.name} was fitted, but {refusal(one)}" for one in found.candidates if refusal(one)]
    return lines


def what_is_left(found: RobotDiagnosis) -> str:
    """State what is left, beside what may be left for `explained`."""
    limits, share = ROBOT.verdict, found.after.size / max(found.before.size, 1e-300)
    return (
        f"left: {100 * share:.2g} % of what the model leaves beyond noise, {found.after.share:.2g} times what a right "
        f"model's modes are off; explained: at most {100 * (1 - limits.explained):.0f} % or {limits.noise_like:g} times"
    )


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


def describe(cause: AcceptedCause) -> str:
    """One cause with its number, in a user's units."""
    number, unit = told_number(cause)
    what = f"times {number}" if not unit else f"{number} {unit}"
    lighter = " (lighter than modelled)" if cause.location["kind"] == "payload" and number_of(cause) < 0 else ""
    return f"{cause.name}: {what}{lighter}; {evidence_in_words(cause.evidence)}"


def told_number(cause: AcceptedCause | Candidate) -> tuple[str, str]:
    """The number with its error, and its unit, in a user's units."""
    unit, factor = UNITS.get(cause.location["unit"], (cause.location["unit"], 1.0))
    signed = cause.location["kind"] in ("posture", "payload")
    text = with_error(factor * number_of(cause), factor * standard_error_of(cause), sign=signed)
    return text, unit


def _beside(cause: AcceptedCause) -> list[str]:
    """Companions that the recordings tell; a sentence on a place that they do not tell."""
    lines = [f"  {cause.name}, {_companion(one)}" for one in companions_of(cause) if one.told]
    hidden = [one.name.removesuffix(" from the tip") for one in companions_of(cause) if not one.told]
    if hidden and cause.location["kind"] == "payload":
        lines.append(
            f"  {cause.name}: mass and {', '.join(hidden)} cannot be told apart by these recordings; "
            "the error of the mass holds this; --payload-at X Y Z states the place"
        )
    return lines


def _companion(one: CompanionNumber) -> str:
    unit, factor = UNITS.get(one.unit, (one.unit, 1.0))
    return f"{one.name}: {with_error(factor * one.number, factor * one.standard_error)} {unit}"


def _sentence(found: RobotDiagnosis) -> str:
    if found.verdict != "explained":
        return SENTENCES[found.verdict]
    return (
        "one change explains the recordings and stands alone" if len(found.physics) == 1 else "two changes together do"
    )
