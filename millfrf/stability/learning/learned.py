"""A structure and its cutting coefficients brought up to date by cuts, and cuts that contradict them."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from millfrf.core import InputError, Real
from millfrf.cutting import MillingProcess, refuse_varied
from modal_fit import ModalModel, pack_parameters, unpack_parameters

from ..chatter.verdict import INCONCLUSIVE
from ..drawn_structures import Draw, NormalErrors
from ..settings import LEARNING
from .approximation import Centre
from .production_cuts import ProductionCut, chatter_probability, log_likelihood, other_line_probability, predicted
from .sample import Sample, prior_sample, with_cut


@dataclass(frozen=True)
class CutEvidence:
    """What one cut changed.

    Parameters
    ----------
    cut
        The cut; an inconclusive one tells nothing, and its numbers are NaN.
    expected
        Probability of its state, chattering or not, for the model learned from the cuts before it.
    expected_by_others
        The same for the model learned from all other cuts.
    other_line
        Probability that its chatter frequency is none of the predicted ones, for the model learned from all cuts; NaN
        without a frequency.
    effective
        Effective draws after this cut.
    shifts : (n_parameters,)
        Change of the mean of each parameter of :attr:`Learned.parameters` by this cut, in standard errors of the prior.
    """

    cut: ProductionCut
    expected: float
    expected_by_others: float
    other_line: float
    effective: float
    shifts: Real


@dataclass(frozen=True)
class Learned:
    """Result of :func:`learned_in_turn`.

    Parameters
    ----------
    prior
        Structure and cut before, with their errors.
    evidence
        One entry a cut, in the order of the cuts.
    parameters
        Names of parameters: frequency, damping and flexibility of each mode, and the coefficients.
    narrowed : (n_parameters,)
        Standard error of each parameter after all cuts over that of the prior; NaN where the prior has none.
    before, after
        Sample of the prior, and that after all cuts.
    contradictions
        One sentence for each contradiction; with one, nothing that was learned is advice.
    """

    prior: NormalErrors
    evidence: tuple[CutEvidence, ...]
    parameters: tuple[str, ...]
    narrowed: Real
    before: Sample
    after: Sample
    contradictions: tuple[str, ...] = ()

    @property
    def verdict(self) -> str:
        """Return ``learned``, ``contradiction``, or ``nothing`` where no cut has a conclusive verdict."""
        if self.contradictions:
            return "contradiction"
        return "learned" if self.conclusive else "nothing"

    @property
    def conclusive(self) -> tuple[ProductionCut, ...]:
        """Return the cuts with a verdict."""
        return tuple(each.cut for each in self.evidence if each.cut.verdict != INCONCLUSIVE)

    def updated(self) -> Draw:
        """Return the mean structure and cut with the covariance of each; without conclusive cuts those of the prior.

        Correlations between structure and coefficients are in the sample alone.
        """
        model, process = self.prior.model, self.prior.process
        if not self.conclusive:
            return model, process
        centre = Centre.of(self.after.numbers, self.after.weights, self.after.prediction)
        mean, covariance, n = centre.whole_mean, centre.whole_covariance, self.prior.root.shape[1]
        moved = unpack_parameters(model, pack_parameters(model) + self.prior.root @ mean[:n])
        if model.covariance is not None:
            of_model = self.prior.root @ covariance[:n, :n] @ self.prior.root.T
            moved = replace(moved, covariance=(of_model + of_model.T) / 2, errors=None)
        shift, root = self.prior.root_of_cut @ mean[n:], self.prior.root_of_cut
        return moved, _with_coefficients(process, shift, root @ covariance[n:, n:] @ root.T)


def _with_coefficients(process: MillingProcess, shift: Real, covariance: Real) -> MillingProcess:
    """Return the process with moved coefficients; stated edge coefficients follow as far as they are correlated."""
    whole, edges = np.zeros((6, 6)), np.array([process.kte, process.kre, process.kae])
    if process.covariance:
        stated = np.array(process.covariance)[:6, :6]
        slope = stated[3:, :3] @ np.linalg.pinv(stated[:3, :3], hermitian=True)
        edges = np.maximum(edges + slope @ shift, 0.0)
        whole[3:, 3:] = stated[3:, 3:] + slope @ (covariance - stated[:3, :3]) @ slope.T
        whole[3:, :3], whole[:3, 3:] = slope @ covariance, covariance @ slope.T
    whole[:3, :3] = covariance
    whole = (whole + whole.T) / 2
    errors = np.sqrt(np.maximum(np.diag(whole)[:3], 0.0))
    (kte, kre, kae), (ktc_std, krc_std, kac_std) = map(float, edges), map(float, errors)
    return replace(
        process,
        ktc=process.ktc + float(shift[0]),
        krc=process.krc + float(shift[1]),
        kac=process.kac + float(shift[2]),
        covariance=tuple(tuple(map(float, row)) for row in whole) if errors.any() else (),
        kte=kte,
        kre=kre,
        kae=kae,
        ktc_std=ktc_std,
        krc_std=krc_std,
        kac_std=kac_std,
    )


def learned_in_turn(
    model: ModalModel, process: MillingProcess, cuts: Iterable[ProductionCut], seed: int = 0
) -> Iterator[Learned]:
    """Bring a structure and its coefficients up to date by cuts, and yield what is known before and after each cut.

    Bayes' theorem, ``p(x | cuts) ~ p(x) prod_i p(verdict_i, frequency_i | x)``: the prior of the parameters x is normal
    with the stated covariances, and the probability of a verdict follows from the largest Floquet multiplier of the cut
    (``log_likelihood``). The result is a sample of structures (``with_cut``).

    Parameters
    ----------
    model, process
        Structure at the tool tip and cut, with their errors: the prior.
    cuts
        Cuts, in the order in which they were made; the next one is asked for after what is known before it was yielded.
    seed
        Seed of the random generator.

    Raises
    ------
    InputError
        Turning, coefficients that depend on the chip, a prior without errors, or cuts that leave too few draws.
    """
    refuse_varied(
        process,
        "learning from cuts",
        "draw lobes of the turning cut (millfrf lobes), and compare them with its verdicts",
        takes=("runout", "shape", "helix", "pitch", "damping"),
    )
    if process.chip_law.varies:
        raise InputError(
            "learning from cuts takes no coefficients that depend on the chip thickness; give those of the chip of "
            "these cuts, without exponents"
        )
    prior = NormalErrors.of(model, process)
    if not prior.root.any() and not prior.root_of_cut.any():
        raise InputError(
            "neither the model has a covariance nor the coefficients errors: nothing can be learned; give a model that "
            "fit or calibrate wrote, or state ktc_std_pa in the cutting file"
        )
    generator = np.random.default_rng(seed)
    before = prior_sample(prior, generator)
    now = Learned(prior, (), _names(model), _over(_errors(before), _errors(before)), before, before)
    yield now
    for cut in cuts:
        now = _with_one_more(now, cut, generator)
        yield now


def _with_one_more(now: Learned, cut: ProductionCut, generator: np.random.Generator) -> Learned:
    """Return what is known with one more cut."""
    nothing = CutEvidence(cut, math.nan, math.nan, math.nan, math.nan, np.full(len(now.parameters), np.nan))
    if cut.verdict == INCONCLUSIVE:
        return replace(now, evidence=(*now.evidence, nothing))
    sample, errors, known = now.after, _errors(now.before), (*now.conclusive, cut)
    ahead = predicted(sample.draws(), [cut])
    expected = float(sample.weights @ _state_probability(chatter_probability(ahead)[:, 0], cut))
    after = with_cut(sample, ahead, known, generator)
    shifts = _over(after.mean(_quantities(after)) - sample.mean(_quantities(sample)), errors)
    latest = replace(nothing, expected=expected, effective=after.effective, shifts=shifts)
    evidence = _seen_by_others((*now.evidence, latest), after, known)
    result = replace(now, evidence=evidence, after=after, narrowed=_over(_errors(after), errors))
    return replace(result, contradictions=tuple(_contradictions(result)))


def _over(values: Real, errors: Real) -> Real:
    return np.asarray(np.divide(values, errors, out=np.full(len(errors), np.nan), where=errors > 0))


def _names(model: ModalModel) -> tuple[str, ...]:
    """Return the names of the columns of `_quantities`."""
    modes = range(1, len(model.poles) + 1)
    kinds = ("frequency", "damping", "flexibility")
    return (*(f"mode {mode} {kind}" for kind in kinds for mode in modes), "Ktc", "krc", "kac")


def _quantities(sample: Sample) -> Real:
    """Return the parameters of each draw, (n_draws, n_parameters); the flexibility is that at resonance."""
    rows = []
    for structure, cut in sample.draws():
        sizes = np.linalg.norm(structure.right, axis=1) * np.linalg.norm(structure.left, axis=1)
        modes = (structure.natural_frequencies, structure.damping_ratios, sizes / -structure.poles.real)
        rows.append(np.concatenate([*modes, [cut.ktc, cut.krc, cut.kac]]))
    return np.array(rows)


def _errors(sample: Sample) -> Real:
    """Return the standard errors of the parameters; 0 where they differ by rounding alone."""
    values = _quantities(sample)
    mean = sample.mean(values)
    errors = np.sqrt(np.maximum(sample.mean((values - mean) ** 2), 0.0))
    return np.asarray(np.where(errors > 1e-9 * np.abs(mean), errors, 0.0))


def _state_probability(chatters: Real, cut: ProductionCut) -> Real:
    return chatters if cut.chatters else 1 - chatters


def _seen_by_others(
    evidence: Sequence[CutEvidence], sample: Sample, known: Sequence[ProductionCut]
) -> tuple[CutEvidence, ...]:
    """Return the evidence with what the model learned from all other cuts expects of each."""
    likelihood = log_likelihood(sample.prediction, known)
    chatters = chatter_probability(sample.prediction)
    lines = sample.mean(other_line_probability(sample.prediction, known))
    result, columns = [], iter(range(len(known)))
    for each in evidence:
        if each.cut.verdict == INCONCLUSIVE:
            result.append(each)
            continue
        k = next(columns)
        without = scipy.special.softmax(sample.log_weights - likelihood[:, k])
        by_others = float(without @ _state_probability(chatters[:, k], each.cut))
        result.append(replace(each, expected_by_others=by_others, other_line=float(lines[k])))
    return tuple(result)


def _contradictions(learned: Learned) -> list[str]:
    """Name verdicts that are too improbable for the model learned from the other cuts, and what would explain them."""
    conclusive = [each for each in learned.evidence if each.cut.verdict != INCONCLUSIVE]
    level = LEARNING.contradiction / max(len(conclusive), 1)
    texts = []
    for each in conclusive:
        probability = min(each.expected, each.expected_by_others)
        if probability >= level:
            continue
        cut, state = each.cut, "chatters" if each.cut.chatters else "is stable"
        whose = "the cuts before it" if each.expected <= each.expected_by_others else "the other cuts"
        place = f"{cut.depth * 1e3:.3g} mm at {cut.spindle_speed * 30 / math.pi:.0f} rpm"
        texts.append(
            f"{cut.name}: {place} {state}, which the model learned from {whose} gives a probability of "
            f"{_small(probability)} (contradiction below {level:.2g}); {_explanation(learned, cut)}"
        )
    frequencies = [each.other_line for each in conclusive if not math.isnan(each.other_line)]
    others = sum(probability > 0.5 for probability in frequencies)
    if others and scipy.stats.binom.sf(others - 1, len(frequencies), LEARNING.other_line) < LEARNING.contradiction:
        texts.append(
            f"{others} of {len(frequencies)} chatter frequencies are none of the predicted ones, where "
            f"{LEARNING.other_line:.0%} are expected: another tool or pose, or wrong speeds; measure the tip again"
        )
    return texts


def _small(probability: float) -> str:
    return f"{probability:.2g}" if probability > 1e-4 else "less than 0.0001"


def _explanation(learned: Learned, cut: ProductionCut) -> str:
    """Say at which depth or speed the verdict would be expected, and what else could explain it."""
    draws = learned.after.chosen(39, seed=2)
    factors = np.geomspace(1 / 4, 4, 17)
    shares = np.concatenate([1 - np.linspace(0, 0.1, 6), 1 + np.linspace(0, 0.1, 6)[1:]])

    def expected(tried: list[ProductionCut]) -> Real:
        chatters = chatter_probability(predicted(draws, tried)).mean(axis=0)
        return np.asarray(chatters if cut.chatters else 1 - chatters)

    deep = expected([replace(cut, depth=cut.depth * float(factor)) for factor in factors])
    fast = expected([replace(cut, spindle_speed=cut.spindle_speed * float(share)) for share in shares])
    places = []
    if (deep > 0.5).any():
        nearest = np.abs(np.log(factors[deep > 0.5])).argmin()
        places.append(f"at {1e3 * cut.depth * factors[deep > 0.5][nearest]:.3g} mm")
    if (fast > 0.5).any():
        nearest = np.abs(shares[fast > 0.5] - 1).argmin()
        places.append(f"at {cut.spindle_speed * shares[fast > 0.5][nearest] * 30 / math.pi:.0f} rpm")
    text = f"it would be expected {' or '.join(places)}; " if places else ""
    return text + (
        "another tool, another pose, another width, depth or speed than stated, or a wrong verdict could explain it: "
        "check this cut, or leave it out"
    )
