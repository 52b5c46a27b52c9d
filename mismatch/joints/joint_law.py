"""The restoring force of one joint as a function of its deflection, velocity, time and memory."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]

POINTS = 8193
"""Number of points of a table over deflection or velocity."""


def _none() -> Real:
    return np.zeros(0)


@dataclass(frozen=True)
class JointLaw:
    """Force g that a joint takes beyond its linear stiffness and damping, ``g = S(x) + D(v) + r(tau) x + sum_i w_i``.

    Any law of deflection x and velocity v goes into the two tables; memory is a sum of elastic-plastic elements in
    parallel, ``w_i' = k_i v`` held within ``|w_i| <= k_i y_i`` (Iwan, J. Applied Mechanics 33, 1966): one is an
    elastic-plastic spring, several a smooth hysteresis, a stiff one dry friction with presliding.

    Parameters
    ----------
    reach
        Deflection x at the ends of its table, m; beyond, the table goes on straight.
    stiffness : (POINTS,), N
        Force S at evenly spaced x from -reach to reach; empty: none.
    speed
        Velocity at the ends of its table, m/s.
    damping : (POINTS,), N
        Force D at evenly spaced v from -speed to speed; empty: none.
    ramp
        Change r of the stiffness from the beginning to the end of a recording, N/m; tau runs from -1/2 to 1/2.
    bend
        Stiffness b by which the middle lies below the straight change, N/m: ``r tau + b (4 tau^2 - 1)``.
    springs : (n,), N/m
        Stiffness k of each elastic-plastic element.
    yields : (n,), m
        Deflection y at which each elastic-plastic element yields.
    """

    reach: float = 1.0
    stiffness: Real = field(default_factory=_none)
    speed: float = 1.0
    damping: Real = field(default_factory=_none)
    ramp: float = 0.0
    bend: float = 0.0
    springs: Real = field(default_factory=_none)
    yields: Real = field(default_factory=_none)

    @property
    def loses_energy(self) -> bool:
        """Whether the force depends on velocity or has a memory; else it is that of a spring."""
        return bool(len(self.damping) or len(self.springs))

    def tables(self) -> tuple[Real, Real]:
        """Both tables, zeros where there is none."""
        zero = np.zeros(3)
        return (self.stiffness if len(self.stiffness) else zero, self.damping if len(self.damping) else zero)


@dataclass(frozen=True)
class JointMotion:
    """How far and how fast a joint moved in the trials: what a law's shape is chosen from.

    Parameters
    ----------
    deflection
        Standard deviation of the deflection in the strongest trial, m.
    velocity
        Standard deviation of the velocity in the same trial, m/s.
    reach, speed
        Ends of the law's tables: two and a half times the largest deflection (m) and velocity (m/s) of all trials.
    stiffness
        Static stiffness of the structure along the joint's direction, N/m.
    """

    deflection: float
    velocity: float
    reach: float
    speed: float
    stiffness: float

    @property
    def deflections(self) -> Real:
        """Points of the table over deflection, m."""
        return np.linspace(-self.reach, self.reach, POINTS)

    @property
    def velocities(self) -> Real:
        """Points of the table over velocity, m/s."""
        return np.linspace(-self.speed, self.speed, POINTS)
