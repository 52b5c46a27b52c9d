"""The chart of milling of the repository bachrathyd/SOSD.jl (D. Bachrathy), commit f71b191, with its period doubling.

``examples/milling_stability.jl`` has the equation: a slot with two teeth, one mode at 100 Hz, and a force along the
cutting speed alone. The dots of ``assets/images/milling_stability_chart.png`` were read to a pixel, 14.7 rpm and
0.031 mm. Each is a point of the plane through the multipliers at the corners of a cell of 250 rpm and 0.25 mm.
"""

import math
from functools import cache

import numpy as np
import pytest
from benchmarks_of_literature import RPM, oscillators

from millfrf.cutting import MillingProcess
from millfrf.stability import collocation, multipliers

STRUCTURE = oscillators([(100.0, 0.02, (2 * math.pi * 100.0) ** 2, (1.0, 0.0, 0.0))])
SLOT = MillingProcess(2, 0.01, math.pi / 2, 1e8, 0.0, 0.0, 0.0, math.pi, 1e-4)
CELL_RPM, CELL_MM, PIXEL_RPM, PIXEL_MM = 250, 0.25, 14.7, 0.031
# rpm and mm
HOPF = [(2250, 2.408), (2441, 3.11), (2995, 8.593), (3206, 8.775), (3375, 8.876), (3537, 8.999), (3662, 9.084)]
DOUBLED = [
    (4004, 5.877), (4152, 5.135), (4360, 4.368), (4537, 3.843), (4696, 3.406), (5000, 2.608), (5180, 2.13),
    (6404, 1.126), (6672, 1.862), (7110, 3.133), (7434, 4.09), (7757, 5.078), (8083, 6.133), (8390, 7.116),
    (8757, 8.412), (9037, 9.4),
]  # fmt: skip
TURNING = [
    (2048, 3.612), (2108, 3.128), (2152, 2.881), (2640, 4.615), (2681, 5.361), (2706, 6.12), (2746, 7.891),
    (3846, 6.869), (5319, 1.842), (5522, 1.312), (5801, 0.756), (5961, 0.39), (6054, 0.39), (6162, 0.609),
]  # fmt: skip
"""Dots on steep flanks and around the lowest tip, 0.3 mm at 6000 rpm."""


def test_limits_where_the_curve_is_straight_in_a_cell() -> None:
    """Within 1.2 %: a pixel at 2 to 3 mm."""
    speeds, depths = np.array(HOPF + DOUBLED).T
    lobes = collocation(STRUCTURE, SLOT, speeds * RPM, 0.02)
    np.testing.assert_allclose(lobes.depth_limits * 1e3, depths, rtol=0.012)
    assert lobes.bifurcations == ("hopf",) * len(HOPF) + ("period-doubling",) * len(DOUBLED)


@cache
def excess(column: int, row: int) -> float:
    """What the largest multiplier of a revolution exceeds 1 by at a corner of the source's mesh."""
    return multipliers(STRUCTURE, SLOT, column * CELL_RPM * RPM, row * CELL_MM * 1e-3).spectral_radius ** 2 - 1


def dot_of_the_cell(column: int, row: int) -> tuple[float, float]:
    """Zero of the plane through its corners that lies nearest to its middle: rpm and mm."""
    low, right, high, both = (excess(column + i, row + j) for i, j in ((0, 0), (1, 0), (0, 1), (1, 1)))
    mean, along, up = (low + right + high + both) / 4, (right + both - low - high) / 2, (high + both - low - right) / 2
    share = mean / (along**2 + up**2)
    return (column + 0.5 - share * along) * CELL_RPM, (row + 0.5 - share * up) * CELL_MM


@pytest.mark.parametrize(("rpm", "depth"), [*HOPF, *DOUBLED, *TURNING])
def test_every_dot_is_what_the_mesh_makes_of_the_multipliers(rpm: float, depth: float) -> None:
    """Up to 25 % from the limit on flanks, a dot is within 1.2 pixels of what millfrf's multipliers give in a cell."""
    column, row = int(rpm // CELL_RPM), int(depth // CELL_MM)
    cells = [dot_of_the_cell(column + i, row + j) for i in (-1, 0, 1) for j in (-1, 0, 1) if row + j > 0]
    assert min(max(abs(x - rpm) / PIXEL_RPM, abs(y - depth) / PIXEL_MM) for x, y in cells) < 1.2
