"""Held-out error, parameter errors and structured residual of a computed cutting force."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeVar

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Real

from ..inference.diagnosis import Improvement, Remainder
from ..inference.paired_tests import jackknife_variance, ratio_interval, shift_weight
from ..inference.search import Proposal
from ..inference.settings import ProofSettings
from .fitting import CutFit, fit_cut
from .hypothesis import CutHypothesis, MeasuredCut
from .settings import CutSettings

FOLDS = (slice(0, None, 2), slice(1, None, 2))
"""Slices of every other block: each half is tested with numbers fitted to the other."""

Halves = tuple[CutFit, CutFit]


def fit_halves(cut: MeasuredCut, start: CutHypothesis, freed: Sequence[str], *, refit: bool = True) -> Halves:
    """The same fit to either half of the blocks.

    Parameters
    ----------
    cut
        Recordings with their noise.
    start
        Hypothesis to begin with.
    freed
        Names of the causes whose numbers are fitted.
    refit
        Whether the coefficients may move.
    """
    first, second = (fit_cut(cut, start, freed, part=part, refit=refit) for part in FOLDS)
    return first, second


def held_out_misfits(halves: Halves) -> Real:
    """Misfit of every block by the fit that did not see it, (n_blocks of all recordings,).

    Parameters
    ----------
    halves
        Fits to either half.
    """
    parts = [one[part] for fitted, part in zip(halves, FOLDS[::-1], strict=True) for one in fitted.block_misfits]
    return np.concatenate(parts)


def held_out_powers(cut: MeasuredCut, halves: Halves) -> Real:
    """Power of the residual in every block by the fit that did not see it, (n_blocks of all recordings,), N^2.

    Parameters
    ----------
    cut
        Recordings of the cut.
    halves
        Fits to either half.
    """
    parts = []
    for fitted, part in zip(halves, FOLDS[::-1], strict=True):
        for k, spectra in enumerate(cut.spectra):
            rest = (spectra.measured - cut.predicted(k, fitted.hypothesis))[part]
            parts.append(np.sum(np.abs(rest) ** 2, axis=(1, 2)))
    return np.concatenate(parts)


def lowers(cut: MeasuredCut, without: Halves, with_it: Halves, proof: ProofSettings) -> bool:
    """Whether the error of the force on blocks that were not fitted falls, and by more than chance.

    Parameters
    ----------
    cut
        Recordings of the cut.
    without, with_it
        Fits to either half under two hypotheses.
    proof
        Test and significance.
    """
    falls = float(held_out_powers(cut, with_it).sum()) < float(held_out_powers(cut, without).sum())
    return falls and proof.test(held_out_misfits(without), held_out_misfits(with_it)) < proof.significance


def improvement(cut: MeasuredCut, nominal: Halves, base: Halves, final: Halves, proof: ProofSettings) -> Improvement:
    """Errors on blocks that were not fitted, relative to the force.

    Parameters
    ----------
    cut
        Recordings with their noise.
    nominal, base, final
        Fits to either half with the numbers of the cutting file, with coefficients refitted, and with causes.
    proof
        Thresholds of the test that the error falls.
    """
    before, refitted, after = (held_out_powers(cut, one) for one in (nominal, base, final))
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


BANDS = 4
"""Bands of the compared frequencies, one of which is left out of each fit: a law of another form changes with them."""


@dataclass(frozen=True)
class FormErrors:
    """Variances of the numbers of one cause beyond those of its fit, in SI squared.

    Parameters
    ----------
    spread : (n_numbers,)
        Variance between fits to either half of the blocks of time, and between fits that leave out one of four bands
        of frequency (jackknife).
    form : (n_numbers,)
        Largest squared shift when one further cause is free, weighed by what that cause gains.
    """

    spread: Real
    form: Real


def form_errors(
    cut: MeasuredCut, final: CutFit, halves: Halves, further: Sequence[Proposal[CutFit]]
) -> dict[str, FormErrors]:
    """Errors of every fitted cause by its name.

    Parameters
    ----------
    cut
        Recordings with their noise.
    final
        Fit with all accepted causes.
    halves
        The same hypothesis fitted to either half of the blocks.
    further
        Fits of the last round; those with one more cause beside the accepted ones are used.
    """
    edges = np.linspace(0, 1, BANDS + 1)
    parts = [
        fit_cut(cut.without_band(float(low), float(high)), final.hypothesis, final.freed)
        for low, high in pairwise(edges)
    ]
    beside = [one.fitted for one in further if one.fitted.freed[:-1] == final.freed]
    found = {}
    for name in final.freed:
        values = final.hypothesis.values(name)
        bands, blocks = (
            jackknife_variance(np.array([one.hypothesis.values(name) for one in fits])) for fits in (parts, halves)
        )
        shifts = [(shift_weight(final.cost - one.cost) * (one.hypothesis.values(name) - values)) ** 2 for one in beside]
        found[name] = FormErrors(bands + blocks, np.max([np.zeros(len(values)), *shifts], axis=0))
    return found


Place = TypeVar("Place", float, str)

MOST_TOLD = 8
"""Spindle orders that are told."""

WORTH_TELLING = 0.01
"""Share of what is left from which an order or a channel is told."""


@dataclass(frozen=True)
class CutRemainder:
    """Residual power of a cut beyond noise and usual error, and where it sits.

    Parameters
    ----------
    left
        Power of the lines that stand out, as a share of the residual's power, and in N^2.
    orders
        Spindle orders that hold most of it (multiples of the spindle's frequency), strongest first.
    channels
        Degrees of freedom in which it stands out, strongest first.
    """

    left: Remainder
    orders: tuple[float, ...]
    channels: tuple[str, ...]


def cut_remainder(cut: MeasuredCut, hypothesis: CutHypothesis, settings: CutSettings) -> CutRemainder:
    """Spectral lines with more power than noise has by chance, in a block or in the mean of all blocks.

    Parameters
    ----------
    cut
        Recordings with their noise.
    hypothesis
        Numbers of the fit.
    settings
        Thresholds: the chance, and how far a right force may be off.
    """
    power, total = 0.0, 0.0
    by_order: dict[float, float] = {}
    by_channel: dict[str, float] = {}
    for k, spectra in enumerate(cut.spectra):
        predicted = cut.predicted(k, hypothesis)
        rest = np.abs(spectra.measured - predicted) ** 2
        off = (settings.usual_errors * cut.force_error) ** 2 * np.abs(predicted) ** 2
        seen = np.where(_stands_out(rest, cut.noise[k].floor, off, settings.chance), rest, 0.0)
        power, total = power + float(seen.sum()), total + float(rest.sum())
        rotation = spectra.recording.law.speed / (2 * np.pi)
        for order, one in zip(spectra.frequencies / rotation, seen.sum(axis=(0, 2)), strict=True):
            near = round(order) if abs(order - round(order)) < 0.15 else round(float(order), 1)
            by_order[near] = by_order.get(near, 0.0) + float(one)
        for label, one in zip(spectra.recording.channels, seen.sum(axis=(0, 1)), strict=True):
            by_channel[label] = by_channel.get(label, 0.0) + float(one)
    left = Remainder(power / max(total, 1e-300), power)
    return CutRemainder(left, _strongest(by_order, power)[:MOST_TOLD], _strongest(by_channel, power))


def _stands_out(rest: Real, floor: Real, off: Real, chance: float) -> NDArray[np.bool_]:
    """Lines (n_blocks, n_lines, n_axes) whose power, alone or in the mean of blocks, noise reaches only by chance."""
    blocks = len(rest)
    alone = rest > scipy.special.gammainccinv(1, chance) * floor + off
    mean = rest.mean(axis=0) > scipy.special.gammainccinv(blocks, chance) / blocks * floor + off.mean(axis=0)
    return np.asarray(alone | mean)


def _strongest(powers: Mapping[Place, float], whole: float) -> tuple[Place, ...]:
    """Places with more than their share of the whole, strongest first."""
    ranked = sorted(powers, key=lambda place: -powers[place])
    return tuple(place for place in ranked if powers[place] > WORTH_TELLING * whole)
