"""`StabilityLobes`: the depth limit over spindle speed, with chatter frequency and type."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

BIFURCATIONS = ("hopf", "period-doubling", "fold", "none")
STATUSES = ("verified", "not-verified", "lower-bound", "unresolved")


@dataclass(frozen=True)
class StabilityLobes:
    """Largest stable axial depth at each spindle speed.

    Parameters
    ----------
    spindle_speeds : (n_speeds,), rad/s
    depth_limits : (n_speeds,), m
        Infinite where the cut is stable at every depth that was asked for; NaN where ``status`` is ``unresolved``.
    chatter_frequencies : (n_speeds,), Hz
        At the limit; NaN exactly where ``bifurcations`` is ``none``.
    bifurcations
        One of ``hopf``, ``period-doubling``, ``fold``, ``none`` a speed.
    method
        Solver's name: ``zero-order``, ``nyquist`` ...
    warnings
        What a user should know before trusting the lines; one sentence each.
    status
        One a speed. ``verified``: Floquet multipliers agree below, above and on a ladder beneath the limit (or up to
        the largest depth, where there is no limit). ``not-verified``: the solver's word alone. ``lower-bound``: cuts
        up to the depth given are stable, the limit itself was not found. ``unresolved``: the depth is NaN, nothing is
        known. Empty when made: ``not-verified`` at every speed.
    """

    spindle_speeds: NDArray[np.float64]
    depth_limits: NDArray[np.float64]
    chatter_frequencies: NDArray[np.float64]
    bifurcations: tuple[str, ...]
    method: str
    warnings: tuple[str, ...] = ()
    status: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.status:
            object.__setattr__(self, "status", ("not-verified",) * len(self.spindle_speeds))
        lengths = {
            len(self.spindle_speeds),
            len(self.depth_limits),
            len(self.chatter_frequencies),
            len(self.bifurcations),
            len(self.status),
        }
        if len(lengths) != 1:
            raise InputError(f"stability lobes: columns of unequal lengths {sorted(lengths)}")
        if foreign := set(self.status) - set(STATUSES):
            raise InputError(f"stability lobes: unknown status {sorted(foreign)}; use one of {STATUSES}")
        unknown = set(self.bifurcations) - set(BIFURCATIONS)
        if unknown:
            raise InputError(f"stability lobes: unknown bifurcation {sorted(unknown)}; use one of {BIFURCATIONS}")

    @property
    def spindle_speeds_rpm(self) -> NDArray[np.float64]:
        """Spindle speeds in revolutions per minute, for the user's edge."""
        return self.spindle_speeds * 60 / (2 * np.pi)
