"""Reciprocity: what a force at q does at p, a force at p does at q. Plain disagreement is a doubt.

Robots need not be reciprocal while they move (published ones differ by up to 0.25 of their drive points), so that only
what is beyond that is told.
"""

from collections.abc import Sequence

import numpy as np

from estimation import Frf, ReciprocityPair, reciprocity_pairs
from millfrf.core import Band
from modal_fit import ModalModel, mode_reciprocity

PLAIN = 0.3
"""Difference of ``H_pq`` and ``H_qp`` over their drive points' size, root mean square over the lines."""

OPPOSITE = 1.0
"""Difference over their own size that is told whatever their size is, where both are alike but for a factor."""

ALIKE = 0.8
"""Correlation from which two FRFs differ by a factor only; MAC of left and right vectors below which it is told."""

BEYOND_NOISE = 3.0


def check_reciprocity(frf: Frf, name: str = "the FRF", band: Band | None = None) -> list[str]:
    """Doubt an FRF matrix whose ``H_pq`` and ``H_qp`` plainly disagree.

    Parameters
    ----------
    frf
        FRF of receptance, mobility or accelerance.
    name
        Name of its file.
    band : Hz
        Lowest and highest frequency; None: the FRF's own, or all its lines.

    Returns
    -------
    list of str
        One doubt, of the worst pair, or none.
    """
    pairs = reciprocity_pairs(frf, band)
    wrong = [pair for pair in pairs if plainly_different(pair)]
    if not wrong:
        return []
    worst = max(wrong, key=_over_drive_points)
    others = f", and {len(wrong) - 1} more of {len(pairs)} pairs" if len(wrong) > 1 else ""
    return [
        f"{name} is not reciprocal: {worst.first} / {worst.second} and {worst.second} / {worst.first} differ by "
        f"{100 * worst.difference:.0f} % of their size (correlation {worst.correlation:.2f}){others}; {_remedy(worst)}"
    ]


def check_model_reciprocity(model: ModalModel, name: str = "the model") -> list[str]:
    """Doubt a model in which left and right vectors of a mode plainly disagree on the points that they share."""
    found = mode_reciprocity(model)
    if found is None:
        return []
    wrong = np.flatnonzero(found.assurance < ALIKE)
    if not len(wrong):
        return []
    worst = int(found.assurance.argmin())
    others = f", and {len(wrong) - 1} more of {len(model.poles)} modes" if len(wrong) > 1 else ""
    return [
        f"{name}: left and right vectors of mode {worst + 1} at {model.natural_frequencies[worst]:.4g} Hz disagree on "
        f"the {len(found.points)} points that they share (MAC {found.assurance[worst]:.2f}){others}; a structure at "
        "rest is reciprocal: check names and signs of the channels, and whether a weak mode is fitted from noise"
    ]


def plainly_different(pair: ReciprocityPair) -> bool:
    """Say whether a pair differs by more than robots do, and by more than its noise."""
    beyond = not pair.difference < BEYOND_NOISE * pair.noise
    opposite = pair.difference > OPPOSITE and pair.correlation > ALIKE
    return beyond and (_over_drive_points(pair) > PLAIN or opposite)


def _over_drive_points(pair: ReciprocityPair) -> float:
    return pair.difference * min(pair.weight, 1.0)


def _remedy(pair: ReciprocityPair) -> str:
    size, angle = abs(pair.factor), np.degrees(np.angle(pair.factor))
    if pair.correlation < ALIKE:
        return "check that forces and sensors stood where their names say, and that nothing moved between the tests"
    if abs(angle) > 150:
        return "one of the two has the wrong sign: turn the direction of its channel"
    return f"their ratio is {size:.2f} at {angle:.0f}°: check calibration and filters of the channels"


def shown_pairs(pairs: Sequence[ReciprocityPair], most: int) -> tuple[ReciprocityPair, ...]:
    """The pairs to show where there are many: those that matter most first."""
    return tuple(sorted(pairs, key=_over_drive_points, reverse=True)[:most])
