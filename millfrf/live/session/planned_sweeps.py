"""`SessionPlan`: the immersions, speeds and durations that a session has planned, in the units of the page."""

import math
from dataclasses import dataclass

from estimation import SweepPlan

_RPM = math.pi / 30

Immersion = tuple[float, float]
"""Start and exit angle, degrees."""


@dataclass(frozen=True)
class SessionPlan:
    """Sweeps that a session has planned.

    Parameters
    ----------
    immersions : degrees
        Start and exit angle of each test.
    speeds : rpm
        Lowest and highest spindle speed of every sweep.
    duration : s
        Duration of each sweep.
    teeth
        Number of teeth of the cutter.
    """

    immersions: tuple[Immersion, ...]
    speeds: tuple[float, float]
    duration: float
    teeth: int

    @property
    def band(self) -> tuple[float, float]:
        """Frequencies of the tooth passing, Hz."""
        return self.speeds[0] * self.teeth / 60, self.speeds[1] * self.teeth / 60

    def rpm(self, frequency: float) -> float:
        """Spindle speed at which the teeth pass with a frequency (Hz)."""
        return 60 * frequency / self.teeth


def session_plan(plan: SweepPlan) -> SessionPlan:
    """Give a plan of sweeps in the units of the page."""
    first, last = sorted(speed / _RPM for speed in plan.spindle_speeds)
    immersions = tuple((math.degrees(one.start_angle), math.degrees(one.exit_angle)) for one in plan.processes)
    return SessionPlan(immersions, (first, last), plan.duration, plan.processes[0].teeth)
