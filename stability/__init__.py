"""Stability lobes from modal models and measured FRFs: knows nothing of acquisition hardware."""

from .collocation import collocation
from .lobes_file import read_lobes, write_lobes
from .multi_frequency import multi_frequency
from .nyquist import is_stable, nyquist_limits, unstable_poles
from .semi_discretisation import semi_discretisation
from .stability_lobes import StabilityLobes
from .tool_receptance import ToolReceptance, tool_receptance
from .zero_order import zero_order

__all__ = [
    "StabilityLobes",
    "ToolReceptance",
    "collocation",
    "is_stable",
    "multi_frequency",
    "nyquist_limits",
    "read_lobes",
    "semi_discretisation",
    "tool_receptance",
    "unstable_poles",
    "write_lobes",
    "zero_order",
]
