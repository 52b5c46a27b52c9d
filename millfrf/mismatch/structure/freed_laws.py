"""Joint laws of free form: fit, test on held-out data, and sentences."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ..faults.clipping_repair import residual_lines
from ..inference.diagnosis import AcceptedCause, Improvement, error_halved
from ..inference.search import Proposal, in_processes
from ..inference.settings import Settings
from ..joints.joint_axis import joint_in_words, tip_axes
from ..models.fitting import Fit, converged_gain, fit
from ..models.hypothesis import Hypothesis
from ..models.misfit import fitted_noise, through_structure
from ..models.model_terms import with_free_forms
from ..physics.linear_causes import MODAL_PARAMETERS
from ..physics.protocol import JointPhysics, reported_name
from ..physics.wider_forms import families
from ..records.bands import Recordings
from ..screening.joint_laws_fitted import law_on_estimated_motion
from .acceptance import impossible, plausible_proposals, undetermined_beyond_limits
from .answer import Answer, without_names
from .comparison import StructureComparison
from .form_of_law import FormOfLaw, form_of_law
from .held_out import HeldOut, chance_of_no_gain, held_out_improvement
from .moved_modes import modal_deviation
from .noise_bounds import with_bounded_noise
from .prediction import offered_model
from .rounds import likeliest_on_motion
from .structured_residual import remainder_of

# A law is not the one that it names if it leaves more than this share of the power of the force, and if their exponents
# of growth from recording to recording differ by more: dry friction that falls with speed by 90 % grows with -0.25
# instead of 0, a drag that falls with 1.5 instead of the 0.4 of the friction that imitates it
UNDESCRIBED, OTHER_GROWTH = 0.1, 0.5

STEPS = 25  # steps at most of a fit with free forms

# share of the evidence of all causes that a fit with all shapes must gain over a fit with shapes of the law's family
ALL_SHAPES_GAIN = 0.05

ALL_SHAPES = "xvm"  # shapes over deflection, velocity and memory


@dataclass(frozen=True)
class FreedLaws:
    """Laws of free form and their held-out errors."""

    fitted: Fit  # fit with laws of free form
    library_hypothesis: Hypothesis
    held_out: HeldOut
    rival: Improvement  # held-out errors of the rival: the named laws, or refitted modes alone
    chance: float  # p-value of no improvement by the free form, from a test over blocks of time
    evidence: float  # gain in score over the rival
    names: tuple[tuple[str, str], ...]
    forms: tuple[FormOfLaw, ...]  # comparison of the force of each joint with the named law

    @property
    def misnamed(self) -> str:
        """Sentence on a named friction or damping that neither describes its force nor grows as it does; else empty.

        Several laws share their forces among each other, so that the form of each alone says nothing. A spring with a
        gap or a knee of its own size grows with any power.
        """
        if len(self.forms) > 1 or not self.library_hypothesis.laws[0].law().loses_energy:
            return ""
        [(name, _)], [form] = self.names, self.forms
        if not (form.distance**2 > UNDESCRIBED and abs(form.growth - form.law_growth) > OTHER_GROWTH):
            return ""
        return (
            f"{name} describes {100 * (1 - form.distance**2):.0f} % of the power of the joint's force, which grows as "
            f"the deflection to the power {form.growth:.2g} (the law: {form.law_growth:.2g}): the law is another one"
        )

    @property
    def ratio(self) -> float:
        """Ratio of the held-out errors: rival over free form."""
        return self.rival.after / max(self.held_out.everywhere.after, 1e-300)

    @property
    def against_modes(self) -> Improvement:
        """Errors over all held-out data, compared with the errors of the rival."""
        return replace(self.held_out.everywhere, refitted=self.rival.after, against="refitted")

    def content(self) -> dict[str, Any]:
        """Return the entry for the file of a diagnosis."""
        rows = [
            {
                "law": name,
                "place": place,
                "distance": form.distance,
                "by_deflection": form.by_deflection,
                "by_velocity": form.by_velocity,
                "power_lost": form.lost,
                "growth": form.growth,
                "kind": form.kind,
            }
            for (name, place), form in zip(self.names, self.forms, strict=True)
        ]
        errors = {"compared": self.rival.after, "free_form": self.held_out.everywhere.after}
        return {"laws": rows, "held_out": errors, "chance_of_no_gain": self.chance, "evidence": self.evidence}


@dataclass(frozen=True)
class FreeFormStart:
    """Fits and errors before the laws get a free form."""

    fitted: Fit  # the fit with laws of the library
    base: Fit  # fit of modes alone
    held_out: HeldOut
    places: tuple[Mapping[str, Any], ...]  # location of each law, as a diagnosis states it


def free_named_laws(
    recordings: Recordings, start: FreeFormStart, faults: Sequence[AcceptedCause], settings: Settings
) -> FreedLaws | None:
    """Give the named laws a free form; return None if the held-out data do not require it.

    The free form must gain at least a hundredth of the evidence of all causes.
    """
    named, held_out = start.fitted, start.held_out
    if not named.hypothesis.laws or not recordings.tested:
        return None
    total = start.base.score - named.score
    needed = max(settings.evidence.least, settings.evidence.small * total)
    own_family, everything = _fitted(recordings, named, total)
    better = everything is not None and everything.score < own_family.score - ALL_SHAPES_GAIN * total
    for freed in (everything, own_family) if better else (own_family,):
        if freed is None or not freed.score < named.score - needed:
            continue
        noises = with_bounded_noise(freed, recordings.repaired).noises
        errors = held_out_improvement(
            recordings,
            freed.hypothesis,
            noises,
            faults,
            settings.proof,
            held_out.linear,
        )
        chance = _chance(recordings, named, (held_out.improved, errors.improved), settings)
        if errors.leaves_less_than(held_out) and chance < settings.proof.significance:
            return _with_forms(recordings, start, freed, errors, (held_out.everywhere, chance))
    return None


def free_unproved_law(
    recordings: Recordings, law_start: FreeFormStart, faults: Sequence[AcceptedCause], settings: Settings
) -> FreedLaws | None:
    """Give a free form to a law that was not proved; return None if it does not halve the error of modes alone."""
    if not recordings.tested:
        return None
    best: FreedLaws | None = None
    start, fitted = law_start.fitted, law_start.fitted
    for kinds in ("", ALL_SHAPES):
        freed = fit(recordings.repaired, with_free_forms(start.hypothesis, kinds), start.noises, iterations=STEPS)
        if not np.isfinite(freed.score) or freed.score >= fitted.score - settings.evidence.least:
            continue
        noises = with_bounded_noise(freed, recordings.repaired).noises
        errors = held_out_improvement(
            recordings,
            freed.hypothesis,
            noises,
            faults,
            settings.proof,
            law_start.held_out.linear,
        )
        gain, all_errors = errors.improvement, errors.everywhere
        significant = gain.evidence > settings.proof.gain and gain.p_value < settings.proof.significance
        modes = min(all_errors.refitted, all_errors.before)
        halved = all_errors.after**2 <= (1 - settings.verdict.partly) * modes**2
        if not (significant and halved and gain.after <= min(gain.refitted, gain.before)):
            continue
        if best is None or all_errors.after < best.held_out.everywhere.after:
            freed_laws = _with_forms(
                recordings, law_start, freed, errors, (replace(all_errors, after=modes), gain.p_value)
            )
            best = None if freed_laws is None else replace(freed_laws, evidence=law_start.base.score - freed.score)
            fitted = freed
    return best


def _fitted(recordings: Recordings, named: Fit, gained: float) -> tuple[Fit, Fit | None]:
    """Return a fit with shapes of the family of each law, and a fit with all shapes.

    The second fit is None if all laws are drifts, which have no other shapes. A fit ends when a step gains less than a
    small share of the evidence ``gained``.
    """
    drifts = all(families(cause.law()) == "t" for cause in named.hypothesis.laws)
    starts = [with_free_forms(named.hypothesis, kinds) for kinds in (("",) if drifts else ("", ALL_SHAPES))]
    lines, least = recordings.repaired, converged_gain(gained)
    tasks = [partial(fit, lines, start, named.noises, iterations=STEPS, tolerance=least) for start in starts]
    fits = in_processes(tasks)
    return fits[0], fits[1] if len(fits) > 1 else None


def _chance(recordings: Recordings, named: Fit, hypotheses: tuple[Hypothesis, Hypothesis], settings: Settings) -> float:
    """Return the p-value that the second of two hypotheses predicts the held-out data no better than the first."""
    held_out = recordings.held_out(recordings.repaired)
    noise = named.noises[recordings.held_out_place]
    covariance = fitted_noise(held_out, through_structure(named.hypothesis, held_out), noise)
    rival, final = (residual_lines(hypothesis, held_out) for hypothesis in hypotheses)
    return chance_of_no_gain(held_out, covariance, rival, final, settings.proof)


def _with_forms(
    recordings: Recordings, start: FreeFormStart, freed: Fit, errors: HeldOut, rival: tuple[Improvement, float]
) -> FreedLaws | None:
    """Return a fit of free form with its comparison to the laws; None if a joint would add energy to the motion."""
    named, laws = start.fitted.hypothesis, freed.hypothesis.laws
    forms = tuple(form_of_law(freed.hypothesis, named, k, recordings.repaired) for k in range(len(laws)))
    if any(cause.law().loses_energy and form.lost < 0 for cause, form in zip(laws, forms, strict=True)):
        return None
    directed = any("direction" in place for place in start.places)
    axes = tip_axes(freed.hypothesis.model)[2] if directed else ()
    descriptions = [joint_in_words(place, axes if "direction" in place else ()) for place in start.places]
    names = tuple((reported_name(law.physics), place) for law, place in zip(laws, descriptions, strict=True))
    return FreedLaws(freed, named, errors, *rival, start.fitted.score - freed.score, names, forms)


@dataclass(frozen=True)
class FreedAnswer:
    """A result, and the laws of free form with which its model predicts."""

    answer: Answer  # result; its final fit and errors are those of the free form if there is one
    freed: FreedLaws | None = None  # laws of free form; None if held-out data do not require them
    sentence: str = ""  # description of the free form; empty if there is none
    doubt: str = ""  # why the result is incomplete; empty if it is not

    @property
    def textbook(self) -> Hypothesis | None:
        """The hypothesis with laws of the library; None if no law has a free form."""
        return None if self.freed is None else self.freed.library_hypothesis

    def content(self) -> dict[str, Any] | None:
        """Return the entry for the file of a diagnosis; None if there is no free form."""
        return None if self.freed is None else {**self.freed.content(), "sentence": self.sentence}


def freed_answer(
    answer: Answer, comparison: StructureComparison, recordings: Recordings, faults: Sequence[AcceptedCause]
) -> FreedAnswer:
    """Give the laws of a result a free form; if no law was proved, give it to the likeliest law.

    A named law keeps its name. If its free form has a far smaller error, ``explained`` becomes ``partly explained``. If
    no law was proved, the result describes the force, and the improved model predicts with it; the verdict is
    ``unlisted`` if the force removes as much of the held-out error as a partial explanation must.
    """
    settings, base = comparison.settings, answer.search.base
    if answer.verdict == "unexplained":
        likely = _likely_laws(answer, comparison)
        best = _best_freed(likely, answer, recordings, faults, settings)
        if best is None and likely:
            laws = [physics for physics in comparison.causes.values() if isinstance(physics, JointPhysics)]
            screened = law_on_estimated_motion(recordings.repaired, base, laws, settings)
            best = _best_freed([] if screened is None else [screened], answer, recordings, faults, settings)
        if best is None:
            return FreedAnswer(answer)
        freed_result = _with(answer, best, recordings)
        if not answer.another_structure and _predicts(best, recordings, faults, settings):
            freed_result = replace(freed_result, verdict="unlisted")
        return FreedAnswer(freed_result, best, _unnamed_sentence(best, freed_result.verdict))
    if undetermined := undetermined_beyond_limits(answer.final.hypothesis, answer.causes):
        return _unnamed(undetermined, answer, comparison, recordings, faults)
    places = tuple(
        proposal.location
        for proposal in answer.search.accepted
        if proposal.fitted.hypothesis.causes[-1].axis is not None
    )
    freed = free_named_laws(recordings, FreeFormStart(answer.final, base, answer.held_out, places), faults, settings)
    if freed is None:
        return FreedAnswer(answer)
    if misnamed := freed.misnamed:
        return _unnamed(misnamed, answer, comparison, recordings, faults)
    freed_result, doubt = _with(answer, freed, recordings), ""
    if modal_deviation(freed.fitted) is None:  # modes may deviate only because the form of the law is not exact
        causes = tuple(cause for cause in answer.causes if cause.name != MODAL_PARAMETERS.name)
        freed_result = replace(freed_result, causes=causes)
    if answer.verdict == "explained" and freed.ratio > settings.verdict.most_over_free:
        freed_result = replace(freed_result, verdict="partly explained")
        doubt = (
            f"the named law leaves {freed.ratio:.2g} times as much of what was held out as its free form; "
            "the law's name does not describe all of the force"
        )
    return FreedAnswer(freed_result, freed, _comparison_sentence(freed), doubt)


def _unnamed(
    doubt: str,
    answer: Answer,
    comparison: StructureComparison,
    recordings: Recordings,
    faults: Sequence[AcceptedCause],
) -> FreedAnswer:
    """Return the result without its names, with a force of free form if held-out data prove it, and the doubt."""
    unnamed = freed_answer(without_names(answer, comparison, recordings), comparison, recordings, faults)
    return replace(unnamed, doubt=doubt)


def _best_freed(
    proposals: Sequence[Proposal[Fit]],
    answer: Answer,
    recordings: Recordings,
    faults: Sequence[AcceptedCause],
    settings: Settings,
) -> FreedLaws | None:
    """Give each unproved law a free form, and return the one with the lowest score; None if none is proved."""
    starts = [
        FreeFormStart(proposal.fitted, answer.search.base, answer.held_out, (proposal.location,))
        for proposal in proposals
    ]
    freed = [free_unproved_law(recordings, start, faults, settings) for start in starts]
    return min((laws for laws in freed if laws is not None), key=lambda laws: laws.fitted.score, default=None)


def _predicts(freed: FreedLaws, recordings: Recordings, faults: Sequence[AcceptedCause], settings: Settings) -> bool:
    """Return whether a force of free form explains what a partial explanation must, and its model is offered."""
    hypothesis, gain = freed.fitted.hypothesis, freed.held_out.improvement
    offer = offered_model("unlisted", hypothesis, recordings.measured, faults, gain)
    return error_halved(freed.against_modes, settings.verdict) and not offer.nominal


def _likely_laws(answer: Answer, comparison: StructureComparison) -> list[Proposal[Fit]]:
    """Return the laws from which a free form may start: the law with most evidence, and the law that fits the motion.

    The latter has the largest screened gain on the estimated motion. The free simulation of a law with a wrong form may
    reject the right family, which the estimated motion still shows.
    """
    if not answer.search.rounds:
        return []
    first_round = answer.search.rounds[0]
    laws = [
        proposal
        for proposal in first_round.proposals
        if proposal.name in comparison.laws and np.isfinite(proposal.fitted.score)
    ]
    alone = sorted(
        (proposal for proposal in laws if len(proposal.fitted.hypothesis.causes) == 1), key=lambda law: -law.evidence
    )
    best = plausible_proposals(alone, comparison.settings.evidence)[:1]
    likeliest = likeliest_on_motion(first_round.candidates, comparison.laws)
    rival = [
        proposal for proposal in alone if proposal.name == likeliest and all(proposal is not known for known in best)
    ][:1]
    return [proposal for proposal in best + rival if not impossible(proposal, comparison.settings.evidence)]


def _with(answer: Answer, freed: FreedLaws, recordings: Recordings) -> Answer:
    """Return the result with the fit, held-out errors and structured residual of the free form."""
    left = remainder_of(freed.fitted.hypothesis, recordings.repaired)
    return replace(answer, final=freed.fitted, held_out=freed.held_out, left=left)


def _comparison_sentence(freed: FreedLaws) -> str:
    """Describe the free form of named laws."""
    parts = [
        f"the force of {name}{f' ({place})' if place else ''} differs from the textbook law by "
        f"{100 * form.distance:.2g} % of its size"
        for (name, place), form in zip(freed.names, freed.forms, strict=True)
    ]
    return f"Free form: {', and '.join(parts)}; {_errors(freed, 'the textbook law')}."


def _unnamed_sentence(freed: FreedLaws, verdict: str) -> str:
    """Describe a free form if no law was proved."""
    (name, place), form = freed.names[0], freed.forms[0]
    if verdict == "unlisted":
        growth = f", and it grows as the deflection to the power {form.growth:.2g}" if np.isfinite(form.growth) else ""
        return (
            f"Outside the library: a force sits in a joint{f' ({place})' if place else ''}; it is {form.kind}{growth}. "
            f"Nearest law: {name}, from which it differs by {100 * form.distance:.2g} % of its size. Free form: "
            f"{_errors(freed, 'a model of modes alone')}."
        )
    return (
        f"Free form: no law of the library is proved, but the force of a joint{f' ({place})' if place else ''} is: "
        f"{form.kind}. Begun at {name}, from which it differs by {100 * form.distance:.2g} % of its size, "
        f"{_errors(freed, 'a model of modes alone')}."
    )


def _errors(freed: FreedLaws, rival: str) -> str:
    """Describe the held-out errors of the free form and of its rival."""
    after, before = freed.held_out.everywhere.after, freed.rival.after
    return (
        f"it leaves {100 * after:.3g} % of what was held out, {rival} {100 * before:.3g} % "
        f"(chance that this is no gain: {freed.chance:.2g}); the improved model holds it"
    )
