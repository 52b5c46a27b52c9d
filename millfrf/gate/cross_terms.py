"""Check of lobes whose structure has cross terms that were not measured."""

import numpy as np

from estimation import Frf
from millfrf.core import Real, listed
from millfrf.cutting import MillingProcess
from millfrf.stability import cross_term_effect
from modal_fit import ModalModel


def cross_term_warnings(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float
) -> list[str]:
    """Return a warning that states cross terms that were not measured, and what small ones change in the limits.

    Parameters
    ----------
    structure
        Receptance at the tool tip, which states what was not measured.
    process
        Milling process of the limits.
    spindle_speeds : (n_speeds,), rad/s
        Speeds of the limits.
    max_depth : m
        Largest axial depth that is searched.
    """
    if structure.measured is None:
        return []
    effect = cross_term_effect(structure, process, spindle_speeds, max_depth)
    assumed = f"{structure.unmeasured} (response / force) was not measured and is taken as 0"
    if effect is None:
        return [
            f"{assumed}: what that changes in the limits is not known; hit one direction and measure the other, too"
        ]
    return [
        f"{assumed}: cross terms of +-{100 * effect.share:g} % of the direct terms lower limits by up to "
        f"{100 * effect.lowered:.2g} % (at {effect.speed * 30 / np.pi:.0f} rpm) and raise them by up to "
        f"{100 * effect.raised:.2g} %; {_modes_of_both(structure)}: hit one direction and measure the other, too"
    ]


def _modes_of_both(structure: Frf | ModalModel) -> str:
    """Return a clause on modes that overlap with one of another direction: they may be one mode at an angle to both."""
    angle = "a mode at an angle to both directions has cross terms as large as its direct ones"
    if not isinstance(structure, ModalModel) or structure.measured is None:
        return angle
    natural, width = structure.natural_frequencies, np.abs(structure.poles.real) / (2 * np.pi)
    moves = np.abs(structure.right) > 0
    apart = ~(moves[:, None, :] & moves[None, :, :]).any(axis=2)
    near = np.abs(natural[:, None] - natural) < width[:, None] + width
    first = np.flatnonzero((apart & near & (natural[:, None] <= natural)).any(axis=1))
    if not len(first):
        return angle
    shared = listed(list(dict.fromkeys(f"{natural[mode]:.4g}" for mode in first)))
    return f"at {shared} Hz both directions have a mode: if it is one at an angle to both, they are as large as those"
