"""Blind trial of `cut identify`: random cutters, engagements, runout with tilt, drift, noise and exchanged axes.

`python -m benchmarks.coefficient_trial [--tests 100] [--seed 1]`. The forces come from loops over teeth, slices and
samples (`tests/mismatch/adapters/cut/loop_forces.py`), which share no code with the package. Counted are the
coefficients within two standard errors, exchanged axes that were found, and right ones that were refused.
"""

import argparse
import math
import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError
from millfrf.cutting import MillingProcess
from millfrf.mismatch import CutForces, identify_coefficients
from millfrf.mismatch.cut.identification.turn_spectra import turn_spectra
from millfrf.mismatch.cut.motion import SpindleLaw
from tests.mismatch.adapters.cut.loop_forces import COEFFICIENTS, RATE, loop_forces

NAMES = ("Fx", "Fy", "Fz")
PLACES = (((0, 1, 2), (1, 1, 1)), ((1, 0, 2), (1, 1, -1)), ((0, 1, 2), (-1, -1, -1)), ((1, 0, 2), (-1, 1, 1)))
"""Measured axes and signs: right, exchanged, on the workpiece, turned by a quarter."""


@dataclass(frozen=True)
class Outcome:
    """What one test gave."""

    exchanged: bool
    refused: bool  # with the axes as stated
    right_axes: bool  # the refusal, if any, named the right ones
    within: NDArray[np.bool_]  # (6,), whether each coefficient lies within two standard errors
    deviation: float  # of Ktc, as a share


def random_test(rng: np.random.Generator) -> Outcome:
    """Simulate three to five cuts and identify their coefficients."""
    teeth, helix = int(rng.integers(2, 5)), float(rng.choice([0.0, 0.3, 0.6]))
    start, end = ((0.0, math.pi), (math.pi / 2, math.pi), (0.0, 2.0))[int(rng.integers(3))]
    if teeth == 4 and helix == 0.0 and end - start == math.pi:
        helix = 0.3  # four straight teeth in a slot make a constant force
    feeds = np.linspace(rng.uniform(20e-6, 40e-6), rng.uniform(90e-6, 150e-6), int(rng.integers(3, 6)))
    runout, tilt, noise = rng.uniform(0, 15e-6), rng.uniform(-0.2, 0.2), rng.uniform(0.01, 0.05)
    order, signs = PLACES[int(rng.integers(len(PLACES)))] if rng.random() < 0.5 else PLACES[0]
    cuts = []
    for feed in feeds:
        process = MillingProcess(teeth, 0.016, math.pi / 2, 1e9, 0.3, 0.0, start, end, float(feed), helix_angle=helix)
        options = {"teeth": teeth, "helix": helix, "immersion": (start, end), "first_angle": float(rng.uniform(0, 6))}
        # the axis is tilted: the two halves of the depth have different runout
        force = sum(
            loop_forces(float(feed), depth=0.0015, runout=runout * share, noise=0.0, seconds=1.0, **options)
            for share in (1 - tilt, 1 + tilt)
        ) if helix == 0.0 else loop_forces(float(feed), runout=runout, noise=0.0, seconds=1.0, **options)  # fmt: skip
        force = force + noise * np.abs(force).max() * rng.standard_normal(force.shape)
        force += np.linspace(-0.5, 0.5, len(force))[:, None] * rng.uniform(-5, 5, 3)
        stated = SpindleLaw(0.0, 0.0, 6000 * math.pi / 30)
        turns = turn_spectra("cut", force[:, list(order)] * np.array(signs), RATE, stated, teeth, 4 * teeth)
        cuts.append(CutForces("cut", process, 0.003, turns.mean, turns.error, turns.drift, (0, 1, 2), turns.turning))
    return judged(cuts, (order, signs))


def judged(cuts: list[CutForces], place: tuple[tuple[int, ...], tuple[int, ...]]) -> Outcome:
    """Identify as a user would: as stated, and with the proposed axes where those are refused."""
    exchanged = place != PLACES[0]
    try:
        result, refused, right = identify_coefficients(cuts, NAMES), False, True
    except InputError as refusal:
        proposed = re.search(r"--axes=(\S+) the", str(refusal))
        if proposed is None:
            return Outcome(exchanged, True, False, np.zeros(6, dtype=bool), math.nan)
        words = proposed[1].split(",")
        refused, right = True, words == right_words(place)
        result = identify_coefficients(cuts, NAMES, words)
    deviation = result.coefficients - COEFFICIENTS
    within = np.abs(deviation) <= 2 * result.errors
    return Outcome(exchanged, refused, right, within, float(deviation[0] / COEFFICIENTS[0]))


def right_words(place: tuple[tuple[int, ...], tuple[int, ...]]) -> list[str]:
    """Return the option that undoes a placement."""
    order, signs = place
    return ["+-"[signs[order.index(axis)] < 0] + "XYZ"[order.index(axis)] for axis in range(3)]


def main() -> None:
    """Print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tests", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    outcomes = [random_test(np.random.default_rng((options.seed, number))) for number in range(options.tests)]
    exchanged = [outcome for outcome in outcomes if outcome.exchanged]
    within = np.array([outcome.within for outcome in outcomes])
    deviations = np.abs([outcome.deviation for outcome in outcomes])
    print(f"within two standard errors: {100 * within.mean(axis=0)} % (Ktc Krc Kac Kte Kre Kae)")
    print(
        f"deviation of Ktc: median {100 * np.nanmedian(deviations):.2g} %, largest {100 * np.nanmax(deviations):.2g} %"
    )
    print(f"exchanged axes found: {sum(o.refused and o.right_axes for o in exchanged)} of {len(exchanged)}")
    print(f"right axes refused: {sum(o.refused for o in outcomes if not o.exchanged)}")


if __name__ == "__main__":
    main()
