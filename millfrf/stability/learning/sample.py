"""A weighted sample of structures and cuts, brought up to date by one cut after the other (sequential Monte Carlo)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from millfrf.core import Index, InputError, Real

from ..drawn_structures import Draw, NormalErrors
from ..settings import LEARNING
from .approximation import Centre
from .production_cuts import Prediction, ProductionCut, log_likelihood, predicted


@dataclass(frozen=True)
class Sample:
    """Structures and cuts as standard normal numbers of their prior, with weights.

    Parameters
    ----------
    errors
        Prior: what the numbers mean.
    numbers : (n_draws, dimension)
        The numbers of each draw.
    log_weights : (n_draws,)
        Logarithm of the weights, up to a constant.
    prediction
        What the draws predict of the cuts so far.
    """

    errors: NormalErrors
    numbers: Real
    log_weights: Real
    prediction: Prediction

    @property
    def weights(self) -> Real:
        """Return the weights, (n_draws,), of sum 1."""
        return np.asarray(scipy.special.softmax(self.log_weights))

    @property
    def effective(self) -> float:
        """Return the effective number of different draws, ``1 / sum w^2`` (Kong, Liu & Wong, JASA 89, 1994)."""
        _, same = np.unique(self.numbers[:, :-3] @ self.numbers[0, :-3] + self.numbers[:, -3], return_inverse=True)
        return float(1 / np.sum(np.bincount(same, self.weights) ** 2))

    def draws(self) -> list[Draw]:
        """Return the structures and cuts."""
        return [self.errors.at(numbers) for numbers in self.numbers]

    def chosen(self, count: int, seed: int) -> list[Draw]:
        """Return draws of equal weight, each chosen with the probability of its weight (systematic resampling)."""
        picked = systematic(self.weights, count, np.random.default_rng(seed))
        return [self.errors.at(self.numbers[k]) for k in picked]

    def mean(self, values: Real) -> Real:
        """Return the weighted mean of values of the draws (n_draws, ...)."""
        return np.asarray(np.tensordot(self.weights, values, axes=1))


def prior_sample(errors: NormalErrors, generator: np.random.Generator) -> Sample:
    """Draw the sample of a prior."""
    numbers = np.array([errors.numbers(generator) for _ in range(LEARNING.draws)])
    nothing = np.zeros((LEARNING.draws, 0))
    return Sample(errors, numbers, np.zeros(LEARNING.draws), Prediction(nothing, nothing, np.zeros(0)))


def with_cut(
    sample: Sample, ahead: Prediction, cuts: Sequence[ProductionCut], generator: np.random.Generator
) -> Sample:
    """Return the sample that knows one more cut, the last of ``cuts``; ``ahead`` is what it predicts of that cut.

    The draws are weighted by the likelihood of the cut. Where few of them keep weight, the likelihood is taken to the
    power that keeps half of them, draws are chosen by their weight, and each is moved by the Metropolis algorithm with
    the exact likelihood of all cuts, until its power is 1 (Del Moral, Doucet & Jasra, J. R. Stat. Soc. B 68, 2006).

    Raises
    ------
    InputError
        Too few different draws remain.
    """
    prediction = sample.prediction.with_cut(ahead)
    known = len(cuts) - 1
    now, power = replace(sample, prediction=prediction), 0.0
    while power < 1:
        last = log_likelihood(now.prediction, cuts)[:, known]
        rise = _largest_rise(now.log_weights, last, 1 - power)
        now, power = replace(now, log_weights=now.log_weights + rise * last), power + rise
        if now.effective < LEARNING.enough * LEARNING.draws:
            now = _moved(now, cuts, power, generator)
    if now.effective < LEARNING.least_effective:
        raise InputError(
            f"{cuts[known].name}: the cuts up to this one leave {now.effective:.0f} effective structures of "
            f"{LEARNING.draws}, {LEARNING.least_effective} are needed; give the model of a new measurement (its errors "
            "are too large, or the cuts contradict it), or leave this cut out"
        )
    return now


def _largest_rise(log_weights: Real, logs: Real, most: float) -> float:
    """Return by how much the power of a likelihood may rise until fewer than half of the draws are effective."""

    def enough(rise: float) -> bool:
        weights = scipy.special.softmax(log_weights + rise * logs)
        return bool(1 / np.sum(weights**2) >= 0.99 * LEARNING.enough * LEARNING.draws)

    if enough(most):
        return most
    low, high = 0.0, most
    for _ in range(20):
        middle = (low + high) / 2
        low, high = (middle, high) if enough(middle) else (low, middle)
    return high


def _moved(sample: Sample, cuts: Sequence[ProductionCut], power: float, generator: np.random.Generator) -> Sample:
    """Choose draws by their weight, and move them until they differ and have forgotten half of where they were.

    Copies of a draw differ only after a move that was accepted; some may wait while others have moved far.
    """
    errors, centre = sample.errors, Centre.of(sample.numbers, sample.weights, sample.prediction)
    powers = np.append(np.ones(len(cuts) - 1), power)
    chosen = systematic(sample.weights, LEARNING.draws, generator)
    numbers, prediction = sample.numbers[chosen], sample.prediction.of_draws(chosen)
    began, step = numbers, 0.7
    target = log_likelihood(prediction, cuts) @ powers - centre.density(numbers)
    for _ in range(LEARNING.most_moves):
        tried = centre.near(numbers, step, generator)
        alive = np.flatnonzero(errors.decays(tried))
        of_tried = predicted([errors.at(each) for each in tried[alive]], cuts)
        gain = log_likelihood(of_tried, cuts) @ powers - centre.density(tried[alive]) - target[alive]
        accepted = np.log(generator.random(len(alive))) < gain
        to, new = alive[accepted], np.flatnonzero(accepted)
        numbers = numbers.copy()
        numbers[to], target[to] = tried[to], target[to] + gain[new]
        prediction = prediction.with_draws(to, of_tried.of_draws(new))
        step = float(np.clip(step * np.exp(2 * (len(to) / len(numbers) - LEARNING.accepted)), 0.05, 0.95))
        moved = Sample(errors, numbers, np.zeros(len(numbers)), prediction)
        if _forgotten(began, numbers, centre) > 0.5 and moved.effective >= LEARNING.enough * LEARNING.draws:
            break
    return moved


def _forgotten(began: Real, numbers: Real, centre: Centre) -> float:
    """Return which share of their variance along the narrow directions draws have forgotten; 1: independent draws."""
    along = centre.directions if centre.directions.size else np.eye(numbers.shape[1])
    moved, spread = (numbers - began) @ along, numbers @ along
    return float(np.min(np.mean(moved**2, axis=0) / (2 * spread.var(axis=0) + 1e-300)))


def systematic(weights: Real, count: int, generator: np.random.Generator) -> Index:
    """Choose indices with the probability of their weights, by equal steps through the weights in random order."""
    order = generator.permutation(len(weights))
    places = (np.arange(count) + generator.random()) / count
    return np.asarray(order[np.searchsorted(np.cumsum(weights[order]), places).clip(max=len(order) - 1)])
