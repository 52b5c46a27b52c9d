"""How far drive points move: a machine is neither as soft as a spring balance nor stiffer than rock."""

import numpy as np

from estimation import Frf

from .passivity import drive_points

SOFTEST = 1e-3
"""m/N: 1 N/mm at the resonance; robots and slender tools reach 1e-4 at most."""

STIFFEST = 1e-11
"""m/N at the resonance: 100 000 N/um, above any machine tool."""


def size_doubts(frf: Frf) -> list[str]:
    """Judge the largest motion of each drive point of a receptance, m/N; other quantities are not judged.

    Returns
    -------
    list of str
        Doubts: a node that is softer or stiffer than machines are, as a wrong unit makes it.
    """
    if frf.quantity != "receptance" or not frf.valid.any():
        return []
    doubts = []
    for node, points in drive_points(frf.responses, frf.excitations).items():
        peak = max(float(np.abs(frf.values[frf.valid, point.row, point.column]).max()) for point in points)
        if peak > SOFTEST:
            doubts.append(
                f"{node} moves {peak:.3g} m/N, more than {SOFTEST:g} m/N: is the FRF in mm/N or um/N, or an "
                "accelerance? Give m/N"
            )
        elif peak < STIFFEST:
            doubts.append(
                f"{node} moves {peak:.3g} m/N at most, less than {STIFFEST:g} m/N: was the force in kN? Give m/N"
            )
    return doubts
