"""The diagnosis: plain faults, linear refit, one cause after the other, and a decision that may be to abstain."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from estimation import BandRecording, WindowedSpectrum, windowed_spectrum
from modal_fit import ModalModel

from ...faults.fault_repair import repair_plain_faults, with_tones_settled
from ...inference.diagnosis import AcceptedCause, Candidate, Diagnosis
from ...inference.verdict import verdict_of
from ...models.fitting import Fit, fit
from ...models.hypothesis import Explanation
from ...models.linear_part import with_linear_part
from ...models.model_shape import LabError, ModelShape
from ...physics import ChainPhysics, JointPhysics, Physics, library
from ...records.compared_band import compared_band
from ...records.true_forces import without_force_noise
from ...remainder.beyond_model import beyond_model
from ...remainder.leftover import Leftover, leftover
from ...screening.search_round import Round, fitted_options
from .acceptance import LEAST_EVIDENCE, Option, gains, impossible, plainest, worth_it
from .confirmed import confirmed
from .form_spread import with_form_spread
from .held_out import Recordings, held_out_improvement, scored
from .pruning import pruned
from .reporting_numbers import accepted_cause, accepted_mode, modal_deviation, with_final_numbers
from .settling import settled

Real = NDArray[np.float64]
Progress = Callable[[str], None]

MOST_CAUSES = 3

FIRST_FIT = 30
"""Steps at most of the modal parameters: a nominal model may be far off."""

AGAIN = 0.7
"""Of what moved with the signal when joint laws were tried in vain: they are tried again when no more is left, or when
nothing else explains more."""

MOSTLY = 0.5
"""Share of a force's power that must be left when its noise is taken out."""


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


def diagnose(
    model: ModalModel, trials: Sequence[BandRecording], settings: Settings | None = None, watch: Progress | None = None
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
    # matrices are small: threads inside the linear algebra only get in each other's way
    with threadpool_limits(1, user_api="blas"):
        return _diagnosed(model, trials, settings or Settings(), watch or (lambda text: None))


def _diagnosed(model: ModalModel, trials: Sequence[BandRecording], settings: Settings, tell: Progress) -> Diagnosis:
    """One step after the other."""
    causes = settings.causes if settings.causes is not None else library()
    decay = float((-model.poles.real).min())
    bands = [compared_band(model, trial.rate) for trial in trials]
    lines = [windowed_spectrum(trial, band.edges, decay) for trial, band in zip(trials, bands, strict=True)]
    tell("modal parameters")
    nominal = Explanation(ModelShape(model, settings.lab), np.zeros(ModelShape(model, settings.lab).size))
    base = fit(lines, nominal, iterations=FIRST_FIT)
    lines, base = _with_true_forces(lines, base)
    tell("tones and clipping")
    whole = lines
    lines, base, faults = repair_plain_faults(lines, base)
    search = _search(lines, base, faults, causes, tell)
    tell("held-out recording")
    recordings = Recordings(lines, whole)
    (steps, accepted), rejected, held_out = confirmed(recordings, search.steps, search.accepted)
    current, candidates = steps[-1], search.candidates + rejected
    tell("what is left")
    told = with_form_spread(current, lines)
    accepted = with_tones_settled(current, whole, with_final_numbers(told, accepted), decay)
    elsewhere = held_out.linear, held_out.improved
    held_out = scored(recordings, elsewhere, current.noises, accepted)
    deviation = _deviation(lines, told)
    if deviation is not None:
        accepted.append(deviation)
    left = leftover(current.explanation, lines)
    verdict = verdict_of(current, accepted, left, search.before, held_out.improvement)
    if verdict == "unexplained":
        candidates += [Candidate(one.name, one.evidence, "rejected", one.location) for one in accepted]
        accepted, current, left = [], base, search.before
        held_out = held_out_improvement(Recordings(whole, whole), base.explanation, base.noises)
    return Diagnosis(
        verdict,
        tuple(accepted),
        tuple(sorted(candidates, key=lambda one: -one.evidence)),
        search.equivalents if accepted else (),
        held_out.improvement,
        left.share,
        base,
        current,
        tuple(lines),
        (held_out.linear, held_out.improved),
        band=max(bands, key=lambda band: band.high),
        doubts=beyond_model(base.explanation, lines),
        measured=tuple(whole),
    )


def _with_true_forces(lines: list[WindowedSpectrum], base: Fit) -> tuple[list[WindowedSpectrum], Fit]:
    """Forces as measured, with the noise that the first fit found taken out, or with that of their quietest lines.

    The likelihood chooses, and must gain as much as a cause: hum on the responses hides how noisy the forces are, and
    forces may have no noise at all.
    """
    found = [(lines, base)]
    estimated = [np.exp(noise.forces) for noise in base.noises]
    for variances in (estimated, [np.full(len(variance), np.inf) for variance in estimated]):
        weighed = [without_force_noise(one, variance) for one, variance in zip(lines, variances, strict=True)]
        if all(_mostly_kept(one, before) for one, before in zip(weighed, lines, strict=True)):
            found.append((weighed, fit(weighed, base.explanation, base.noises)))
    best = min(found, key=lambda pair: pair[1].score)
    return best if best[1].score < base.score - LEAST_EVIDENCE else found[0]


def _mostly_kept(lines: WindowedSpectrum, before: WindowedSpectrum) -> bool:
    """Whether most of every force's power is left: else its quietest lines were not those without force."""
    left, had = (np.sum(np.abs(one.force_here) ** 2, axis=0) for one in (lines, before))
    return bool((left > MOSTLY * had).all())


@dataclass(frozen=True)
class _Search:
    """The search for causes: fits without any, with the first, and so on."""

    steps: list[Fit]
    accepted: list[AcceptedCause]
    candidates: list[Candidate]
    equivalents: tuple[str, ...]
    before: Leftover


def _search(
    lines: list[WindowedSpectrum], base: Fit, faults: list[AcceptedCause], causes: dict[str, Physics], tell: Progress
) -> _Search:
    """One cause after the other, while each is worth it."""
    current, accepted, steps = base, list(faults), [base]
    candidates: list[Candidate] = []
    equivalents: tuple[str, ...] = ()
    moving = before = leftover(base.explanation, lines)
    in_vain = np.inf
    while len(steps) <= MOST_CAUSES:
        tell(f"causes, round {len(steps)}")
        spared = moving.power >= AGAIN * in_vain
        one = fitted_options(lines, current, base, _linear(causes) if spared else causes, (moving, before))
        candidates += one.weighed
        if spared and _best(one, current) is None:
            one = fitted_options(lines, current, base, _laws(causes), (moving, before))
            candidates += one.weighed
        best = _best(one, current)
        if best is None:
            break
        best = replace(best, fitted=settled(lines, best.fitted))
        if not worth_it(best, current, base, lines):
            break
        line = best.fitted.score + LEAST_EVIDENCE / 2
        rivals = [
            option.name
            for option in one.options
            if option.name != best.name and option.fitted.score < line and not impossible(option)
        ]
        equivalents = equivalents or tuple(dict.fromkeys(rivals))
        accepted.append(_describe(best, current))
        failed = one.sighted and not any(_gaining_law(option, current) for option in one.options)
        current = best.fitted
        if failed and all(cause.direction is None for cause in current.explanation.causes):
            in_vain = moving.power
        moving = leftover(current.explanation, lines)
        steps.append(current)
    tell("causes made needless")
    steps, accepted, rejected = pruned(lines, steps, accepted)
    return _Search(steps, accepted, candidates + rejected, equivalents, before)


def _best(one: Round, current: Fit) -> Option | None:
    best = plainest([option for option in one.options if not impossible(option)])
    return best if best is not None and gains(best, current) else None


def _gaining_law(option: Option, current: Fit) -> bool:
    """Whether a joint's law gained something, though another cause may have gained more."""
    causes = option.fitted.explanation.causes
    return bool(causes) and causes[-1].direction is not None and gains(option, current)


def _linear(causes: dict[str, Physics]) -> dict[str, Physics]:
    return {name: one for name, one in causes.items() if isinstance(one, ChainPhysics)}


def _laws(causes: dict[str, Physics]) -> dict[str, Physics]:
    return {name: one for name, one in causes.items() if isinstance(one, JointPhysics)}


def _deviation(lines: list[WindowedSpectrum], current: Fit) -> AcceptedCause | None:
    """Modal parameters that are off by more than a lab's error, and not by the linear part of a joint's law."""
    found = modal_deviation(current)
    causes = current.explanation.causes
    if found is None or all(cause.direction is None for cause in causes):
        return found
    freed = tuple(with_linear_part(cause) if cause.direction is not None else cause for cause in causes)
    again = fit(lines, replace(current.explanation, causes=freed), current.noises, iterations=20)
    return found if modal_deviation(again) is not None else None


def _describe(option: Option, current: Fit) -> AcceptedCause:
    evidence = current.score - option.fitted.score
    if option.name == "missing_mode":
        return accepted_mode(option.fitted, evidence)
    return accepted_cause(option.fitted, option.location, evidence)
