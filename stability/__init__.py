"""Stability lobes from modal models and measured FRFs: knows nothing of acquisition hardware."""

from .beyond_band import with_residual_flexibility
from .boundary import StabilityBoundary, StabilityGrid, stability_grid, trace_boundary
from .certified import certified_lobes
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
from .collocation import collocation, collocation_limits, lowest_limits
from .delay_system import DelaySystem, delay_system
from .limit_band import LimitBand, limit_band
from .limit_samples import drawn, sampled_limits
from .limit_sensitivity import LimitSensitivity, limit_sensitivities
from .lobes_file import read_lobes, write_lobes
from .mode_coupling import ModeCouplingLimit, mode_coupling_limit
from .multi_frequency import multi_frequency, multi_frequency_limits
from .multipliers import Multipliers, multipliers
from .nyquist import is_stable, nyquist_limits, unstable_poles
from .recommended_cut import RecommendedCut, certified_cut, lowered, recommended_cut
from .semi_discretisation import semi_discretisation, semi_discretised_multipliers
from .stability_limits import StabilityLimits
from .stability_lobes import STATUSES, StabilityLobes
from .tool_receptance import ToolReceptance, tool_receptance
from .uncertainty import depth_errors, probability_of_stability
from .zero_order import zero_order

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
