"""Restoring force of a joint as a function of deflection, velocity, time and memory, and its derivatives."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Real

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


SOFTEST = 4.0
"""Sharpness below which a characteristic is bent long before its limit: that is no clipping."""

SHARPEST = 60.0
"""Sharpness above which rounding cannot be seen."""

LEAST_GAIN = 20.0
"""Gain in twice the log likelihood from which a rounded limit is preferred to a sharp one."""


@dataclass(frozen=True)
class Saturation:
    """``y = x / (1 + |x / l|^n)^(1 / n)``; a sharp limit has n = infinity.

    Parameters
    ----------
    limit, error
        Limit l in the channel's unit, and its standard error.
    sharpness, sharpness_error
        Sharpness n of the corner, and its standard error.
    """

    limit: float
    error: float
    sharpness: float = np.inf
    sharpness_error: float = 0.0


def saturated(signal: Real, limit: float, sharpness: float = np.inf) -> Real:
    """What a saturating channel shows of a signal.

    Parameters
    ----------
    signal : (n,)
        Signal before the channel, in the channel's unit.
    limit, sharpness
        Numbers l and n of the characteristic, as in :class:`Saturation`.

    Examples
    --------
    >>> saturated(np.array([0.5, 3.0]), 2.0)
    array([0.5, 2. ])
    >>> saturated(np.array([0.5, 2.0]), 2.0, 1.0)
    array([0.4, 1. ])
    """
    if np.isinf(sharpness):
        return np.asarray(np.clip(signal, -limit, limit))
    share = np.abs(signal) / limit
    # far beyond the limit the power of the share may overflow; that of its reciprocal stays finite
    large = np.maximum(share, 1.0)
    within = np.minimum(share, 1.0) ** sharpness
    return np.asarray(signal / large * (large**-sharpness + within) ** (-1 / sharpness))


def rounded(measured: Real, shown: Real, sharp: Saturation) -> Saturation:
    """The characteristic that leaves least of a channel, if rounding it is worth its number.

    Parameters
    ----------
    measured, shown : (n,)
        Samples of the channel as recorded, and as predicted without a limit.
    sharp
        The sharp limit that was found.
    """
    near = np.abs(shown) > 0.5 * sharp.limit
    due, seen = shown[near], measured[near]

    def left(numbers: Real) -> float:
        inverse = float(np.clip(numbers[1], 0.0, 1 / SOFTEST))
        sharpness = 1 / inverse if inverse > 1 / SHARPEST else np.inf
        return float(np.sum((seen - saturated(due, sharp.limit * float(numbers[0]), sharpness)) ** 2))

    start = np.array([[1.0, 0.02], [1.01, 0.06], [1.02, 0.2]])
    best = scipy.optimize.minimize(
        left, start[1], method="Nelder-Mead", options={"initial_simplex": start, "maxiter": 80, "xatol": 1e-4}
    )
    inverse = float(np.clip(best.x[1], 0.0, 1 / SOFTEST))
    gain = len(seen) * float(np.log(left(np.array([1.0, 0.0])) / max(float(best.fun), 1e-300)))
    if inverse <= 1 / SHARPEST or gain < LEAST_GAIN:
        return sharp
    found = Saturation(sharp.limit * float(best.x[0]), sharp.error, 1 / inverse)
    return _with_errors(found, due, float(best.fun) / len(seen))


def _with_errors(found: Saturation, due: Real, variance: float) -> Saturation:
    """Standard errors to first order, for noise of that variance on what is shown of ``due``."""
    steps = 1e-4 * np.array([found.limit, found.sharpness])
    slopes = []
    for k in range(2):
        above, below = (np.array([found.limit, found.sharpness]) + sign * steps * np.eye(2)[k] for sign in (1, -1))
        slopes.append((saturated(due, *above) - saturated(due, *below)) / (2 * steps[k]))
    slope = np.array(slopes)
    spread = np.sqrt(variance * np.diag(np.linalg.pinv(slope @ slope.T)))
    return replace(found, error=float(spread[0]), sharpness_error=float(spread[1]))


Columns = NDArray[np.float32]


@dataclass(frozen=True)
class LawSlopes:
    """How the force of a law changes with each of its numbers, for a motion that is given.

    A law is linear in its tables and springs, so that their changes make up that of the force; what a yield changes
    is a force wherever the element slipped last. No law has to be followed along a motion twice.

    Parameters
    ----------
    stiffness, damping : (n_points, n_numbers), N by a number's coordinate
        Change of the law's tables, at their points; no rows where no number changes a table.
    ramp : (2, n_numbers), N/m by a coordinate
        Change of the stiffness's change with time, and of its bend.
    springs : (n_elements, n_numbers), N/m by a coordinate
        Change of the elements' springs.
    yields : (n_elements, n_numbers), N by a coordinate
        Change of the force of each element that has yielded, from its yield alone.
    """

    stiffness: Columns
    damping: Columns
    ramp: Columns
    springs: Columns
    yields: Columns

    @property
    def parts(self) -> tuple[tuple[Columns, Columns], Columns, tuple[Columns, Columns]]:
        """Tables, ramp and elements, as the compiled loops take them."""
        return (self.stiffness, self.damping), self.ramp, (self.springs, self.yields)


def law_slopes(law: JointLaw, changes: Sequence[JointLaw]) -> LawSlopes:
    """Derivative of a law as the compiled loops take it.

    Parameters
    ----------
    law
        The law at which the derivative is taken.
    changes
        For each number, what the law changes by a unit of the number's coordinate: tables over the same spans as the
        law's, or none; the law's elements, with the change of their springs and yields.
    """
    ramp = [[change.ramp for change in changes], [change.bend for change in changes]]
    springs, yields = (
        [getattr(change, name) for change in changes] if len(law.springs) else np.zeros((len(changes), 0))
        for name in ("springs", "yields")
    )
    return LawSlopes(
        _by_number([change.stiffness for change in changes]),
        _by_number([change.damping for change in changes]),
        np.array(ramp, dtype=np.float32),
        np.array(springs, dtype=np.float32).T.copy(),
        (np.array(yields).T * law.springs[:, None]).astype(np.float32),
    )


def law_quotient(law: JointLaw, aside: JointLaw, step: float) -> JointLaw:
    """Difference quotient of two laws, on the spans of the first.

    Parameters
    ----------
    law, aside
        The law, and the law with a coordinate a step aside; both have the same elements.
    step
        Length of that step, in the coordinate's unit of a fit.
    """
    return JointLaw(
        law.reach,
        _table_quotient((law.stiffness, law.reach), (aside.stiffness, aside.reach), step),
        law.speed,
        _table_quotient((law.damping, law.speed), (aside.damping, aside.speed), step),
        (aside.ramp - law.ramp) / step,
        (aside.bend - law.bend) / step,
        (aside.springs - law.springs) / step,
        (aside.yields - law.yields) / step,
    )


def _table_quotient(here: tuple[Real, float], aside: tuple[Real, float], step: float) -> Real:
    """Difference quotient of two tables, each with the end of its axis; empty where they are the same."""
    table, end = here
    other, far = aside
    if np.array_equal(table, other) and end == far:
        return np.zeros(0)
    if len(other) != len(table) or far != end:
        other = np.interp(np.linspace(-end, end, len(table)), np.linspace(-far, far, len(other)), other)
    return np.asarray((other - table) / step)


def _by_number(tables: Sequence[Real]) -> Columns:
    """Tables side by side, (n_points, n_numbers), zeros for those that are empty; no rows where all are."""
    points = max((len(table) for table in tables), default=0)
    result = np.zeros((points, len(tables)), dtype=np.float32)
    for k, table in enumerate(tables):
        if len(table):
            result[:, k] = table
    return result
