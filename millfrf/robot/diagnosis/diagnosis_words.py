"""A robot's diagnosis in words: the lines that the terminal and the head of the report show."""

import numpy as np

from mismatch.adapters.robot import EXPLAINED, NOISE_LIKE, SIGNIFICANT, Beside, RobotCause, RobotDiagnosis

from ...tables import with_error

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
    for cause in found.causes:
        lines += [describe(cause), *_beside(cause)]
    if found.equivalents:
        lines.append(f"cannot be told from: {', '.join(found.equivalents)}; record in another posture")
    if found.causes or found.verdict == "unexplained":
        lines.append(what_is_left(found))
    for one in found.held_out:
        changed = f"{100 * one.after:.3g} % changed, " if found.causes else ""
        lines.append(
            f"error on {one.name}, held out: {100 * one.before:.3g} % as modelled, {changed}"
            f"{100 * one.free:.3g} % with modes fitted freely"
        )
    if found.causes:
        lines.append(f"that the change does not lower the error held out has p = {found.p_value:.1g}")
    else:
        lines += [f"{one.name} was fitted, but {one.stage}" for one in found.candidates if one.stage]
    return lines


def what_is_left(found: RobotDiagnosis) -> str:
    """State what is left, beside what may be left for `explained`."""
    share = found.excess_after / max(found.excess_before, 1e-300)
    return (
        f"left: {100 * share:.2g} % of what the model leaves beyond noise, {found.excess_after:.2g} times what a right "
        f"model's modes are off; explained: at most {100 * (1 - EXPLAINED):.0f} % or {NOISE_LIKE:g} times"
    )


def what_is_asked() -> str:
    """State the conditions under which a change is told."""
    return (
        f"A change is told if it lowers the error on recordings left out of the fit with p < {SIGNIFICANT:g}. Its ± is "
        "one standard error: root of the sum of squares of the fit's own, of the spread between fits that leave one "
        "recording out, and of the largest shift with another change free beside it."
    )


def describe(cause: RobotCause) -> str:
    """One cause with its number, in a user's units."""
    number, unit = told_number(cause)
    what = f"times {number}" if not unit else f"{number} {unit}"
    lighter = " (lighter than modelled)" if cause.kind == "payload" and cause.number < 0 else ""
    return f"{cause.name}: {what}{lighter}; evidence {cause.evidence:.0f}"


def told_number(cause: RobotCause) -> tuple[str, str]:
    """The number with its error, and its unit, in a user's units."""
    unit, factor = UNITS.get(cause.unit, (cause.unit, 1.0))
    text = with_error(factor * cause.number, factor * cause.standard_error, sign=cause.kind in ("posture", "payload"))
    return text, unit


def _beside(cause: RobotCause) -> list[str]:
    """Companions that the recordings tell; a sentence on a place that they do not tell."""
    lines = [f"  {cause.name}, {_companion(one)}" for one in cause.beside if one.told]
    hidden = [one.name.removesuffix(" from the tip") for one in cause.beside if not one.told]
    if hidden and cause.kind == "payload":
        lines.append(
            f"  {cause.name}: mass and {', '.join(hidden)} cannot be told apart by these recordings; "
            "the error of the mass holds this; --payload-at X Y Z states the place"
        )
    return lines


def _companion(one: Beside) -> str:
    unit, factor = UNITS.get(one.unit, (one.unit, 1.0))
    return f"{one.name}: {with_error(factor * one.number, factor * one.standard_error)} {unit}"


def _sentence(found: RobotDiagnosis) -> str:
    if found.verdict != "explained":
        return SENTENCES[found.verdict]
    return (
        "one change explains the recordings and stands alone" if len(found.causes) == 1 else "two changes together do"
    )
