"""Joint laws of free form, accepted where held-out data confirm them, and their distance from textbook laws."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from estimation import WindowedSpectrum
from millfrf.core import Real

from ..faults.clipping_repair import residual_lines
from ..inference.diagnosis import AcceptedCause, Improvement
from ..inference.process_pool import in_processes
from ..inference.settings import Settings
from ..joints.joint_axis import joint_in_words, tip_axes
from ..joints.joint_simulation import driven_force
from ..models.fitting import Fit, fit
from ..models.hypothesis import Hypothesis, predict_lines
from ..models.misfit import fitted_noise, through_structure
from ..models.model_terms import with_free_forms
from ..models.refinement import gain_at_rest
from ..physics.free_form import families
from ..physics.protocol import answer_name
from ..records.held_out_parts import Recordings
from .held_out import HeldOut, chance_of_no_gain, held_out_improvement

BINS = 201
"""Number of bins of deflection or velocity, evenly wide, in which means of the force are taken."""

MOSTLY = 0.8
"""Share of the force's power from which it is said to follow one quantity."""


@dataclass(frozen=True)
class FormOfLaw:
    """A joint's force of free form beside a textbook law, both along the motion of the free form.

    A linear spring and damper are taken off both: they cannot be told from the structure's own.

    Parameters
    ----------
    distance
        Share of the force's root mean square that the textbook law cannot give with any amplitude, 0 to 1.
    by_deflection, by_velocity
        Shares of the force's power that a function of the deflection alone, and of the velocity alone, gives.
    lost
        Share of the power that the force could take from the motion, which it takes: 1 for a force that is in phase
        with the velocity, 0 for a spring; negative for one that feeds the motion.
    """

    distance: float
    by_deflection: float
    by_velocity: float
    lost: float

    @property
    def kind(self) -> str:
        """What the force is: ``elastic``, ``dissipative``, or neither alone.

        Examples
        --------
        >>> FormOfLaw(0.1, 0.95, 0.02, 0.01).kind
        'elastic: it follows the deflection'
        >>> FormOfLaw(0.1, 0.02, 0.9, 0.8).kind
        'dissipative: it follows the velocity'
        """
        if self.by_deflection > MOSTLY:
            return "elastic: it follows the deflection"
        if self.by_velocity > MOSTLY:
            return "dissipative: it follows the velocity"
        return "one with memory, or elastic and dissipative at once"


def form_of_law(free: Hypothesis, named: Hypothesis, place: int, lines: Sequence[WindowedSpectrum]) -> FormOfLaw:
    """Compare a law of free form with the law that it frees.

    Parameters
    ----------
    free, named
        Hypotheses with the same joints in the same order.
    place
        Number of the joint among the laws.
    lines
        Windowed spectra of the recordings, whose motion is followed.
    """
    parts = [_forces(free, named, place, one) for one in lines]
    x, v, force, law = (np.concatenate([part[k] for part in parts]) for k in range(4))
    linear = np.stack([x, v], axis=1)
    bent = _without(force, linear)
    size = float(bent @ bent)
    if size <= 0.0:
        return FormOfLaw(0.0, 0.0, 0.0, 0.0)
    other = _without(law, linear)
    missing = _without(bent, other[:, None]) if float(other @ other) > 0 else bent
    return FormOfLaw(
        float(np.sqrt(missing @ missing / size)),
        _followed(x, bent) / size,
        _followed(v, bent) / size,
        float(force @ v / np.sqrt((force @ force) * (v @ v))),
    )


def _forces(free: Hypothesis, named: Hypothesis, place: int, lines: WindowedSpectrum) -> tuple[Real, Real, Real, Real]:
    """Deflection (m), velocity (m/s) and the forces of both laws along them (N), each (n_samples,)."""
    answer = predict_lines(free, lines).joints[place]
    often = len(answer.deflection) // lines.padded
    n = often * len(lines.recording.force)
    x, v = answer.deflection[:n], answer.velocity[:n]
    force, law = (driven_force(lines, x, v, one.laws[place].law(), often=often) for one in (free, named))
    return x[::often], v[::often], force[::often], law[::often]


def _without(signal: Real, others: Real) -> Real:
    """A signal (n,) less its projection on others (n, k)."""
    sizes = np.sqrt(np.sum(others**2, axis=0))
    units = others / np.where(sizes > 0, sizes, 1.0)
    return np.asarray(signal - units @ np.linalg.lstsq(units, signal, rcond=None)[0])


def _followed(values: Real, force: Real) -> float:
    """Power of a force that its means in bins of some values give."""
    edges = np.linspace(values.min(), values.max(), BINS + 1)
    place = np.digitize(values, edges[1:-1])
    count = np.maximum(np.bincount(place, minlength=BINS), 1)
    means = np.bincount(place, force, BINS) / count
    return float(np.sum(count * means**2))


STEPS = 25
"""Steps at most of a fit with free forms."""

MORE = 0.05
"""Share of the evidence of all causes that shapes beyond a law's own family must gain over those of its family."""

ALL_SHAPES = "xvm"
"""Shapes over deflection, velocity and memory."""


@dataclass(frozen=True)
class FreedLaws:
    """Laws whose form is free, and what they are worth.

    Parameters
    ----------
    fitted
        The fit with laws of free form.
    begun
        The hypothesis with laws as the library has them, from which the forms were freed.
    held_out
        What it is worth on data that were held out.
    beside
        Errors of what it is compared with: the named laws, or refitted modes alone.
    chance
        p-value over blocks of time that the free form is no better there.
    evidence
        Gain in score over what it is compared with.
    names
        Name of the law that each joint's form began with, and its place in words.
    forms
        How far each joint's force lies from that law, and what it follows.
    """

    fitted: Fit
    begun: Hypothesis
    held_out: HeldOut
    beside: Improvement
    chance: float
    evidence: float
    names: tuple[tuple[str, str], ...]
    forms: tuple[FormOfLaw, ...]

    @property
    def ratio(self) -> float:
        """Error held out of what it is compared with over its own."""
        return self.beside.after / max(self.held_out.everywhere.after, 1e-300)

    def content(self) -> dict[str, Any]:
        """What the file of a diagnosis says of it."""
        rows = [
            {
                "law": name,
                "place": place,
                "distance": form.distance,
                "by_deflection": form.by_deflection,
                "by_velocity": form.by_velocity,
                "power_lost": form.lost,
                "kind": form.kind,
            }
            for (name, place), form in zip(self.names, self.forms, strict=True)
        ]
        errors = {"compared": self.beside.after, "free_form": self.held_out.everywhere.after}
        return {"laws": rows, "held_out": errors, "chance_of_no_gain": self.chance, "evidence": self.evidence}


@dataclass(frozen=True)
class Beginning:
    """Where a free form begins, and what it is compared with.

    Parameters
    ----------
    fitted
        The fit with laws of the library.
    base
        The fit of modes alone, without any cause.
    held_out
        What is known of the held-out data: of the named laws, or of modes alone where no law was proved.
    places
        Location of each law, as a diagnosis states it.
    """

    fitted: Fit
    base: Fit
    held_out: HeldOut
    places: tuple[Mapping[str, Any], ...]


def freed_from_named(
    recordings: Recordings, begun: Beginning, faults: Sequence[AcceptedCause], settings: Settings
) -> FreedLaws | None:
    """Free the form of named laws; None where the data held out do not ask for it.

    The free form must gain a hundredth of the evidence that all causes have together.

    Parameters
    ----------
    recordings
        The recordings, mended and as measured.
    begun
        The named laws, and what they are worth.
    faults
        Faults of the recordings, which predictions show again.
    settings
        Thresholds of the diagnosis.
    """
    named, held_out = begun.fitted, begun.held_out
    if not named.hypothesis.laws or not recordings.tested:
        return None
    whole = begun.base.score - named.score
    needed = max(settings.evidence.least, settings.evidence.small * whole)
    own, everything = _fitted(recordings, named, whole)
    better = everything is not None and everything.score < own.score - MORE * whole
    for freed in (everything, own) if better else (own,):
        if freed is None or not freed.score < named.score - needed:
            continue
        there = held_out_improvement(
            recordings, freed.hypothesis, freed.noises, faults, settings.proof, held_out.linear
        )
        chance = _chance(recordings, named, (held_out.improved, there.improved), settings)
        if there.leaves_less_than(held_out) and chance < settings.proof.significance:
            return _told(recordings, begun, freed, there, (held_out.everywhere, chance))
    return None


def freed_from_nothing(
    recordings: Recordings, begun: Beginning, faults: Sequence[AcceptedCause], settings: Settings
) -> FreedLaws | None:
    """Free the form of a law that was not proved; None where that leaves more than half of what modes alone leave.

    Parameters
    ----------
    recordings
        The recordings, mended and as measured.
    begun
        The law at which the form begins, and what modes alone are worth.
    faults
        Faults of the recordings, which predictions show again.
    settings
        Thresholds of the diagnosis.
    """
    if not recordings.tested:
        return None
    best: FreedLaws | None = None
    start, fitted = begun.fitted, begun.fitted
    for kinds in ("", ALL_SHAPES):
        tried = fit(recordings.mended, with_free_forms(start.hypothesis, kinds), start.noises, iterations=STEPS)
        if not np.isfinite(tried.score) or tried.score >= fitted.score - settings.evidence.least:
            continue
        worth = held_out_improvement(
            recordings, tried.hypothesis, tried.noises, faults, settings.proof, begun.held_out.linear
        )
        gain, whole = worth.improvement, worth.everywhere
        sure = gain.evidence > settings.proof.gain and gain.p_value < settings.proof.significance
        modes = min(whole.refitted, whole.before)
        halved = whole.after**2 <= (1 - settings.verdict.partly) * modes**2
        if not (sure and halved and gain.after <= min(gain.refitted, gain.before)):
            continue
        if best is None or whole.after < best.held_out.everywhere.after:
            told = _told(recordings, begun, tried, worth, (replace(whole, after=modes), gain.p_value))
            best = None if told is None else replace(told, evidence=begun.base.score - tried.score)
            fitted = tried
    return best


def _fitted(recordings: Recordings, named: Fit, whole: float) -> tuple[Fit, Fit | None]:
    """Fits with shapes of each law's own family, and with all shapes; a drift alone has no others.

    Many shapes gain a little for many steps: a fit ends where that is no more than a share of the ``whole`` evidence.
    """
    drifts = all(families(cause.law()) == "t" for cause in named.hypothesis.laws)
    starts = [with_free_forms(named.hypothesis, kinds) for kinds in (("",) if drifts else ("", ALL_SHAPES))]
    lines, least = recordings.mended, gain_at_rest(whole)
    tasks = [partial(fit, lines, one, named.noises, iterations=STEPS, tolerance=least) for one in starts]
    found = in_processes(tasks)
    return found[0], found[1] if len(found) > 1 else None


def _chance(recordings: Recordings, named: Fit, both: tuple[Hypothesis, Hypothesis], settings: Settings) -> float:
    """Chance that the second of two hypotheses predicts what was held out no better than the first."""
    here = recordings.held_out(recordings.mended)
    noise = named.noises[recordings.held_out_place]
    covariance = fitted_noise(here, through_structure(named.hypothesis, here), noise)
    rival, final = (residual_lines(one, here) for one in both)
    return chance_of_no_gain(here, covariance, rival, final, settings.proof)


def _told(
    recordings: Recordings, begun: Beginning, freed: Fit, worth: HeldOut, beside: tuple[Improvement, float]
) -> FreedLaws | None:
    """A fit of free form with its distance from the laws; None where a joint would feed the motion with power."""
    named, laws = begun.fitted.hypothesis, freed.hypothesis.laws
    forms = tuple(form_of_law(freed.hypothesis, named, k, recordings.mended) for k in range(len(laws)))
    if any(cause.law().loses_energy and form.lost < 0 for cause, form in zip(laws, forms, strict=True)):
        return None
    directed = any("direction" in one for one in begun.places)
    axes = tip_axes(freed.hypothesis.model)[2] if directed else ()
    words = [joint_in_words(one, axes if "direction" in one else ()) for one in begun.places]
    names = tuple((answer_name(one.physics), place) for one, place in zip(laws, words, strict=True))
    return FreedLaws(freed, named, worth, *beside, begun.fitted.score - freed.score, names, forms)
