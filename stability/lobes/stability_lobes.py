"""`StabilityLobes`: the depth limit over spindle speed, with chatter frequency and type."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from foundation import InputError, Result, Summary, counted, drawing, optional_library

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes

BIFURCATIONS = ("hopf", "period-doubling", "fold", "none")
STATUSES = ("verified", "not-verified", "lower-bound", "unresolved")


@dataclass(frozen=True, eq=False, repr=False)
class StabilityLobes(Result):
    """Largest stable axial depth at each spindle speed.

    Parameters
    ----------
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds of the limits.
    depth_limits : (n_speeds,), m
        Largest stable axial depth; infinite where the cut is stable at every depth that was asked for, NaN where
        ``status`` is ``unresolved``.
    chatter_frequencies : (n_speeds,), Hz
        Chatter frequency at the limit; NaN exactly where ``bifurcations`` is ``none``.
    bifurcations
        Kind of instability, one word a speed: ``hopf``, ``period-doubling``, ``fold`` or ``none``.
    method
        Name of the solver: ``zero-order``, ``nyquist`` ...
    warnings
        Doubts that a user should know before trusting the limits; one sentence each.
    status
        Worth of each limit, one word a speed. ``verified``: Floquet multipliers agree below, above and on a ladder
        beneath the limit (or up to the largest depth, where there is no limit). ``not-verified``: nothing but the
        solver says so. ``lower-bound``: cuts up to the depth given are stable, the limit itself was not found.
        ``unresolved``: the depth is NaN, nothing is known. If it is left empty, it becomes ``not-verified`` at every
        speed.
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

    def plot(self, axes: "Axes | None" = None, *, label: str | None = None) -> "Axes":
        """Draw the depth limits over spindle speed and return the axes; see :func:`figures.draw_lobes`."""
        return drawing("draw_lobes")(self, axes, label=label)

    def to_frame(self) -> "pandas.DataFrame":
        """One row a spindle speed, with the columns of the file of lobes.

        Raises
        ------
        InputError
            pandas is not installed.
        """
        columns = {
            "spindle_speed_rpm": self.spindle_speeds_rpm,
            "depth_limit_m": self.depth_limits,
            "chatter_frequency_hz": self.chatter_frequencies,
            "bifurcation": list(self.bifurcations),
            "status": list(self.status),
        }
        return optional_library("pandas", "StabilityLobes.to_frame").DataFrame(columns)

    def _summary(self) -> Summary:
        rpm, known = self.spindle_speeds_rpm, np.isfinite(self.depth_limits)
        span = f", {rpm.min():.5g} to {rpm.max():.5g} rpm" if len(rpm) else ""
        counts = [f"{self.status.count(name)} {name}" for name in STATUSES if name in self.status]
        lowest = "no depth limit at any speed"
        if known.any():
            least = int(np.where(known, self.depth_limits, np.inf).argmin())
            lowest = f"lowest limit {1e3 * self.depth_limits[least]:.4g} mm at {rpm[least]:.5g} rpm"
            lowest += f", {self.bifurcations[least]}, {self.status[least]}"
        doubts = f"; {counted(len(self.warnings), 'warning')}" if self.warnings else ""
        columns = (rpm, 1e3 * self.depth_limits, self.chatter_frequencies, self.bifurcations, self.status)
        rows = tuple(
            (f"{speed:.5g}", f"{depth:.4g}", f"{chatter:.4g}", kind, status)
            for speed, depth, chatter, kind, status in zip(*columns, strict=True)
        )
        return Summary(
            f"StabilityLobes: {self.method}, {counted(len(rpm), 'spindle speed')}{span}",
            (lowest, f"status: {', '.join(counts) or 'none'}{doubts}"),
            ("speed (rpm)", "depth limit (mm)", "chatter (Hz)", "bifurcation", "status"),
            rows,
        )
