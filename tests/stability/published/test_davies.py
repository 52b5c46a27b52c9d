"""Highly interrupted cutting: two families of lobes in closed form, Hopf and period doubling.

M. A. Davies, J. R. Pratt, B. Dutterer & T. J. Burns, Stability prediction for low radial immersion milling, J. Manuf.
Sci. Eng. 124 (2002) 217-225: a tooth that cuts for an instant kicks the free oscillator. The map of position and speed
from tooth to tooth has ``mu^2 - T mu + D + kappa (mu - 1) P = 0``: T and D are trace and determinant of the free motion
over a tooth's period, P the position a period after a kick of unit speed, kappa the kick per chip thickness. It is
derived here from ``x+ = x-``, ``v+ = v- - kappa (x - x(t - tau))``; ``mu = -1`` and ``|mu| = 1`` bound the depth.
"""

import math

import numpy as np
from benchmarks_of_literature import RPM, one_degree_of_freedom

from millfrf.cutting import MillingProcess
from millfrf.stability import collocation

FREQUENCY, DAMPING, MASS = 2 * math.pi * 922, 0.011, 0.03993  # rad/s, ratio, kg
TEETH, TANGENTIAL, RADIAL = 2, 6e8, 1 / 3
SPEEDS = np.array([7000.0, 9500, 11500, 16000, 21000, 24000, 30000, 45000]) * RPM


def closed_form(speed: float, contact: float) -> tuple[float, str]:
    """Depth limit (m) and bifurcation where a tooth is in the cut over a small angle (rad), up-milling."""
    tau, damped = 2 * math.pi / TEETH / speed, FREQUENCY * math.sqrt(1 - DAMPING**2)
    decay = math.exp(-DAMPING * FREQUENCY * tau)
    position = decay * math.sin(damped * tau) / damped
    trace, determinant = 2 * decay * math.cos(damped * tau), decay**2
    doubled = position > 0
    kick = (1 + trace + determinant) / (2 * position) if doubled else (determinant - 1) / position
    sines = math.sin(contact) ** 2 / 2 + RADIAL * (contact / 2 - math.sin(2 * contact) / 4)
    return kick * MASS * speed / (TANGENTIAL * sines), "period-doubling" if doubled else "hopf"


def test_limits_approach_the_closed_form() -> None:
    """Its error is of first order in the contact's duration: half of it, half the error, and 1 % is left."""
    errors = []
    for immersion in (0.0025, 0.000625):
        contact = math.acos(1 - 2 * immersion)
        process = MillingProcess(TEETH, 0.01, math.pi / 2, TANGENTIAL, RADIAL, 0.0, 0.0, contact, 1e-4)
        lobes = collocation(one_degree_of_freedom(), process, SPEEDS, 20.0)
        depths, kinds = zip(*(closed_form(speed, contact) for speed in SPEEDS), strict=True)
        assert lobes.bifurcations == kinds
        errors.append(lobes.depth_limits / np.array(depths) - 1)
    assert set(kinds) == {"hopf", "period-doubling"}
    assert (np.abs(errors[1]) < 0.08).all()
    assert (np.abs(2 * errors[1] - errors[0]) < 0.012).all()
