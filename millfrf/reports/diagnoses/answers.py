"""Sentences of a diagnosis: location, cause, certainty, other possible causes, and the next test."""

import re
import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from millfrf.core import DegreeOfFreedom
from millfrf.core.provenance import versions
from millfrf.mismatch import AcceptedCause, StructureDiagnosis, form_of, joint_in_words, rig_of, tip_axes

from ..tables import odds_in_words


def left_in_words(diagnosis: StructureDiagnosis) -> str:
    """Describe the residual of a partial explanation on the held-out recording, or on the only one.

    If the improved model contains a free form, its error differs from the error of the named laws; both are stated.

    Parameters
    ----------
    diagnosis
        A diagnosis that is partly explained.
    """
    free, tested = diagnosis.content.get("free_form"), diagnosis.details.tested
    response = "held-out response" if tested else "response of the only recording"
    if free:
        compared, freed = (100 * free["held_out"][key] for key in ("compared", "free_form"))
        return (
            f"the named law leaves {compared:.3g} % of the {response}, more than a complete explanation "
            f"may leave; a free form of it leaves {freed:.3g} %"
        )
    return (
        f"{100 * diagnosis.improvement.after:.3g} % of the {response} is still not predicted, and "
        f"{100 * diagnosis.leftover:.0f} % of that depends on the signal"
        + (", more than a complete explanation may leave" if tested else ", and no held-out data confirm the rest")
    )


def made_when(*, dated: bool = True) -> str:
    """State the program and, if ``dated``, the time of writing; without the time equal input gives equal pages."""
    program = f"millfrf {versions()['millfrf']}"
    return f"Written {datetime.now(UTC):%Y-%m-%d %H:%M} UTC by {program}" if dated else f"Made by {program}"


@dataclass(frozen=True)
class NextTest:
    """Meaning of a cause or verdict, without a full stop, and the test that confirms it."""

    meaning: str
    test: str


@cache
def _table() -> dict[str, dict[str, str]]:
    return tomllib.loads(files("millfrf.reports.diagnoses").joinpath("next_tests.toml").read_text(encoding="utf-8"))


def next_test(name: str) -> NextTest:
    """Return meaning and next test of a cause or verdict; general texts for a name that is not in the table.

    Examples
    --------
    >>> next_test("backlash").meaning
    'one joint has play: it is soft inside a gap'
    """
    table = _table()
    return NextTest(**table.get(name, table["other"]))


NOWHERE = "No band, channel, time or level has more residual than noise would leave."

NOWHERE_UNSURE = (
    "No band, channel, time or level has more residual than the noise of the fit, which may include the unexplained "
    "part: its location is not known."
)
SECOND = 1.5  # power of the rest over the noise of the quietest bands from which another cause is mentioned
INCOMPLETE = ("partly explained", "unlisted", "unexplained")


def words(name: str) -> str:
    """Convert the name of a cause to words.

    Examples
    --------
    >>> words("coulomb_friction")
    'Coulomb friction'
    """
    return name.replace("_", " ").replace("coulomb", "Coulomb").replace("ac coupling", "AC coupling")


def first_word(name: str) -> str:
    """Convert the name of a cause to words at the beginning of a sentence.

    Examples
    --------
    >>> first_word("ac_coupling"), first_word("missing_mode")
    ('AC coupling', 'Missing mode')
    """
    return capitalised(words(name))


def capitalised(text: str) -> str:
    """Return a sentence with a capital letter, unless it begins with the name of a file, a channel or a cause.

    Examples
    --------
    >>> capitalised("the model"), capitalised("idle.json: no band"), capitalised("pose_drift: a mass")
    ('The model', 'idle.json: no band', 'pose_drift: a mass')
    """
    first = text.split(" ", 1)[0]
    return text if re.search(r"[._]\w|\d", first) else text[:1].upper() + text[1:]


def number(value: float, error: float | None = None) -> str:
    """Format a value with its standard error.

    Examples
    --------
    >>> number(0.00024987, 0.0000012), number(3.0)
    ('0.0002499 ± 1.2e-06', '3')
    """
    if error is None or not np.isfinite(error) or error <= 0:
        return f"{value:.4g}"
    digits = int(np.clip(np.floor(np.log10(max(abs(value), error))) - np.floor(np.log10(error)) + 2, 2, 9))
    return f"{value:.{digits}g} ± {error:.2g}"


def verdict_sentence(diagnosis: StructureDiagnosis) -> str:
    """State the result in one sentence."""
    gain = diagnosis.improvement
    missing = causes_in_words(diagnosis.physics)
    where = "held-out" if diagnosis.details.tested else "only"
    left = f"{100 * gain.after:.3g} % of the response on the {where} recording"
    if diagnosis.verdict == "none":
        return f"Nothing is missing: {next_test('none').meaning}."
    if diagnosis.verdict == "unexplained" and diagnosis.content.get("another_structure"):
        return f"Unexplained: {diagnosis.content['another_structure']}. The model leaves {left}."
    if diagnosis.verdict == "unlisted":
        return f"Unlisted: {next_test('unlisted').meaning}. {diagnosis.content['free_form']['sentence']}"
    if diagnosis.verdict == "unexplained":
        form = "a force of free form says how it behaves (below)" if diagnosis.content.get("free_form") else ""
        known = f"no law is named for it{f', but {form}' if form else ''}"
        return f"Unexplained: {next_test('unexplained').meaning}; {known}. The model leaves {left}."
    several = len(diagnosis.physics) > 1
    fall = (
        f"; with {'them' if several else 'it'}, the error on the {where} recording falls from "
        f"{100 * gain.before:.3g} % to {100 * gain.after:.3g} %, noise being {100 * gain.noise_floor:.3g} %"
    )
    fall = fall if gain.after < gain.before else ""
    if diagnosis.verdict == "partly explained":
        if diagnosis.content.get("free_form"):
            return f"Only partly explained: the model leaves out {missing}{fall}. But {left_in_words(diagnosis)}."
        return (
            f"Only partly explained: the model leaves out {missing}{fall}. {'They help' if several else 'It helps'}, "
            f"but {left} is still not predicted, more than a whole explanation may leave: something else is missing "
            f"too, or {'these are' if several else 'this is'} not quite what is there."
        )
    return f"The model leaves out {missing}{fall}."


def causes_in_words(causes: Sequence[AcceptedCause]) -> str:
    """Return the names of causes with their meaning; a law in several joints is named once, with their number.

    Examples
    --------
    >>> friction = AcceptedCause("coulomb_friction", {}, {}, {}, 80.0)
    >>> causes_in_words([friction])
    'Coulomb friction (dry friction acts in one joint)'
    >>> causes_in_words([friction, friction])
    'Coulomb friction in 2 places'
    """
    counts = Counter((named(cause), cause.name) for cause in causes)
    return " and ".join(
        f"{text} in {count} places" if count > 1 else f"{text} ({next_test(name).meaning})"
        for (text, name), count in counts.items()
    )


def named(cause: AcceptedCause) -> str:
    """Return the name of a cause; for a tone, add its frequency.

    Examples
    --------
    >>> named(AcceptedCause("unmeasured_excitation", {}, {"frequency_hz": 23.456}, {"frequency_hz": 0.01}, 80.0))
    'unmeasured excitation at 23.456 ± 0.01 Hz'
    """
    if cause.name != "unmeasured_excitation":
        return words(cause.name)
    shown = number(cause.parameters["frequency_hz"], cause.standard_errors.get("frequency_hz"))
    return f"{words(cause.name)} at {shown} Hz"


def answers(diagnosis: StructureDiagnosis) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """Return each question with the sentences that answer it."""
    return (
        ("Where?", where(diagnosis)),
        ("What?", what(diagnosis)),
        ("How sure?", how_sure(diagnosis)),
        ("What else?", what_else(diagnosis)),
        ("Which test tells?", which_test(diagnosis)),
    )


def where(diagnosis: StructureDiagnosis) -> tuple[str, ...]:
    """Describe the location of each cause, and of the residual."""
    said = [f"{capitalised(named(cause))}: {place(diagnosis, cause)}." for cause in diagnosis.physics]
    said.append(f"Model and recordings are {diagnosis.details.band.sentence}.")
    located = diagnosis.located
    bands = located.get("frequency_bands", [])
    if not bands:
        return (*said, NOWHERE_UNSURE if diagnosis.verdict in INCOMPLETE else NOWHERE)
    large = [band for band in bands if band["share"] >= 0.005] or bands[:1]
    shown = "; ".join(
        f"{band['low_hz']:.3g} to {band['high_hz']:.3g} Hz ({100 * band['share']:.0f} %, strongest in the "
        f"narrow band around {band['peak_hz']:.3g} Hz)"
        for band in large[:3]
    )
    channels = ", ".join(
        f"{row['channel']} {100 * row['share']:.0f} %"
        for row in sorted(located["channels"], key=lambda row: -row["share"])
        if row["significant"]
    )
    said.append(f"Residual above noise lies at {shown}" + (f"; in {channels}." if channels else "."))
    said += _times(diagnosis) + _orders(located)
    return tuple(said)


def place(diagnosis: StructureDiagnosis, cause: AcceptedCause) -> str:
    """Describe the location of a cause."""
    location = cause.location
    if "direction" in location:
        model = diagnosis.details.final.hypothesis.model
        _, columns, axes = tip_axes(model)
        main = int(np.argmax(np.abs(location["direction"])))
        node = DegreeOfFreedom.parse(model.excitations[int(abs(columns[:, main]).argmax())]).node
        at = f"at {node} that acts " if "participation" not in location else ""
        return f"in a joint {at}{joint_in_words(location, axes)}"
    if "participation" in location:
        return f"in a joint {joint_in_words(location)}"
    if "channel" in location:
        source = f", from {location['from']}" if "from" in location else ""
        return f"in the {location.get('role', 'response')} channel {location['channel']}{source}"
    if "form" in location:
        return str(location["form"])
    if "channels" in location:
        return f"in {', '.join(location['channels'])}"
    if "modes" in location:
        moved = f": {', '.join(location['moved'])}" if location.get("moved") else ""
        return f"modes {', '.join(str(mode) for mode in location['modes'])}{moved}"
    if "shape" in location:
        return "shape " + ", ".join(f"{label} {value:.2f}" for label, value in location["shape"].items())
    return "in the whole measuring chain or structure"


def _times(diagnosis: StructureDiagnosis) -> list[str]:
    """Describe when the residual occurs, for recordings in which only a part of the time is affected."""
    said = []
    for entry in diagnosis.details.recordings:
        stretches = [row for row in diagnosis.located["times"] if row["recording"] == entry.recording.name]
        held = sum(row["end_s"] - row["start_s"] for row in stretches)
        if stretches and held < 0.8 * (entry.recording.duration - entry.start / entry.recording.rate):
            spans = ", ".join(f"{row['start_s']:.3g} to {row['end_s']:.3g} s" for row in stretches[:6])
            said.append(
                f"In {entry.recording.name} the residual lies at {spans}{' and later' if len(stretches) > 6 else ''}."
            )
    return said


def _orders(located: Mapping[str, Any]) -> list[str]:
    orders = sorted({row["order"] for row in located["spindle_orders"]})
    if orders:
        return [f"The residual lies at spindle orders {', '.join(str(order) for order in orders)}."]
    note = located["spindle_orders_note"]
    return [f"Spindle orders: {note}."] if note else []


def what(diagnosis: StructureDiagnosis) -> tuple[str, ...]:
    """Describe equation and source of each cause, and the growth of the residual with the level."""
    said = []
    for cause in diagnosis.physics:
        physics = form_of(cause.name, cause.parameters, rig_of(diagnosis.details.final.hypothesis.model))
        equation = f": {physics.equation} ({physics.source})" if physics is not None else ""
        said.append(f"{first_word(cause.name)}{equation}.")
    free = diagnosis.content.get("free_form")
    said += [free["sentence"]] if free else []
    said += missing_force_in_words(diagnosis)
    growth = diagnosis.located.get("growth", {})
    result = growth.get("effect") or growth.get("residual")
    if result and result["exponent"] is not None:
        said.append(
            f"It grows as the force to the power {number(result['exponent'], result['exponent_standard_error'])} "
            "(a missing linear effect: 1, a cubic stiffness: 3, dry friction: 0)."
        )
    moving = diagnosis.content.get("modes_in_time")
    said += [moving["sentence"]] if moving else []
    behaviour = diagnosis.details.behaviour
    if behaviour is not None:
        said.append(f"Without an assumed law: {behaviour.sentence}")
    return tuple(said) or ("Nothing beyond the refitted modal parameters.",)


def missing_force_in_words(diagnosis: StructureDiagnosis) -> tuple[str, ...]:
    """Describe the force of one joint that was estimated before any law was fitted: where, how large, what it follows.

    The text is empty if the force was not estimated, as with a single response.
    """
    force = diagnosis.content.get("missing_force")
    if not force:
        return ()
    if not force["significant"]:
        return ("Before any law: refitted modes leave no force of a joint.",)
    if 2 * force["off_tip"] ** 2 < 1:
        axes = tip_axes(diagnosis.details.final.hypothesis.model)[2]
        turn = np.degrees(np.linalg.norm(force["direction_error"]))
        # a second cause may turn the direction by more than its error
        error = "" if force["rest_over_noise"] > SECOND else f" (± {turn:.1f}°)"
        where_it_is = f"nearly {joint_in_words({'direction': force['direction']}, axes)}{error}"
    else:  # no direction at the tip moves the modes as the joint does
        where_it_is = joint_in_words({"participation": force["participation"]})
    shares = sorted(((share, name) for name, share in force["follows"].items() if name != "all"), reverse=True)
    followed = ", ".join(f"{100 * share:.0f} % {name}" for share, name in shares)
    law = "" if force["law_known"] else ": one joint whose law is not known, or not a joint"
    rest = force["rest_over_noise"]
    said = [
        f"Before any law: one joint, {where_it_is}, explains {100 * force['explained']:.0f} % of "
        f"the residual. Functions of its motion explain {100 * force['follows']['all']:.0f} % of its force "
        f"({followed}, each alone){law}."
    ]
    if rest > SECOND:
        said.append(
            f"Its force leaves {rest:.2g} times the power of the noise in the quietest bands: the noise is louder "
            "elsewhere, or there is a second cause, which may turn the direction."
        )
    return tuple(said)


def how_sure(diagnosis: StructureDiagnosis) -> tuple[str, ...]:
    """Describe the evidence, and the errors on held-out data."""
    said = [
        f"{first_word(cause.name)}: odds {odds_in_words(cause.evidence)} against its absence (evidence "
        f"{cause.evidence:.0f}; 4.6 more multiply the odds by ten, and at least 20 are required)."
        for cause in diagnosis.physics
    ]
    said += [_errors(diagnosis), *held_out_in_turn(diagnosis)]
    said += offered_in_words(diagnosis)
    said += [entry["sentence"] for entry in diagnosis.content.get("noise", ())]
    said.append(f"{100 * diagnosis.leftover:.0f} % of the residual depends on the signal.")
    return tuple(said)


def offered_in_words(diagnosis: StructureDiagnosis) -> tuple[str, ...]:
    """State the limits of the improved model for predictions; return an empty text if it has none."""
    sentence = diagnosis.content.get("improved_model", {}).get("sentence")
    return (sentence,) if sentence else ()


def _errors(diagnosis: StructureDiagnosis) -> str:
    """Describe the errors on held-out data, and their significance."""
    gain = diagnosis.improvement
    text = (
        f"the error is {100 * gain.before:.3g} % of the response for the nominal model, {100 * gain.refitted:.3g} % "
        f"refitted, {100 * gain.after:.3g} % for the final one; noise is {100 * gain.noise_floor:.3g} %."
    )
    if not diagnosis.details.tested:
        return f"On {gain.held_out}, the only recording, {text} Nothing was held out, so that this is not confirmed."
    text = (
        f"On {gain.where}, which the fit did not use, {text} Final over nominal: {gain.interval[0]:.3g} to "
        f"{gain.interval[1]:.3g} (95 % interval)."
    )
    if not diagnosis.physics:
        return text
    other = "the refitted" if gain.against == "refitted" else "the nominal"
    return f"{text} Probability of such a gain over {other} model by chance: p = {gain.p_value:.2g}."


def held_out_in_turn(diagnosis: StructureDiagnosis) -> tuple[str, ...]:
    """Describe the largest error of the final model when each recording is held out in turn; empty if none was."""
    if not diagnosis.held_out:
        return ()
    worst = max(diagnosis.held_out, key=lambda error: error.after)
    return (
        f"Each recording held out in turn: the largest error is {100 * worst.after:.3g} % of {worst.name} "
        f"({100 * worst.before:.3g} % for the nominal model, noise {100 * worst.floor:.3g} %).",
    )


def rivals(diagnosis: StructureDiagnosis) -> list[tuple[str, float]]:
    """Return the other fitted causes with their best evidence, best first."""
    accepted = {cause.name for cause in diagnosis.physics}
    best: dict[str, float] = {}
    for candidate in diagnosis.candidates:
        if candidate.stage == "fitted" and candidate.name not in accepted:
            best[candidate.name] = max(best.get(candidate.name, -np.inf), candidate.evidence)
    return sorted(best.items(), key=lambda item: -item[1])


def what_else(diagnosis: StructureDiagnosis) -> tuple[str, ...]:
    """Describe the causes that the data cannot separate, then the best rejected causes."""
    said = []
    if diagnosis.equivalents:
        names = ", ".join(words(name) for name in diagnosis.equivalents)
        said.append(f"The recordings cannot distinguish it from {names}.")
    others = [rival for rival in rivals(diagnosis) if rival[0] not in diagnosis.equivalents and rival[1] > 0]
    if diagnosis.physics and others:
        name, evidence = others[0]
        top = max(cause.evidence for cause in diagnosis.physics)
        ending = f"less by {top - evidence:.0f}" if evidence < top else "but it was the weaker candidate in its round"
        said.append(f"The best other candidate is {words(name)} with evidence {evidence:.0f}, {ending}.")
    said += [
        f"{first_word(entry.name)} would fit with evidence {entry.evidence:.0f}, but {entry.location['impossible']}."
        for entry in diagnosis.candidates
        if entry.stage == "impossible"
    ][:2]
    if others and not diagnosis.physics:
        said.append(f"Best candidate, but not accepted: {words(others[0][0])} with evidence {others[0][1]:.0f}.")
    for cause in diagnosis.physics[:1]:
        physics = form_of(cause.name, cause.parameters, rig_of(diagnosis.details.final.hypothesis.model))
        if physics is not None and physics.confusable_with:
            names = ", ".join(words(name) for name in physics.confusable_with)
            said.append(f"It is easily confused with {names}.")
    return tuple(said) or ("No other cause of the library has similar evidence.",)


def which_test(diagnosis: StructureDiagnosis) -> tuple[str, ...]:
    """Return the next test for each accepted cause, for causes equivalent to it, or for the verdict."""
    names = [cause.name for cause in diagnosis.physics] + list(diagnosis.equivalents)
    if diagnosis.verdict != "explained":
        names = [diagnosis.verdict, *names]
    several = len(names) > 1
    return tuple((f"{first_word(name)}: " if several else "") + next_test(name).test for name in dict.fromkeys(names))


def warnings(diagnosis: StructureDiagnosis) -> tuple[str, ...]:
    """List the warnings of a diagnosis."""
    gain, said = diagnosis.improvement, [f"{capitalised(doubt)}." for doubt in diagnosis.doubts]
    if diagnosis.details.tested and len(diagnosis.details.recordings) < 2:
        said.append(
            "There is a single recording: its middle half was held out; how the residual grows with the level is not "
            "known."
        )
    elif len(diagnosis.details.recordings) == 2:
        said.append("There are two recordings only: how the residual grows with the level is known from two points.")
    if diagnosis.physics and diagnosis.details.tested and gain.p_value > 0.01:
        said.append(f"On the held-out recording the improvement is not significant (p = {gain.p_value:.2g}).")
    if not diagnosis.physics and gain.refitted > max(gain.before, 1.5 * gain.noise_floor):
        said.append(
            "Refitted without the recording that was held out, the model predicts it worse than the nominal one: "
            "the other recordings alone do not determine its modes, so keep the nominal model."
        )
    if gain.after > 1.5 * gain.noise_floor:
        where = "held-out" if diagnosis.details.tested else "only"
        said.append(
            f"On the {where} recording the final model's error is {gain.after / gain.noise_floor:.2g} times the noise."
        )
    if "explained" in diagnosis.verdict and diagnosis.physics and diagnosis.leftover > 0.1:
        said.append(f"{100 * diagnosis.leftover:.0f} % of the residual depends on the signal.")
    return tuple(said)
