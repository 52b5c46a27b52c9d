from .boundary import StabilityBoundary, StabilityGrid, stability_grid, trace_boundary
from .collocation_solver import collocation, collocation_limits, lowest_limits
from .mode_coupling import ModeCouplingLimit, mode_coupling_limit
from .multi_frequency_solver import multi_frequency, multi_frequency_limits, slowest_speed
from .nyquist import is_stable, nyquist_limits, unstable_poles
from .semi_discretisation_solver import semi_discretisation, semi_discretised, semi_discretised_multipliers
from .varied_limits import critical_motion
from .zero_order_solver import checked_speeds, zero_order

__all__ = [
    "ModeCouplingLimit",
    "StabilityBoundary",
    "StabilityGrid",
    "checked_speeds",
    "collocation",
    "collocation_limits",
    "critical_motion",
    "is_stable",
    "lowest_limits",
    "mode_coupling_limit",
    "multi_frequency",
    "multi_frequency_limits",
    "nyquist_limits",
    "semi_discretisation",
    "semi_discretised",
    "semi_discretised_multipliers",
    "slowest_speed",
    "stability_grid",
    "trace_boundary",
    "unstable_poles",
    "zero_order",
]
