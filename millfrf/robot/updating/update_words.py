"""An update in words and in a file."""

import math
from typing import Any

import numpy as np

from millfrf.robot_model import Mechanism, RobotUpdate, UpdateParameter, shown_values

from ...tables import with_error

UNITS = {"m/N": ("µm/N", 1e6), "rad/(N m)": ("µrad/(N m)", 1e6), "kg": ("kg", 1.0), "m": ("m", 1.0)}
FORMAT = "millfrf.robot_update"


def summary(found: RobotUpdate, mechanism: Mechanism) -> list[str]:
    """The lines that the terminal shows: verdict, names, errors held out, what is open, what to measure next."""
    lines = [f"verdict: {found.verdict}", found.reason]
    named = list(zip(found.parameters, found.x, found.errors, found.named, found.told, strict=True))
    lines += [f"wrong in the file: {told(one, x, error)}" for one, x, error, name, _ in named if name]
    others = [told(one, x, error) for one, x, error, name, known in named if known and not name]
    if found.verdict != "unexplained":
        lines += [f"updated, not named: {text}" for text in others]
    for one in found.held_out:
        lines.append(
            f"error on {one.name}, left out: {one.before:.3g} times the noise as filed, {one.after:.3g} updated"
        )
    if found.modes_off:
        lines.append(f"modes are still off by {100 * found.modes_off:.2g} % in frequency, beyond the noise")
    lines += [direction.sentence for direction in found.open]
    if found.next is not None:
        lines.append(_next(found, mechanism))
    return lines


def told(one: UpdateParameter, x: float, error: float) -> str:
    """A number with its error, in a user's units; a logarithm as a factor."""
    if one.logarithmic:
        return f"{one.name}: times {with_error(math.exp(x), math.exp(x) * error)}"
    unit, factor = UNITS.get(one.unit, (one.unit, 1.0))
    return f"{one.name}: {with_error(factor * x, factor * error, sign=True)} {unit}".rstrip()


def _next(found: RobotUpdate, mechanism: Mechanism) -> str:
    assert found.next is not None
    where = found.next.name or shown_values(mechanism, found.next.driven)
    what = ", ".join(f"{name} to {100 * left:.0f} %" for name, left in found.next.sharpens)
    gains = f"; errors fall: {what}" if what else ""
    return f"measure next: {where} ({found.next.gain:.2g} nats{gains}); check first that the robot may stand there"


def as_json(found: RobotUpdate) -> dict[str, Any]:
    """All of an update: ``format``, verdict, numbers, covariance, errors held out, open directions, next posture."""
    numbers = [
        {
            "name": one.name,
            "kind": one.kind,
            "unit": one.unit,
            "logarithm_of_factor": one.logarithmic,
            "value": float(x),
            "standard_error": float(error),
            "told": bool(known),
            "named": bool(name),
        }
        for one, x, error, known, name in zip(
            found.parameters, found.x, found.errors, found.told, found.named, strict=True
        )
    ]
    following = found.next
    return {
        "format": FORMAT,
        "format_version": 1,
        "verdict": found.verdict,
        "reason": found.reason,
        "numbers": numbers,
        "covariance": np.asarray(found.covariance).tolist(),
        "held_out": [{"name": one.name, "before": one.before, "after": one.after} for one in found.held_out],
        "fitted": found.fitted.tolist(),
        "noise": found.noise,
        "modes_off": found.modes_off,
        "open": [{"names": one.names, "parts": one.parts, "left": one.left} for one in found.open],
        "next": None
        if following is None
        else {"name": following.name, "driven": following.driven.tolist(), "gain_nats": following.gain},
    }
