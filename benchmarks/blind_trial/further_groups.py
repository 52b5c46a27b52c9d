"""Groups of cases that are harder than the first grid: joints inside, small modes beside, strong laws, steady records.

They are drawn by name (``--only inner_joint``), or all together with the older groups (``--only extended``), so that a
draw of the older groups stays what it was.
"""

from dataclasses import dataclass

import numpy as np

from .effects import LISTED

DIRECTIONAL = tuple(name for name, effect in LISTED.items() if effect.directional)
BESIDE_A_MODE = tuple(name for name in LISTED if name != "missing_mode")
STEADY = ("constant", "multisine")

FURTHER = ("inner_joint", "small_mode", "large", "steady")
"""Joint between two points that no channel shows; an unmodelled small mode beside the effect; a joint's law that moves
the response by 20 to 60 % (at 1 % noise); constant speed or periodic multisines, half of them without any effect."""

EXTENDED = {
    "main": 0.22,
    "control": 0.18,
    "foreign": 0.08,
    "pair": 0.12,
    "condition": 0.08,
    "inner_joint": 0.12,
    "small_mode": 0.08,
    "large": 0.06,
    "steady": 0.06,
}
"""Shares of the groups in the extended draw."""


@dataclass(frozen=True)
class FurtherCase:
    """What a further group decides of a case; the rest is drawn as in the older groups.

    Parameters
    ----------
    effect
        Concealed cause; ``none`` where there is nothing to find.
    strength
        Wanted ratio of the response's change to the noise.
    noise
        Share of each acceleration's RMS.
    excitation
        Kind of test.
    condition
        ``inner_joint`` and ``small_mode`` change the structure; the others are called ``standard``.
    """

    effect: str
    strength: float
    noise: float
    excitation: str
    condition: str


def further_case(group: str, count: int, rng: np.random.Generator) -> FurtherCase:
    """Draw the case number ``count`` of a further group; effects follow one another so that all come.

    Parameters
    ----------
    group
        One of :data:`FURTHER`.
    count
        Number of the case within its group.
    rng
        Source of the draw.
    """
    noise, excitation = float(rng.choice((0.01, 0.02, 0.03))), str(rng.choice(("sweeps", "porous", "mixed")))
    strength = float(rng.choice((1.0, 2.0, 5.0, 20.0)))
    if group == "inner_joint":
        return FurtherCase(DIRECTIONAL[count % len(DIRECTIONAL)], strength, noise, excitation, group)
    if group == "small_mode":
        return FurtherCase(BESIDE_A_MODE[count % len(BESIDE_A_MODE)], strength, noise, excitation, group)
    if group == "large":
        effect = DIRECTIONAL[count % len(DIRECTIONAL)]
        return FurtherCase(effect, float(rng.uniform(20, 60)), 0.01, excitation, "standard")
    names = tuple(LISTED)
    steady = STEADY[count // 2 % 2]
    if count % 2:
        return FurtherCase("none", 0.0, noise, steady, "standard")
    return FurtherCase(names[count // 2 % len(names)], strength, noise, steady, "standard")
