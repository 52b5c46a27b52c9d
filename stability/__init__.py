"""Stability lobes from modal models and measured FRFs: knows nothing of acquisition hardware."""

from .certification.certified import certified_lobes
from .chatter import (
    ChatterVerdict,
    CutSpectrum,
    Evidence,
    ForeignTone,
    ModelledCut,
    classify_cut,
    cut_spectrum,
    gather_evidence,
)
from .floquet.floquet_multipliers import Multipliers, multipliers
from .limit_uncertainty.first_order import depth_errors, probability_of_stability
from .limit_uncertainty.limit_interval import LimitBand, limit_band
from .limit_uncertainty.limit_samples import drawn, sampled_limits
from .limit_uncertainty.limit_sensitivity import LimitSensitivity, limit_sensitivities
from .lobes.lobes_file import read_lobes, write_lobes
from .lobes.stability_limits import StabilityLimits
from .lobes.stability_lobes import STATUSES, StabilityLobes
from .milling_loop.beyond_band import with_residual_flexibility
from .milling_loop.delayed_state import DelaySystem, delay_system
from .milling_loop.tip_receptance import ToolReceptance, tool_receptance
from .recommendation import RecommendedCut, certified_cut, lowered, recommended_cut
from .solvers.boundary import StabilityBoundary, StabilityGrid, stability_grid, trace_boundary
from .solvers.collocation_solver import collocation, collocation_limits, lowest_limits
from .solvers.mode_coupling import ModeCouplingLimit, mode_coupling_limit
from .solvers.multi_frequency_solver import multi_frequency, multi_frequency_limits
from .solvers.nyquist import is_stable, nyquist_limits, unstable_poles
from .solvers.semi_discretisation_solver import semi_discretisation, semi_discretised_multipliers
from .solvers.zero_order_solver import zero_order

__all__ = [
    "STATUSES",
    "ChatterVerdict",
    "CutSpectrum",
    "DelaySystem",
    "Evidence",
    "ForeignTone",
    "LimitBand",
    "LimitSensitivity",
    "ModeCouplingLimit",
    "ModelledCut",
    "Multipliers",
    "RecommendedCut",
    "StabilityBoundary",
    "StabilityGrid",
    "StabilityLimits",
    "StabilityLobes",
    "ToolReceptance",
    "certified_cut",
    "certified_lobes",
    "classify_cut",
    "collocation",
    "collocation_limits",
    "cut_spectrum",
    "delay_system",
    "depth_errors",
    "drawn",
    "gather_evidence",
    "is_stable",
    "limit_band",
    "limit_sensitivities",
    "lowered",
    "lowest_limits",
    "mode_coupling_limit",
    "multi_frequency",
    "multi_frequency_limits",
    "multipliers",
    "nyquist_limits",
    "probability_of_stability",
    "read_lobes",
    "recommended_cut",
    "sampled_limits",
    "semi_discretisation",
    "semi_discretised_multipliers",
    "stability_grid",
    "tool_receptance",
    "trace_boundary",
    "unstable_poles",
    "with_residual_flexibility",
    "write_lobes",
    "zero_order",
]
