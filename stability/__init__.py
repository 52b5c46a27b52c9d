"""Stability lobes from modal models and measured FRFs: knows nothing of acquisition hardware."""

from .boundary import StabilityBoundary, StabilityGrid, stability_grid, trace_boundary
from .collocation import collocation, collocation_limits
from .delay_system import DelaySystem, delay_system
from .lobes_file import read_lobes, write_lobes
from .multi_frequency import multi_frequency, multi_frequency_limits
from .multipliers import Multipliers, multipliers
from .nyquist import is_stable, nyquist_limits, unstable_poles
from .semi_discretisation import semi_discretisation, semi_discretised_multipliers
from .stability_limits import StabilityLimits
from .stability_lobes import StabilityLobes
from .tool_receptance import ToolReceptance, tool_receptance
from .zero_order import zero_order

__all__ = [
    "DelaySystem",
    "Multipliers",
    "StabilityBoundary",
    "StabilityGrid",
    "StabilityLimits",
    "StabilityLobes",
    "ToolReceptance",
    "collocation",
    "collocation_limits",
    "delay_system",
    "is_stable",
    "multi_frequency",
    "multi_frequency_limits",
    "multipliers",
    "nyquist_limits",
    "read_lobes",
    "semi_discretisation",
    "semi_discretised_multipliers",
    "stability_grid",
    "tool_receptance",
    "trace_boundary",
    "unstable_poles",
    "write_lobes",
    "zero_order",
]
