"""The cut that simulations repeat: the paper's cutter in acetal, and the immersions of three sweeps."""

import math

from cutting import MillingProcess

ACETAL_CUTTER = MillingProcess(
    teeth=2,
    diameter=12.7e-3,
    edge_angle=math.pi / 2,
    ktc=119e6,
    krc=0.17,
    kac=0.33,
    start_angle=math.pi / 2,
    exit_angle=math.pi,
    feed_per_tooth=0.15e-3,
    runout=10e-6,
)
"""A two-fluted 12.7 mm end mill in acetal, half-immersion down-milling (Mohammadi & Ahmadi); the runout is ours."""

SWEEP_IMMERSIONS = {"central": (0.38, 0.61), "down": (0.77, 1.0), "up": (0.0, 0.23)}
"""Start and exit angles of three sweeps over pi, whose forces are independent (ibid.)."""
