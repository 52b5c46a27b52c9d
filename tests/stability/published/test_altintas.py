"""Lobes of shaping with two modes: Y. Altintas, Manufacturing Automation, 2nd ed., Cambridge 2012, example on p. 131.

Data and figure were read in the repository leekunhwee/Dynamics (``Cutting/Stability/FrequencyDomain/Turning/Two DOF
Example``, ``README.md`` and ``TwoDofFRFs.m``), which states the page; ``Lobe.png`` draws the lobes of the two modes
with lines 2 to 3 pixels wide.
"""

import math

import numpy as np
from benchmarks_of_literature import RPM, oscillators

from millfrf.cutting import turning_process
from millfrf.stability import certified_lobes

# the lower of the two lines, mm over rpm; a pixel is 0.22 mm high and 33 rpm wide
DRAWN = {
    4000: 7.42, 5500: 7.20, 8000: 11.02, 8500: 7.20, 9000: 7.53, 9500: 10.04, 10500: 11.78, 11000: 10.15, 11500: 9.49,
    12000: 9.38, 12500: 9.71, 13000: 10.36, 14000: 12.87, 14500: 14.84,
}  # fmt: skip
PIXEL_MM, PIXEL_RPM = 60 / 275, 13000 / 395


def test_lobes_of_two_modes() -> None:
    """The cutting force acts along y alone, so that 30 and -45 deg between y and the modes count twice.

    A reading may be off by a pixel in each direction.
    """
    modes = ((250.0, 0.012, 2.26e8, 30.0), (150.0, 0.010, 2.13e8, -45.0))
    structure = oscillators(
        [(f, z, k, (math.cos(math.radians(a)), math.sin(math.radians(a)), 0.0)) for f, z, k, a in modes]
    )
    tangential = 1.0  # Pa; small beside the 1000 MPa along y
    process = turning_process(0.05, math.pi / 2, tangential, 1000e6 / tangential)
    speeds = np.array(list(DRAWN), dtype=float)
    here, *beside = (
        certified_lobes(structure, process, (speeds + shift) * RPM, 0.1) for shift in (0.0, -PIXEL_RPM, PIXEL_RPM)
    )
    assert set(here.numerics) == {"verified"}
    limits = here.depth_limits * 1e3
    steep = np.max([np.abs(lobes.depth_limits * 1e3 - limits) for lobes in beside], axis=0)
    assert (np.abs(limits - list(DRAWN.values())) < PIXEL_MM + steep).all()
    assert [frequency < 200 for frequency in here.chatter_frequencies] == [rpm > 10000 for rpm in DRAWN]
