"""Hidden beside found, as a table, with a plain judgement."""

import math
from typing import Any

import numpy as np

from replay_data.concealment.concealed_effect import FOREIGN, ConcealedEffect

from ..tables.result_tables import Table
from .concealment import ConcealResult


def found_names(diagnosis: dict[str, Any]) -> tuple[str, ...]:
    """Names of the accepted causes."""
    return tuple(cause["name"] for cause in diagnosis["physics"])


def judgement(hidden: str, diagnosis: dict[str, Any]) -> str:
    """How an answer stands to what was hidden.

    ``right``, ``right, in part`` (named, with more left than it may), ``right within a class``, ``right, and more``,
    ``abstained``, ``missed`` or ``wrong``.
    """
    names, verdict = found_names(diagnosis), diagnosis["verdict"]
    if hidden == FOREIGN:
        return "right" if verdict == "unexplained" else "missed" if verdict == "none" else "wrong"
    if hidden == "none":
        return {"none": "right", "unexplained": "abstained"}.get(verdict, "wrong")
    if verdict == "unexplained":
        return "abstained"
    if names == (hidden,):
        return "right" if verdict == "explained" else "right, in part"
    if hidden in names:
        return "right, and more"
    if verdict == "none":
        return "missed"
    return "right within a class" if hidden in diagnosis["equivalents"] else "wrong"


def direction_error(hidden: ConcealedEffect, diagnosis: dict[str, Any]) -> float | None:
    """Angle between the hidden joint and the one found, 0 to 90 deg; None where one of them has no direction."""
    for cause in diagnosis["physics"]:
        found = cause["location"].get("direction")
        if found is not None and hidden.direction is not None:
            cosine = abs(float(np.dot(found, hidden.direction))) / float(np.linalg.norm(found))
            return math.degrees(math.acos(min(1.0, cosine)))
    return None


def concealment_table(result: ConcealResult) -> Table:
    """Rows: what, where, numbers; error on held-out data; judgement."""
    hidden, diagnosis = result.hidden, result.diagnosis
    causes, gain = diagnosis["physics"], diagnosis["improvement"]
    angle = direction_error(hidden, diagnosis)
    places = "; ".join(_place(cause["location"]) for cause in causes)
    rows = [
        ("verdict", "none" if hidden.name == "none" else "explained", str(diagnosis["verdict"])),
        ("effect", hidden.name, ", ".join(found_names(diagnosis)) or "none"),
        ("where", "" if hidden.direction is None else _place({"direction": hidden.direction}), places),
        ("direction error", "", "" if angle is None else f"{angle:.1f} deg"),
        ("numbers", _numbers(hidden.parameters), "\n".join(_with_errors(cause) for cause in causes)),
        ("cannot be told from", "", ", ".join(diagnosis["equivalents"])),
        ("error held out", "", f"{100 * gain['before']:.3g} % to {100 * gain['after']:.3g} %"),
        ("noise there", "", f"{100 * gain['noise_floor']:.3g} %"),
        ("judgement", "", judgement(hidden.name, diagnosis)),
    ]
    if hidden.name == FOREIGN:
        rows[0] = ("verdict", "unexplained (no library has it)", str(diagnosis["verdict"]))
    return Table("The seal is open", ("", "hidden", "found"), tuple(rows))


def _place(location: dict[str, Any]) -> str:
    return ", ".join(
        f"[{', '.join(f'{part:+.3f}' for part in value)}]" if key == "direction" else str(value)
        for key, value in location.items()
    )


def _numbers(parameters: dict[str, Any]) -> str:
    return "\n".join(f"{name} {_number(value)}" for name, value in parameters.items())


def _with_errors(cause: dict[str, Any]) -> str:
    """Numbers that were found with their standard errors."""
    errors = cause.get("standard_errors", {})
    return "\n".join(
        f"{name} {_number(value)}" + (f" ± {errors[name]:.2g}" if name in errors else "")
        for name, value in cause["parameters"].items()
    )


def _number(value: Any) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(_number(part) for part in value) + "]"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
