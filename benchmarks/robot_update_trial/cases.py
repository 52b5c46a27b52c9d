"""Sixty cells with something wrong in the robot's file: what, and by how much, drawn from a seed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .independent_cell import Truth

Real = NDArray[np.float64]

KINDS = (
    *("stiffness",) * 14,
    *("payload off the tip",) * 7,
    *("lighter spindle",) * 7,
    *("tip compliance",) * 7,
    *("link flexibility",) * 6,
    *("damping of joints",) * 5,
    *("soft base",) * 4,
    *("nothing wrong",) * 2,
    *("foreign: heavier body", "foreign: joint law", "foreign: one link", "foreign: bearing") * 2,
)
"""Kinds of the sixty cases, in turn."""

SPINDLE_MASS, SPINDLE_PLACE, CENTRE = 45.0, -0.265, -0.25
"""Spindle of the file, kg; its centre from the tip, and the place from which a payload's is told, m."""

JOINTS = ("1", "2", "3", "4", "5", "6")


@dataclass(frozen=True)
class Case:
    """One case: its truth, the postures, and the numbers that the tested program should find.

    Parameters
    ----------
    kind
        Kind of what is wrong.
    truth
        What is wrong, in the cell's words.
    postures : (5, 6), rad
        Postures; the last one is never given to the program.
    expected
        Differences that the file should get, by the program's names; what is not named is zero.
    """

    kind: str
    truth: Truth
    postures: Real
    expected: dict[str, float]

    @property
    def foreign(self) -> bool:
        """Whether something is wrong that the program does not free."""
        return self.kind.startswith("foreign")


def draw_case(number: int, seed: int) -> Case:
    """Draw a case by its number."""
    generator = np.random.default_rng([seed, number])
    kind = KINDS[number % len(KINDS)]
    count = 1 + number % 6 if kind == "stiffness" else int(generator.integers(0, 3))
    if kind == "nothing wrong":
        count = 0
    chosen = generator.choice(JOINTS, count, replace=False)
    factors = {str(j): float(np.exp(generator.choice([-1, 1]) * generator.uniform(0.1, 0.5))) for j in chosen}
    expected = {f"joint {j} stiffness": float(np.log(f)) for j, f in factors.items()}
    more, result = _special(kind, generator)
    spread = np.radians([60.0, 25.0, 25.0, 60.0, 40.0, 60.0])
    postures = np.radians([0.0, -10.0, 100.0, 0.0, 60.0, 0.0]) + generator.uniform(-1, 1, (5, 6)) * spread
    return Case(kind, Truth(joints=factors, **more), postures, expected | result)


def _special(kind: str, generator: np.random.Generator) -> tuple[dict, dict[str, float]]:  # type: ignore[type-arg]
    uniform = generator.uniform
    if kind == "payload off the tip":
        mass, place = (
            float(uniform(4, 15)),
            (float(uniform(-0.1, 0.1)), float(uniform(-0.1, 0.1)), float(uniform(-0.5, 0))),
        )
        named = {"payload mass": mass, "payload place x": place[0], "payload place y": place[1]}
        return {"payload": (mass, place)}, named | {"payload place z": place[2] - CENTRE}
    if kind == "lighter spindle":
        factor = float(uniform(0.65, 0.88))
        named = {"payload mass": SPINDLE_MASS * (factor - 1), "payload place z": SPINDLE_PLACE - CENTRE}
        named |= {"spindle inertia": float(np.log(factor))}
        return {"spindle": factor}, named
    if kind == "tip compliance":
        lateral, axial = float(uniform(5e-8, 2e-7)), float(uniform(1e-8, 4e-8))
        named = {"tool lateral compliance": lateral, "tool axial compliance": axial, "tool mass": 0.3}
        named |= {"mass on the tool's spring": 0.3 - 0.2}
        return {"tool": (lateral, axial, 0.3)}, named
    if kind == "link flexibility":
        factor = float(np.exp(generator.choice([-1, 1]) * uniform(0.15, 0.5)))
        return {"links": factor}, {"links": float(np.log(factor))}
    if kind == "damping of joints":
        chosen = generator.choice(JOINTS[:5], 2, replace=False)
        ratios = {str(j): float(uniform(0.01, 0.04)) for j in chosen}
        factor = float(np.exp(uniform(-0.5, 0.5)))
        named = {f"joint {j} damping": ratio for j, ratio in ratios.items()}
        return {"dashpots": ratios, "damping": factor}, named | {"damping": float(np.log(factor))}
    if kind == "soft base":
        compliance = float(uniform(4e-9, 2.5e-8))
        return {"base": compliance}, {"base tilting compliance": compliance}
    foreign = {
        "foreign: heavier body": {"body": (int(generator.integers(1, 3)), float(uniform(1.4, 2.2)))},
        "foreign: joint law": {"cubic": (str(generator.choice(["2", "3", "5"])), 4e-5)},
        "foreign: one link": {"one_link": (int(generator.integers(1, 4)), float(uniform(0.35, 0.6)))},
        "foreign: bearing": {"tilting": (str(generator.choice(["2", "3"])), float(uniform(1e-8, 4e-8)))},
    }
    return foreign.get(kind, {}), {}
