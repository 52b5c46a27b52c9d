"""`StabilityLobes`: the depth limit over spindle speed, with chatter frequency and type."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

BIFURCATIONS = ("hopf", "period-doubling", "fold", "none")


@dataclass(frozen=True)
class StabilityLobes:
    """Largest stable axial depth at each spindle speed.

    Parameters
    ----------
    spindle_speeds : (n_speeds,), rad/s
    depth_limits : (n_speeds,), m
        Infinite where the cut is stable at every depth that was asked for.
    chatter_frequencies : (n_speeds,), Hz
        At the limit; NaN exactly where ``bifurcations`` is ``none``.
    bifurcations
        One of ``hopf``, ``period-doubling``, ``fold``, ``none`` a speed.
    method
        Solver's name: ``zero-order``, ``nyquist`` ...
    warnings
        What a user should know before trusting the lines; one sentence each.
    """

    spindle_speeds: NDArray[np.float64]
    depth_limits: NDArray[np.float64]
    chatter_frequencies: NDArray[np.float64]
    bifurcations: tuple[str, ...]
    method: str
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        lengths = {
            len(self.spindle_speeds),
            len(self.depth_limits),
            len(self.chatter_frequencies),
            len(self.bifurcations),
        }
        if len(lengths) != 1:
            raise InputError(f"stability lobes: columns of unequal lengths {sorted(lengths)}")
        unknown = set(self.bifurcations) - set(BIFURCATIONS)
        if unknown:
            raise InputError(f"stability lobes: unknown bifurcation {sorted(unknown)}; use one of {BIFURCATIONS}")

    @property
    def spindle_speeds_rpm(self) -> NDArray[np.float64]:
        """Spindle speeds in revolutions per minute, for the user's edge."""
        return self.spindle_speeds * 60 / (2 * np.pi)
