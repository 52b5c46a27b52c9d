"""Whether tests that measured the same entry agree on it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..frf_matrix.frf import Frf
from .sums import TapSums


@dataclass(frozen=True)
class Disagreement:
    """An entry of the FRF matrix that two tests measured and that one of them sees differently.

    Parameters
    ----------
    test
        Name of the test that differs.
    response, excitation
        Degrees of freedom of the entry, ``node:direction``.
    share
        Energy of the difference from the merged entry over the energy of that entry, weighed by the force.
    """

    test: str
    response: str
    excitation: str
    share: float


def disagreements_of(tests: Sequence[TapSums], frf: Frf) -> tuple[Disagreement, ...]:
    """How far each test is from the matrix, for entries that more than one test measured with one force at a time."""
    n, found = len(frf.frequencies), []
    single = [test for test in tests if len(test.excitations) == 1]
    inside = frf.valid & (frf.frequencies > 0)
    if frf.band is not None:
        inside &= (frf.frequencies >= frf.band[0]) & (frf.frequencies <= frf.band[1])
    for test in single:
        force = np.real(test.input_power[:n, 0, 0])[inside]
        column = frf.excitations.index(test.excitations[0])
        for row, label in enumerate(test.responses):
            others = [each for each in single if each.excitations == test.excitations and label in each.responses]
            merged = frf.values[inside, frf.responses.index(label), column]
            energy = float(force @ np.abs(merged) ** 2)
            if len(others) > 1 and energy > 0:
                own = test.cross[:n, row, 0][inside] / np.where(force > 0, force, 1.0)
                share = float(force @ np.abs(own - merged) ** 2) / energy
                found.append(Disagreement(test.name, label, test.excitations[0], share))
    return tuple(sorted(found, key=lambda each: -each.share))
