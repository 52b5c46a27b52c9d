"""`StabilityLimits`: every depth at which a cut gains or loses stability, islands included."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .stability_lobes import StabilityLobes

Real = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class StabilityLimits:
    """All crossings of the unit circle below a largest depth, sorted by speed and then by depth.

    Parameters
    ----------
    spindle_speeds : (n_speeds,), rad/s
        Speeds that were looked at, whether or not they have a limit.
    max_depth : m
        Largest depth that was searched.
    speed : (n_limits,)
        Index of each limit's speed in ``spindle_speeds``.
    depth : (n_limits,), m
        Axial depth of each limit.
    frequency : (n_limits,), Hz
        Frequency of the strongest line of the tool's motion at the limit.
    bifurcation
        ``hopf``, ``period-doubling`` or ``fold``, one a limit.
    change : (n_limits,)
        Change of the number of unstable multipliers just above the depth: 2 or -2 (Hopf), 1 or -1 (the other two).
    error : (n_limits,), m
        Estimated numerical error of the depth.
    method
        Name of the solver.
    warnings
        Doubts about the limits, one sentence each.
    resolved : (n_speeds,), m
        Depth below which the search left nothing unresolved; infinite where that is so up to ``max_depth``. If it is
        left empty, it becomes infinite everywhere.
    """

    spindle_speeds: Real
    max_depth: float
    speed: Index
    depth: Real
    frequency: Real
    bifurcation: tuple[str, ...]
    change: Index
    error: Real
    method: str
    warnings: tuple[str, ...] = ()
    resolved: Real = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        if not len(self.resolved):
            object.__setattr__(self, "resolved", np.full(len(self.spindle_speeds), np.inf))

    def lowest(self) -> StabilityLobes:
        """The lowest limit at each speed: below it every cut is stable.

        Where the search left something unresolved below it, the depth down to which nothing was left stands in its
        place, as a lower bound.
        """
        depths = np.full(len(self.spindle_speeds), np.inf)
        frequencies = np.full(len(self.spindle_speeds), np.nan)
        kinds = ["none"] * len(self.spindle_speeds)
        present, first = np.unique(self.speed, return_index=True)
        depths[present], frequencies[present] = self.depth[first], self.frequency[first]
        for speed, limit in zip(present, first, strict=True):
            kinds[speed] = self.bifurcation[limit]
        bounded = (self.resolved < depths) & (self.resolved < self.max_depth)
        depths, frequencies = np.where(bounded, self.resolved, depths), np.where(bounded, np.nan, frequencies)
        status = np.where(bounded, "lower-bound", "not-verified").tolist()
        warnings = self.warnings
        if bounded.any():
            warnings += (
                f"at {bounded.sum()} of {len(depths)} speeds of this search, what lies deeper than the depth given "
                "could not be resolved",
            )
            kinds = ["none" if here else kind for here, kind in zip(bounded, kinds, strict=True)]
        return StabilityLobes(
            self.spindle_speeds, depths, frequencies, tuple(kinds), self.method, warnings, tuple(status)
        )

    def unstable_multipliers(self, depths: Real) -> Index:
        """Number of unstable multipliers at every speed and depth, shape (n_speeds, n_depths).

        Zero is stable: an island of instability has stable depths above it.
        """
        depths = np.asarray(depths, dtype=float)
        total = np.zeros((len(self.spindle_speeds), len(depths)), dtype=np.int64)
        above = np.where(depths[None, :] > self.depth[:, None], self.change[:, None], 0)
        np.add.at(total, self.speed, above)
        return total

    def stable_intervals(self, speed: int) -> list[tuple[float, float]]:
        """Depths (m) between which cuts at the speed of that index are stable, lowest first, up to ``max_depth``."""
        here = self.speed == speed
        edges = np.concatenate([[0.0], self.depth[here], [self.max_depth]])
        unstable = np.concatenate([[0], np.cumsum(self.change[here])])
        return [(float(a), float(b)) for a, b, n in zip(edges, edges[1:], unstable, strict=False) if n == 0]
