"""Error of a computed cutting force on blocks of time that it was not fitted to."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...inference import Improvement, ProofSettings, ratio_interval
from .fits import CutFit, CutHypothesis, MeasuredCut, fit_cut

Real = NDArray[np.float64]

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
