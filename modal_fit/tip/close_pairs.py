"""Pairs of modes closer than their widths: a small change of the structure mixes their shapes."""

from dataclasses import replace
from itertools import combinations

import numpy as np

from millfrf.core import Complex, Index

from ..models.modal_model import ModalModel
from ..models.synthesis import derived_covariance, pack_parameters
from ..settings import SETTINGS
from .agreement import assurance_of, residues_of
from .matching import assign, shared_forces


def with_pairs_as_in_cut(model: ModalModel, hammer: ModalModel, n_tip: int) -> ModalModel:
    """Return the hammer modes with close pairs in the basis of the cut's.

    Where the poles of two modes are nearly equal, only the sum ``sum_r right_r left_r^T`` of their residues is a
    property of the structure: between rest and cut a change of stiffness too small to affect the other
    modes turns their shapes in the plane that both span. With an invertible matrix T, the vectors ``right T`` and
    ``left T^-T`` have the same sum. T is the one for which the right vectors at the sensor are nearest to those of the
    cut; scale, sign, and left vectors of the new residues remain to be compared. It is taken where the sums of the
    residues agree in both tests, and both residues agree better than before.

    Parameters
    ----------
    model
        In-process model with responses at the sensor.
    hammer
        Model of both hammer FRFs, the rows of the tip first.
    n_tip
        Number of responses at the tip.
    """
    shared = shared_forces(model.excitations, hammer.excitations)
    process = residues_of(model, shared, first=True)

    def tapped(taps: ModalModel) -> Complex:
        return residues_of(taps, shared, first=False, n_tip=n_tip)

    frequencies = (model.natural_frequencies, hammer.natural_frequencies)
    rows, chosen = assign(frequencies, (process, tapped(hammer)))
    turned: set[int] = set()
    for pair in _close_pairs(model.poles[rows], hammer.poles[chosen]):
        if turned & set(pair):
            continue
        places = chosen[list(pair)]
        trial = _in_basis_of(model.right[rows[list(pair)]], hammer, places, n_tip)
        own = process[rows[list(pair)]]
        before, after = (assurance_of(own, tapped(taps)[places]) for taps in (hammer, trial))
        of_sums = assurance_of(own.sum(axis=0)[None], tapped(hammer)[places].sum(axis=0)[None])
        if (after > before).all() and of_sums[0] >= SETTINGS.matched_assurance:
            hammer = trial
            turned |= set(pair)
    return hammer


def _close_pairs(cut: Complex, rest: Complex) -> list[tuple[int, int]]:
    """Return pairs whose frequencies differ by less than the sum of half their widths, in the cut or at rest."""

    def nearness(poles: Complex, i: int, j: int) -> float:
        width = -poles[i].real - poles[j].real
        return float(abs(poles[i].imag - poles[j].imag) / width)

    measured = [
        (min(nearness(poles, i, j) for poles in (cut, rest)), (i, j)) for i, j in combinations(range(len(cut)), 2)
    ]
    return [pair for distance, pair in sorted(measured) if distance < 1]


def _in_basis_of(right: Complex, hammer: ModalModel, places: Index, n_tip: int) -> ModalModel:
    """Return the hammer model with two modes in the basis in which they are nearest to ``right`` at the sensor."""
    basis = np.linalg.lstsq(hammer.right[places, n_tip:].T, right.T)[0]
    inverse = np.linalg.pinv(basis)

    def turned(model: ModalModel) -> ModalModel:
        vectors, forces = model.right.copy(), model.left.copy()
        vectors[places], forces[places] = basis.T @ model.right[places], inverse @ model.left[places]
        return replace(model, right=vectors, left=forces)

    covariance = derived_covariance(hammer, lambda model: pack_parameters(turned(model)))
    return replace(turned(hammer), covariance=covariance)
