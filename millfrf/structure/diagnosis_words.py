"""The diagnosis of a structure in words: the lines that `millfrf diagnose` prints."""

from millfrf.mismatch import AcceptedCause, StructureDiagnosis, joint_in_words, tip_axes

from ..report import left_in_words
from ..tables import evidence_in_words


def diagnosis_lines(diagnosis: StructureDiagnosis) -> list[str]:
    """A few lines for the terminal: verdict, causes with numbers, error before and after.

    Parameters
    ----------
    diagnosis
        The diagnosis of a structure.
    """
    lines = [f"verdict: {diagnosis.verdict}"]
    lines.append(diagnosis.details.band.sentence)
    lines += [f"warning: {doubt}" for doubt in diagnosis.doubts]
    lines += [_cause_line(diagnosis, cause) for cause in diagnosis.physics]
    if diagnosis.equivalents:
        lines.append(f"cannot be told from: {', '.join(diagnosis.equivalents)}")
    if diagnosis.verdict == "partly explained":
        lines.append(left_in_words(diagnosis))
    lines += [
        f"{one.name} is not told: {one.location['impossible']}"
        for one in diagnosis.candidates
        if one.stage == "impossible"
    ][:1]
    lines += list(diagnosis.content.get("not_asked_for", ()))
    if diagnosis.verdict == "unexplained":
        lines.append(
            f"{100 * diagnosis.leftover:.0f} % of what is left still moves with the signal: a cause is missing"
        )
    if diagnosis.details.behaviour is not None:
        lines.append(f"behaviour by level: {diagnosis.details.behaviour.sentence}")
    lines += free_form_in_words(diagnosis)
    lines.append(_error_line(diagnosis))
    offered = diagnosis.content.get("improved_model", {}).get("sentence")
    lines += [offered] if offered else []
    lines += [one["sentence"] for one in diagnosis.content.get("noise", ())]
    return lines


def free_form_in_words(diagnosis: StructureDiagnosis) -> tuple[str, ...]:
    """What a joint's force is where its form is free; empty where the recordings ask for no free form.

    Parameters
    ----------
    diagnosis
        The diagnosis of a structure.
    """
    found = diagnosis.content.get("free_form")
    return (found["sentence"],) if found else ()


def _cause_line(diagnosis: StructureDiagnosis, cause: AcceptedCause) -> str:
    """A cause with its place, its numbers with their standard errors, and its evidence."""
    numbers = ", ".join(
        f"{name} {value:.4g}" + (f" ± {cause.standard_errors[name]:.2g}" if name in cause.standard_errors else "")
        for name, value in cause.parameters.items()
    )
    axes = tip_axes(diagnosis.details.final.hypothesis.model)[2] if "direction" in cause.location else ()
    place = joint_in_words(cause.location, axes) or ", ".join(f"{key} {value}" for key, value in cause.location.items())
    return f"{cause.name}{f' ({place})' if place else ''}: {numbers}; {evidence_in_words(cause.evidence)}"


def _error_line(diagnosis: StructureDiagnosis) -> str:
    """Errors on the recording held out."""
    gain = diagnosis.improvement
    said = (
        f"{100 * gain.before:.3g} % nominal, {100 * gain.refitted:.3g} % refitted, {100 * gain.after:.3g} % improved, "
        f"noise {100 * gain.noise_floor:.3g} %"
    )
    if not diagnosis.details.tested:
        return f"error on {gain.held_out}, the only recording, so not held out: {said}"
    test = f", p = {gain.p_value:.2g} that improved is no better than {gain.against}" if diagnosis.physics else ""
    return f"error on {gain.where}, held out: {said}{test}"
