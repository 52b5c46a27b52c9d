"""Stability lobes from modal models and measured FRFs: knows nothing of acquisition hardware."""

from .lobes_file import read_lobes, write_lobes
from .nyquist import is_stable, nyquist_limits, unstable_poles
from .stability_lobes import StabilityLobes
from .tool_receptance import ToolReceptance, tool_receptance
from .zero_order import zero_order

__all__ = [
    "StabilityLobes",
    "ToolReceptance",
    "is_stable",
    "nyquist_limits",
    "read_lobes",
    "tool_receptance",
    "unstable_poles",
    "write_lobes",
    "zero_order",
]
