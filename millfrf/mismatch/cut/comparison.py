"""Candidates for a computed cutting force, their held-out errors, and the choice of those that are accepted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeVar

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Real

from ..inference.diagnosis import AcceptedCause, Candidate, Improvement, Remainder
from ..inference.numerics import jackknife_variance, ratio_interval, shift_weight
from ..inference.search import Proposal, Round, Search, best_first, equivalents_of
from ..inference.settings import ProofSettings
from .fitting import CutFit, fit_cut, fit_with_tooth_numbers
from .hypothesis import CutHypothesis, MeasuredCut
from .settings import CutSettings

# every second block forms a half: each half is tested with the numbers that were fitted to the other half
FOLDS = (slice(0, None, 2), slice(1, None, 2))

Halves = tuple[CutFit, CutFit]


def fit_halves(cut: MeasuredCut, start: CutHypothesis, freed: Sequence[str], *, refit: bool = True) -> Halves:
    """Fit the same numbers to each half of the blocks and return both fits."""
    first, second = (fit_cut(cut, start, freed, part=part, refit=refit) for part in FOLDS)
    return first, second


def held_out_misfits(halves: Halves) -> Real:
    """Return the misfit of every block under the fit to the other half, (n_blocks of all recordings,)."""
    parts = [
        misfits[part] for fitted, part in zip(halves, FOLDS[::-1], strict=True) for misfits in fitted.block_misfits
    ]
    return np.concatenate(parts)


def held_out_powers(cut: MeasuredCut, halves: Halves) -> Real:
    """Return the residual power of every block under the fit to the other half, (n_blocks of all recordings,), N^2."""
    parts = []
    for fitted, part in zip(halves, FOLDS[::-1], strict=True):
        for k, spectra in enumerate(cut.spectra):
            residual = (spectra.measured - cut.predicted(k, fitted.hypothesis))[part]
            parts.append(np.sum(np.abs(residual) ** 2, axis=(1, 2)))
    return np.concatenate(parts)


def lowers(cut: MeasuredCut, without: Halves, with_it: Halves, proof: ProofSettings) -> bool:
    """Return whether the held-out error of the force is significantly smaller with the causes than without them."""
    falls = float(held_out_powers(cut, with_it).sum()) < float(held_out_powers(cut, without).sum())
    return falls and proof.test(held_out_misfits(without), held_out_misfits(with_it)) < proof.significance


def improvement(cut: MeasuredCut, nominal: Halves, base: Halves, final: Halves, proof: ProofSettings) -> Improvement:
    """Return the held-out errors of three fits and their test; errors are relative to the measured force."""
    before, refitted, after = (held_out_powers(cut, halves) for halves in (nominal, base, final))
    total = sum(float(np.sum(np.abs(spectra.measured) ** 2)) for spectra in cut.spectra)
    floor = sum(noise.floor.sum() * spectra.blocks for noise, spectra in zip(cut.noise, cut.spectra, strict=True))
    plain, better = held_out_misfits(base), held_out_misfits(final)
    names = ", ".join(spectra.recording.name for spectra in cut.spectra)
    return Improvement(
        f"{names}: every other block of time",
        float(np.sqrt(before.sum() / total)),
        float(np.sqrt(refitted.sum() / total)),
        float(np.sqrt(after.sum() / total)),
        float(np.sqrt(floor / total)),
        proof.test(plain, better),
        ratio_interval(before, after),
        float(np.sum(plain - better)),
    )


# number of frequency bands, each of which one fit leaves out: if the form is wrong, the numbers differ between the fits
BANDS = 4


@dataclass(frozen=True)
class FormErrors:
    """Variances, in SI units squared, that the fit of a cause does not include in the errors of its numbers."""

    # variance between the fits to the two halves of the blocks, plus variance between fits that each leave out one of
    # four frequency bands (jackknife), (n_numbers,)
    spread: Real
    form: Real  # largest squared shift when one further cause is free, weighted by its gain, (n_numbers,)


def form_errors(
    cut: MeasuredCut, final: CutFit, halves: Halves, further: Sequence[Proposal[CutFit]]
) -> dict[str, FormErrors]:
    """Return the additional variances of the numbers of every fitted cause, by the cause's name."""
    edges = np.linspace(0, 1, BANDS + 1)
    parts = [
        fit_cut(cut.without_band(float(low), float(high)), final.hypothesis, final.freed)
        for low, high in pairwise(edges)
    ]
    rivals = [proposal.fitted for proposal in further if proposal.fitted.freed[:-1] == final.freed]
    errors = {}
    for name in final.freed:
        values = final.hypothesis.values(name)
        bands, blocks = (
            jackknife_variance(np.array([fit_.hypothesis.values(name) for fit_ in fits])) for fits in (parts, halves)
        )
        shifts = [
            (shift_weight(final.cost - other.cost) * (other.hypothesis.values(name) - values)) ** 2 for other in rivals
        ]
        errors[name] = FormErrors(bands + blocks, np.max([np.zeros(len(values)), *shifts], axis=0))
    return errors


Place = TypeVar("Place", float, str)

MAX_ORDERS = 8  # largest number of reported spindle orders

MIN_SHARE = 0.01  # share of the residual power from which an order or a channel is reported


@dataclass(frozen=True)
class CutRemainder:
    """Residual power of a cut beyond noise and usual error, and its location."""

    left: Remainder  # power of the significant lines, as a share of the residual power, and in N^2
    # spindle orders (multiples of the spindle frequency) with most of this power, strongest first
    orders: tuple[float, ...]
    channels: tuple[str, ...]  # degrees of freedom with significant residual, strongest first


def cut_remainder(cut: MeasuredCut, hypothesis: CutHypothesis, settings: CutSettings) -> CutRemainder:
    """Return power and location of the spectral lines whose residual is significantly above noise.

    A line is significant in a single block or in the mean of all blocks.
    """
    power, total = 0.0, 0.0
    by_order: dict[float, float] = {}
    by_channel: dict[str, float] = {}
    for k, spectra in enumerate(cut.spectra):
        predicted = cut.predicted(k, hypothesis)
        residual_power = np.abs(spectra.measured - predicted) ** 2
        usual_power = (settings.usual_errors * cut.force_error) ** 2 * np.abs(predicted) ** 2
        significant = np.where(
            _is_significant(residual_power, cut.noise[k].floor, usual_power, settings.chance), residual_power, 0.0
        )
        power, total = power + float(significant.sum()), total + float(residual_power.sum())
        rotation = spectra.recording.law.speed / (2 * np.pi)
        for order, line_power in zip(spectra.frequencies / rotation, significant.sum(axis=(0, 2)), strict=True):
            rounded = round(order) if abs(order - round(order)) < 0.15 else round(float(order), 1)
            by_order[rounded] = by_order.get(rounded, 0.0) + float(line_power)
        for label, line_power in zip(spectra.recording.channels, significant.sum(axis=(0, 1)), strict=True):
            by_channel[label] = by_channel.get(label, 0.0) + float(line_power)
    left = Remainder(power / max(total, 1e-300), power)
    return CutRemainder(left, _strongest(by_order, power)[:MAX_ORDERS], _strongest(by_channel, power))


def _is_significant(residual_power: Real, floor: Real, usual_power: Real, chance: float) -> NDArray[np.bool_]:
    """Return a mask (n_blocks, n_lines, n_axes) of lines whose power, alone or in the mean of blocks, exceeds noise."""
    blocks = len(residual_power)
    single = residual_power > scipy.special.gammainccinv(1, chance) * floor + usual_power
    mean = residual_power.mean(axis=0) > scipy.special.gammainccinv(blocks, chance) / blocks * floor + usual_power.mean(
        axis=0
    )
    return np.asarray(single | mean)


def _strongest(powers: Mapping[Place, float], total: float) -> tuple[Place, ...]:
    """Return the places with more than the minimum share of the power, strongest first."""
    ranked = sorted(powers, key=lambda place: -powers[place])
    return tuple(place for place in ranked if powers[place] > MIN_SHARE * total)


# stage of a cause that has evidence but was not accepted
UNCONFIRMED = "fitted, but not confirmed: within its own error, or no gain on blocks held out"


@dataclass(frozen=True)
class CutComparison:
    """Comparison of a cut for :func:`millfrf.mismatch.inference.search`."""

    cut: MeasuredCut  # recordings with their noise
    names: tuple[str, ...]
    settings: CutSettings  # thresholds of a cut's diagnosis

    def finished(self, search: Search[CutFit]) -> bool:
        """Return whether all causes were added."""
        return set(self.names) <= set(search.current.freed)

    def round(self, search: Search[CutFit]) -> Round[CutFit]:
        """Fit each further cause together with the accepted causes, and choose the best significant cause."""
        current, least = search.current, self.settings.evidence.least
        ranked = best_first([self._proposed(current, name) for name in self.names if name not in current.freed])
        failed: list[str] = []
        for proposal in ranked:
            if proposal.evidence >= least and self._confirmed(current, proposal):
                equivalents = equivalents_of(ranked, proposal, self.settings.evidence.as_good)
                return Round(ranked, proposal, _as_candidates(ranked, failed), equivalents)
            failed += [proposal.name] if proposal.evidence >= least else []
        return Round(ranked, None, _as_candidates(ranked, failed))

    def without(self, search: Search[CutFit], place: int) -> CutFit:
        """Fit the last step again with one cause fixed at the numbers of the cutting file."""
        current, name = search.current, search.accepted[place].name
        fewer = tuple(cause for cause in current.freed if cause != name)
        stated = current.hypothesis.cause(name).stated(self.cut.belief.process)
        return fit_with_tooth_numbers(self.cut, current.hypothesis.with_values(name, stated), fewer)

    def needed(self, current: CutFit, base: CutFit) -> float:
        """Return the evidence that a further cause needs; it does not depend on the accepted causes."""
        del current, base
        return self.settings.evidence.least

    def _proposed(self, current: CutFit, name: str) -> Proposal[CutFit]:
        fitted = fit_with_tooth_numbers(self.cut, current.hypothesis, (*current.freed, name))
        return Proposal(name, {}, fitted, current.score - fitted.score)

    def _confirmed(self, current: CutFit, proposal: Proposal[CutFit]) -> bool:
        """Return whether a number of the cause is significant and the cause lowers the misfit of held-out blocks."""
        fitted = proposal.fitted
        values = fitted.hypothesis.values(proposal.name)
        differences = np.abs(values - fitted.hypothesis.cause(proposal.name).stated(self.cut.belief.process))
        errors = np.sqrt(np.diag(covariance_with_usual_error(self.cut, fitted, proposal.name)))
        if not np.any(differences > self.settings.evidence.clear * errors):
            return False
        # both fits start without the cause, but with the tooth numbers of the fit with the cause: a half that does not
        # contain the cause must not inherit it from the fit to all blocks
        start = replace(current.hypothesis, laws=fitted.hypothesis.laws)
        without = fit_halves(self.cut, current.hypothesis, current.freed)
        with_it = fit_halves(self.cut, start, fitted.freed)
        gain = np.sum(held_out_misfits(without) - held_out_misfits(with_it))
        return bool(gain > self.settings.proof.gain)


def covariance_with_usual_error(cut: MeasuredCut, fitted: CutFit, name: str) -> Real:
    """Return the covariance of the numbers of a freed cause due to noise and the usual error of the force model, SI.

    Each line of a correct force model has a relative error. The error may be equal in all lines, and a number that is
    proportional to the force then has the same relative error.
    """
    own = np.diag((cut.force_error * fitted.hypothesis.values(name)) ** 2)
    return np.asarray(fitted.covariance_of(name) + own)


def _as_candidates(ranked: Sequence[Proposal[CutFit]], failed: Sequence[str]) -> tuple[Candidate, ...]:
    return tuple(
        Candidate(proposal.name, proposal.evidence, UNCONFIRMED if proposal.name in failed else "fitted")
        for proposal in ranked
    )


# name under which implausible coefficients are reported
COEFFICIENTS = "force_coefficients"


def accepted_causes(cut: MeasuredCut, search: Search[CutFit], halves: Halves) -> list[AcceptedCause]:
    """Return the accepted causes with numbers and standard errors, in the order of acceptance."""
    final, process = search.current, cut.belief.process
    further: Sequence[Proposal[CutFit]] = search.rounds[-1].proposals if search.rounds else ()
    form = form_errors(cut, final, halves, further)
    depends_on_motion = any(final.hypothesis.cause(name).moves for name in final.freed)
    # noise of the motion shifts the numbers without a trace in the residual: added again, it shifts them once more
    shifted_fit = fit_cut(cut.noisier(), final.hypothesis, final.freed) if depends_on_motion else final
    causes = []
    for accepted in search.accepted:
        name, cause = accepted.name, final.hypothesis.cause(accepted.name)
        values = final.hypothesis.values(name)
        shift = np.diag((shifted_fit.hypothesis.values(name) - values) ** 2)
        parts = {
            "fit": covariance_with_usual_error(cut, final, name) + shift,
            "spread": np.diag(form[name].spread),
            "form": np.diag(form[name].form),
        }
        numbers, errors = cause.named_numbers(values, np.sum(list(parts.values()), axis=0), process)
        by_part = {part: cause.named_numbers(values, covariance, process)[1] for part, covariance in parts.items()}
        error_parts = {number: {part: by_part[part][number] for part in parts} for number in numbers}
        causes.append(AcceptedCause(name, {}, numbers, errors, accepted.evidence, error_parts))
    return causes


def implausible_coefficients(cut: MeasuredCut, fitted: CutFit, settings: CutSettings) -> list[AcceptedCause]:
    """Return the coefficients as a cause if they deviate by several laboratory errors; else an empty list."""
    deviations = fitted.hypothesis.deviations
    errors = np.sqrt(np.diag(fitted.covariance)[:6])
    implausible = (np.abs(deviations) > settings.implausible) & (np.abs(deviations) > settings.evidence.clear * errors)
    if not implausible.any():
        return []
    values, spread = cut.belief.named_numbers(deviations, errors)
    fixed = fit_cut(cut, replace(fitted.hypothesis, deviations=np.zeros(6)), fitted.freed, refit=False)
    location = {
        "coefficients": [name for name, is_implausible in zip(values, implausible, strict=True) if is_implausible]
    }
    return [AcceptedCause(COEFFICIENTS, location, values, spread, fixed.score - fitted.score)]


def last_candidates(search: Search[CutFit], reported: CutFit) -> list[Candidate]:
    """Return a candidate for every cause, with the evidence of its last comparison, most evidence first."""
    last = {candidate.name: candidate for step in search.rounds for candidate in step.candidates}
    last |= {candidate.name: candidate for candidate in search.rejected}
    for name in set(search.current.freed) - set(reported.freed):
        last[name] = replace(last[name], stage=UNCONFIRMED)
    return sorted(last.values(), key=lambda candidate: -candidate.evidence)
