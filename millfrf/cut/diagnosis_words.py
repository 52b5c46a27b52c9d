"""A cutting diagnosis in words: the lines that the terminal and the head of the report show."""

import math

from millfrf.mismatch import COEFFICIENTS, AcceptedCause, CutDiagnosis

from ..tables import evidence_in_words, with_error

UNITS = {"radial_offset_m": ("µm", 1e6), "angle_rad": ("deg", 180 / math.pi), "coefficient_n_per_m": ("kN/m", 1e-3)}
"""How numbers are told to a reader: unit and factor from SI."""


def summary(found: CutDiagnosis) -> list[str]:
    """A few lines for the terminal and the head of the report."""
    better = found.improvement
    lines = [f"verdict: {found.verdict}", _sentence(found), *(describe(cause) for cause in found.physics)]
    if found.equivalents:
        lines.append(f"cannot be told from: {', '.join(found.equivalents)}")
    chatter = found.details.chatter
    lines += [f"{one.name}: {one.kind}, {one.reason}" for one in chatter if one.unstable]
    lines += [f"chatter of {one.name} was not judged: {one.reason}" for one in chatter if one.kind == "not judged"]
    lines += [f"{one.name} was {one.stage}" for one in found.candidates if one.stage != "fitted"]
    lines.append(what_is_left(found))
    changed = f", {100 * better.after:.3g} % with it" if found.details.final.freed else ""
    lines.append(
        f"error of the force on blocks of time held out: {100 * better.before:.3g} % as computed, "
        f"{100 * better.refitted:.3g} % with coefficients refitted{changed}; noise {100 * better.noise_floor:.3g} %"
    )
    if found.details.final.freed:
        lines.append(f"that the causes do not lower it has p = {better.p_value:.1g}")
    return lines


def what_is_left(found: CutDiagnosis) -> str:
    """State the part of the force that stands out of noise, beside the part that may stand out."""
    return (
        f"left: {100 * found.leftover:.2g} % of the residual's power stands out of noise and usual error; "
        f"none and explained: at most {100 * found.details.settings.verdict.noise_like:g} %"
    )


def describe(cause: AcceptedCause) -> str:
    """One cause with its numbers, in a user's units."""
    if cause.name == COEFFICIENTS:
        names = cause.location["coefficients"]
        numbers = [f"{name} {cause.parameters[name]:.4g} ± {cause.standard_errors[name]:.2g}" for name in names]
    else:
        numbers = [told(name, value, cause.standard_errors[name]) for name, value in cause.parameters.items()]
    return f"{cause.name}: {', '.join(numbers)}; {evidence_in_words(cause.evidence)}"


def told(name: str, value: float, error: float) -> str:
    """One number with its error and unit."""
    unit, factor = UNITS.get(name, ("", 1.0))
    text = with_error(factor * value, factor * error)
    return f"{name.rsplit('_', 1)[0] if unit else name} {text} {unit}".strip().replace("_n_per", "").replace("_", " ")


def _sentence(found: CutDiagnosis) -> str:
    shaken = [one for one in found.details.chatter if one.unstable]
    if shaken:
        names = f"the recording {shaken[0].name} chatters"
        if len(shaken) > 1:
            names = f"the recordings {', '.join(one.name for one in shaken)} chatter"
        return (
            f"cannot tell: {names}, and the force of a stable cut, which repeats with the spindle, does not apply; "
            "record a stable cut (less depth, another speed)"
        )
    return {
        "none": "the computed force agrees with the measured one within noise and a lab's errors: nothing to change",
        "unexplained": "the computed force is wrong in a way that no known cause explains",
        "partly explained": (
            "what follows lowers the error of the computed force on blocks held out, but leaves more than an "
            "explanation may: something else is wrong too, and the numbers may stand in for it"
        ),
        "explained": "the computed force leaves out what follows; what is then left is noise and usual error",
    }[found.verdict]
