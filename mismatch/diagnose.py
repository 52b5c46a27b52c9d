"""The diagnosis: plain faults, linear refit, one cause after the other, and a decision that may be to abstain."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel

from .chain_screening import ScreenedChain, screen_chains
from .diagnosis import AcceptedCause, Candidate, Diagnosis
from .explanation import Cause, Explanation
from .fitting import Fit, fit
from .held_out import held_out_improvement
from .joint_direction import find_direction
from .joint_screening import screen_joints
from .leftover import Leftover, leftover
from .linear_floor import Floor, linear_floor, noise_floor
from .missing_mode import SightedMode, find_mode
from .physics import ChainPhysics, JointPhysics, Physics, library
from .plain_faults import Clipping, Tone, find_clipping, find_tone, unclipped, without_tone
from .reporting_numbers import accepted_cause, accepted_mode, modal_deviation
from .shape_of_model import LabError, ModelShape
from .trial import Trial, band_of
from .windowed_lines import WindowedLines, windowed_lines

Real = NDArray[np.float64]
Progress = Callable[[str], None]

MOST_CAUSES = 3
LEAST_EVIDENCE = 20.0
"""Gain in score below which nothing is accepted: odds of some twenty thousand to one."""

MOST_CHAINS = 3
"""Linear causes that are fitted in a round."""

PROMISING = 0.1
"""Screened gain, as a share of the best law's, from which a law is fitted."""

MOST_LAWS = 4
"""Joint laws that are fitted to the motion seen; the two best are then simulated freely."""

NOISE_LIKE = 0.06
"""Share of a residual that may seem to move with the signal by chance, hum or force noise."""

EXPLAINED = 0.9
"""Share of what moved with the signal that causes must have taken away, if what is left is not noise-like."""

CLEAR = 4.0
"""Standard errors by which a cause's number must differ from none."""

SMALL = 0.01
"""Evidence of a further cause, as a share of what the first ones had, below which it may mend the form of their law."""

SAME_JOINT = 0.9
"""Cosine between the directions of two laws of one joint."""

AFTER_A_LAW = 0.06
"""The same once a joint's law was accepted, whose form is never quite the true one; half of it for another joint."""


@dataclass(frozen=True)
class Settings:
    """How a diagnosis is made.

    Parameters
    ----------
    lab
        What a lab's own fit is usually off.
    causes
        By name; None: the whole library.
    """

    lab: LabError = field(default_factory=LabError)
    causes: dict[str, Physics] | None = None


@dataclass(frozen=True)
class _Option:
    """A fitted candidate."""

    name: str
    location: dict[str, Any]
    fitted: Fit


def diagnose(
    model: ModalModel, trials: Sequence[Trial], settings: Settings | None = None, watch: Progress | None = None
) -> Diagnosis:
    """Find what a model leaves out of recordings.

    Parameters
    ----------
    model
        Nominal receptances.
    trials
        Recordings, any order.
    settings
        None: defaults.
    watch
        Told what is being done.

    Returns
    -------
    Diagnosis

    Raises
    ------
    InputError
        Recordings that the model cannot be compared with.
    """
    settings = settings or Settings()
    tell = watch or (lambda text: None)
    causes = settings.causes if settings.causes is not None else library()
    decay = float((-model.poles.real).min())
    lines = [windowed_lines(trial, band_of(model, trial.rate), decay) for trial in trials]
    tell("modal parameters")
    nominal = Explanation(ModelShape(model, settings.lab), np.zeros(ModelShape(model, settings.lab).size))
    base = fit(lines, nominal)
    tell("tones and clipping")
    lines, base, faults = _plain_faults(lines, base, decay)
    search = _search(lines, base, faults, causes, tell)
    current, accepted, candidates = search.current, search.accepted, search.candidates
    tell("what is left")
    deviation = modal_deviation(current)
    if deviation is not None:
        accepted.append(deviation)
    left = leftover(current.explanation, lines)
    unexplained = _unexplained(left, search.before)
    if unexplained:
        candidates += [Candidate(one.name, one.evidence, "rejected", one.location) for one in accepted]
        accepted, current, left = [], base, search.before
    tell("held-out recording")
    improvement = held_out_improvement(lines, current.explanation, current.noises)
    verdict = "unexplained" if unexplained else "explained" if accepted else "none"
    ranked = tuple(sorted(candidates, key=lambda one: -one.evidence))
    return Diagnosis(
        verdict, tuple(accepted), ranked, search.equivalents, improvement, left.share, base, current, tuple(lines)
    )


@dataclass(frozen=True)
class _Search:
    """Where the search for causes ended."""

    current: Fit
    accepted: list[AcceptedCause]
    candidates: list[Candidate]
    equivalents: tuple[str, ...]
    before: Leftover


def _search(
    lines: list[WindowedLines], base: Fit, faults: list[AcceptedCause], causes: dict[str, Physics], tell: Progress
) -> _Search:
    """One cause after the other, while each is worth it."""
    current, accepted = base, list(faults)
    candidates: list[Candidate] = []
    equivalents: tuple[str, ...] = ()
    before = leftover(base.explanation, lines)
    while len(accepted) < MOST_CAUSES:
        tell(f"causes, round {len(accepted) + 1}")
        options, weighed = _options(lines, current, causes, before)
        candidates += weighed
        best = min(options, key=lambda option: option.fitted.score, default=None)
        if best is None or best.fitted.score > current.score - LEAST_EVIDENCE:
            break
        # evidence counts from where a fit has settled; a next cause must not live on what this one left undone
        best = replace(best, fitted=fit(lines, best.fitted.explanation, best.fitted.noises, iterations=20))
        if not _worth_it(best, current, base):
            break
        line = best.fitted.score + LEAST_EVIDENCE / 2
        rivals = [option.name for option in options if option.name != best.name and option.fitted.score < line]
        equivalents = equivalents or tuple(dict.fromkeys(rivals))
        accepted.append(_describe(best, current))
        current = best.fitted
    return _Search(current, accepted, candidates, equivalents, before)


def _plain_faults(
    lines: list[WindowedLines], base: Fit, decay: float
) -> tuple[list[WindowedLines], Fit, list[AcceptedCause]]:
    """Take out tones and mend clipping, refitting each time."""
    found: list[AcceptedCause] = []
    for _ in range(4):
        tone = find_tone(base, lines)
        if tone is None or tone.gain < LEAST_EVIDENCE:
            break
        lines = [without_tone(one, tone) for one in lines]
        base = fit(lines, base.explanation, iterations=4)
        found.append(_tone_cause(tone, lines[0]))
    clipping = find_clipping(base, lines)
    if clipping is not None:
        originals = [one.trial.response for one in lines]
        for _ in range(4):
            lines = [
                _with_response(one, unclipped(base, one, clipping, original))
                for one, original in zip(lines, originals, strict=True)
            ]
            base = fit(lines, base.explanation, iterations=4)
            clipping = _same_clipping(base, lines, originals, clipping)
        found.append(_clipping_cause(clipping, lines[0]))
    return lines, base, found


def _same_clipping(base: Fit, lines: list[WindowedLines], originals: list[Real], clipping: Clipping) -> Clipping:
    again = find_clipping(base, [_with_response(one, old) for one, old in zip(lines, originals, strict=True)])
    return again if again is not None and again.response == clipping.response else clipping


def _with_response(lines: WindowedLines, response: Real) -> WindowedLines:
    changed = replace(lines, trial=replace(lines.trial, response=response))
    return replace(changed, measured=changed.cut(response))


def _tone_cause(tone: Tone, lines: WindowedLines) -> AcceptedCause:
    names = lines.trial.channels[-len(tone.amplitudes) :]
    parameters = {"frequency_hz": tone.frequency}
    parameters |= {f"amplitude_{name}": float(value) for name, value in zip(names, tone.amplitudes, strict=True)}
    width = lines.trial.rate / len(lines.window)
    errors = {"frequency_hz": width * float(np.sqrt(6 / tone.gain)) / np.pi}
    return AcceptedCause("unmeasured_excitation", {"channels": list(names)}, parameters, errors, tone.gain)


def _clipping_cause(clipping: Clipping, lines: WindowedLines) -> AcceptedCause:
    name = lines.trial.channels[clipping.response - lines.measured.shape[1]]
    return AcceptedCause("clipping", {"channel": name}, {"limit": clipping.limit}, {}, clipping.gain)


def _options(
    lines: list[WindowedLines], current: Fit, causes: dict[str, Physics], before: Leftover
) -> tuple[list[_Option], list[Candidate]]:
    """Screen everything, fit what promises most."""
    own_noise = noise_floor(current, lines)
    cost = float(np.log(2 * sum(one.measured.size for one in lines)))
    taken = {(cause.physics.name, cause.place) for cause in current.explanation.causes}
    chains = [
        one
        for one in screen_chains(
            own_noise, current.explanation, [p for p in causes.values() if isinstance(p, ChainPhysics)]
        )
        if (one.cause.physics.name, one.cause.place) not in taken
    ]
    options: list[_Option] = []
    weighed = [Candidate(one.cause.physics.name, one.gain, "screened", _place(one.cause)) for one in chains]
    mode = find_mode(own_noise, current.explanation)
    weighed.append(Candidate("missing_mode", mode.gain, "screened"))
    options += _linear_options(lines, current, chains, mode, cost)
    best = min(options, key=lambda option: option.fitted.score, default=None)
    if best is not None and best.fitted.score > current.score - LEAST_EVIDENCE:
        best = None
    left = leftover((best.fitted if best else current).explanation, lines)
    first = best is None and not current.explanation.causes
    if first or (left.share > NOISE_LIKE and left.power > 3 * SMALL * before.power):
        joint_options, joint_weighed = _joints(lines, current, linear_floor(current, lines), causes)
        weighed += joint_weighed
        options += joint_options
    for option in options:
        weighed.append(Candidate(option.name, current.score - option.fitted.score, "fitted", option.location))
    return options, weighed


def _linear_options(
    lines: list[WindowedLines], current: Fit, chains: list[ScreenedChain], mode: SightedMode, cost: float
) -> list[_Option]:
    """Fit the linear causes that promise most: of the chain, and a further mode."""
    options = []
    largest = max([one.gain for one in chains] + [mode.gain, 0.0])
    for one in chains[:MOST_CHAINS]:
        if one.gain > max(one.cause.size * cost, 0.03 * largest):
            start = replace(current.explanation, causes=(*current.explanation.causes, one.cause))
            options.append(_Option(one.cause.physics.name, _place(one.cause), fit(lines, start, current.noises)))
    numbers = current.explanation.shape.per_mode - 2
    if not current.explanation.causes and mode.gain > max(numbers * cost, 0.03 * largest):
        shape = current.explanation.shape.with_mode(mode.pole, mode.right, mode.left)
        start = Explanation(shape, np.concatenate([current.explanation.u, np.zeros(shape.per_mode)]))
        options.append(_Option("missing_mode", {}, fit(lines, start, current.noises, iterations=12)))
    return options


def _joints(
    lines: list[WindowedLines], current: Fit, floor: Floor, causes: dict[str, Physics]
) -> tuple[list[_Option], list[Candidate]]:
    """Joint laws along the likeliest direction: driven by the seen motion first, the best then simulated freely."""
    laws = [p for p in causes.values() if isinstance(p, JointPhysics)]
    laws = [p for p in laws if p.name not in {cause.physics.name for cause in current.explanation.causes}]
    sighting = find_direction(floor, current.explanation)
    # along a single axis there is no direction to stand out, and a broad force looks like a higher floor
    if not laws or (len(sighting.direction) > 1 and sighting.gain < 50 * len(lines)):
        return [], []
    location = {"direction": [round(float(x), 6) for x in sighting.direction]}
    screened = screen_joints(floor, current.explanation, sighting.direction, laws)
    weighed = [Candidate(one.causes[0].physics.name, one.gain, "screened", location) for one in screened]
    promising = [one for one in screened if one.gain > max(60.0, PROMISING * screened[0].gain)][:MOST_LAWS]
    driven = []
    for one in promising:
        starts = [
            fit(lines, _added(current.explanation, cause), current.noises, iterations=2) for cause in one.causes[:2]
        ]
        best = min(starts, key=lambda start: start.score)
        driven.append(fit(lines, best.explanation, best.noises, iterations=4))
    driven.sort(key=lambda one: one.score)
    options = []
    for k, near in enumerate(driven):
        gain = current.score - near.score
        if k > 1 or gain < max(LEAST_EVIDENCE / 2, 0.6 * (current.score - driven[0].score)):
            continue
        last = near.explanation.causes[-1]
        free = replace(near.explanation, causes=(*near.explanation.causes[:-1], replace(last, seen=None)))
        fitted = fit(lines, free, near.noises, iterations=10)
        options.append(_Option(last.physics.name, _place(fitted.explanation.causes[-1]), fitted))
    return options, weighed


def _added(explanation: Explanation, cause: Cause) -> Explanation:
    return replace(explanation, causes=(*explanation.causes, cause))


def _place(cause: Cause) -> dict[str, Any]:
    if cause.direction is not None:
        direction = cause.direction * np.sign(cause.direction[np.argmax(np.abs(cause.direction))])
        return {"direction": [round(float(x), 6) for x in direction]}
    kind, _, label = cause.place.partition(" ")
    return {"channel": label, "role": kind} if kind in ("response", "force") else {}


def _unexplained(left: Leftover, before: Leftover) -> bool:
    """Whether too much still moves with the signal for the causes found, if any."""
    return left.share > NOISE_LIKE and left.power > (1 - EXPLAINED) * before.power


def _worth_it(option: _Option, current: Fit, base: Fit) -> bool:
    """Enough evidence; and if it lies in the lab's belief alone, most of what the belief found odd."""
    gain = current.score - option.fitted.score
    if option.name != "missing_mode" and not _measured(option.fitted):
        return False
    if gain < max(LEAST_EVIDENCE, _mending(option, current) * (base.score - current.score)):
        return False
    if current.misfit - option.fitted.misfit > LEAST_EVIDENCE:
        return True
    size = current.explanation.shape.size
    odd = max(current.deviation - size, 1.0)
    return current.deviation - option.fitted.deviation > 0.6 * odd


def _measured(fitted: Fit) -> bool:
    """Whether any number of the last cause stands out of its own error: else the gain came from elsewhere."""
    cause = fitted.explanation.causes[-1]
    first = fitted.explanation.size - cause.size
    spread = np.sqrt(np.maximum(np.diag(fitted.covariance)[first : first + len(cause.values)], 0.0))
    absent = cause.physics.start(fitted.explanation.shape.nominal) if isinstance(cause.physics, ChainPhysics) else None
    clear = []
    for k, (parameter, error) in enumerate(zip(cause.physics.parameters, spread, strict=True)):
        if parameter.logarithmic:
            clear.append(error * parameter.unit_step < 1 / CLEAR)
        else:
            zero = 0.0 if absent is None else float(absent[k])
            clear.append(abs(float(cause.values[k]) - zero) > CLEAR * error * parameter.unit_step)
    return any(clear) if isinstance(cause.physics, ChainPhysics) else clear[0]


def _mending(option: _Option, current: Fit) -> float:
    """Share of the evidence so far that a further cause needs."""
    laws = [cause.direction for cause in current.explanation.causes if cause.direction is not None]
    if not laws:
        return SMALL
    new = None if option.name == "missing_mode" else option.fitted.explanation.causes[-1].direction
    apart = new is not None and all(abs(float(new @ old)) < SAME_JOINT for old in laws)
    return AFTER_A_LAW / 2 if apart else AFTER_A_LAW


def _describe(option: _Option, current: Fit) -> AcceptedCause:
    evidence = current.score - option.fitted.score
    if option.name == "missing_mode":
        return accepted_mode(option.fitted, evidence)
    return accepted_cause(option.fitted, option.location, evidence)
