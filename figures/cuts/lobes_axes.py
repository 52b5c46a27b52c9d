"""Stability lobes drawn into axes: depth limit over spindle speed."""

from matplotlib.axes import Axes

from stability import StabilityLobes

from ..axes import given_or_new, legend_beside
from .lobes import LIMITS, depth_axis_top, draw_limits, shade_unstable


def draw_lobes(lobes: StabilityLobes, axes: Axes | None = None, *, label: str | None = None) -> Axes:
    """Depth limits in mm over spindle speed in rpm; cuts above the line are unstable.

    Where a cut is stable at all depths that were asked for, the line is interrupted.

    Parameters
    ----------
    lobes
        Of one method.
    axes
        To draw into, such as those of other lobes; None: new ones, in which the unstable side is shaded.
    label
        Name in the legend; None: the method.
    """
    with given_or_new(axes) as shown:
        before = 0 if axes is None else sum(line.get_gid() == LIMITS for line in axes.lines)
        draw_limits(shown, lobes, lobes.method if label is None else label, before)
        if axes is None:
            top = depth_axis_top([lobes])
            shown.set_ylim(0, top)
            shade_unstable(shown, lobes, top)
        shown.set_xlabel("Spindle speed (rpm)")
        shown.set_ylabel("Axial depth limit (mm)")
        legend_beside(shown)
    return shown
