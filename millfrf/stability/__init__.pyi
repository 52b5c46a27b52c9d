from .certification import certified_lobes, certified_numerics
from .chatter.classify import classify_cut
from .chatter.evidence import gather_evidence
from .chatter.fitted_depth import ModelledCut
from .chatter.online import OnlineClassifier, StateChange, WatchedCut
from .chatter.stated_speed import strongest_lines
from .chatter.verdict import (
    CHATTER,
    INCONCLUSIVE,
    ChatterVerdict,
    CutSpectrum,
    JudgedCut,
    KeptCut,
    cut_spectrum,
    read_cuts,
    write_cuts,
)
from .cross_terms import cross_term_effect
from .drawn_structures import ranked_depths
from .edge_ends import EdgeEndEffect, edge_end_effect, edges_end_thin, uncertain_by_edge_ends
from .floquet.multipliers import multipliers
from .forced.simulation import SimulatedCut, simulate_cut, turns_to_settle
from .forced.surface_error import SurfaceError, surface_error
from .learning.cut_tables import read_cut_table, read_judged_cuts
from .learning.learned import Learned, learned_in_turn
from .learning.learned_limits import BandedLimits, learned_cut, learned_limits, prior_limits
from .learning.production_cuts import ProductionCut, with_edge_ends
from .limit_interval import LimitBand, limit_band, with_model
from .lobes_result import LOBES_COLUMNS, STATUSES, StabilityLobes, read_lobes, write_lobes
from .milling_loop import delay_system, with_static_high_modes
from .mode_coupling import judge_mode_coupling, mode_coupling_limit
from .recommendation import CONFIDENCE, DRIFT, RecommendedCut, certified_cut, lowered
from .robust_depth import RobustCut, largest_unmeasured_part, with_band
from .sensitivity import depth_errors, limit_sensitivities
from .solvers.collocation import collocation, collocation_limits, lowest_limits
from .solvers.multi_frequency import multi_frequency, multi_frequency_limits
from .solvers.semi_discretisation import semi_discretisation
from .solvers.varied_speed import varied_speed_limits, varied_speed_radius
from .solvers.zero_order import nyquist_limits, zero_order
from .speed_variation import SpeedVariation
from .tip_receptance import known_lines, restricted_to, with_residual_flexibility
from .two_structures import with_workpiece
from .unmeasured import UnmeasuredDynamics, unmeasured_dynamics, unmeasured_flexibility

__all__ = [
    "CHATTER",
    "CONFIDENCE",
    "DRIFT",
    "INCONCLUSIVE",
    "LOBES_COLUMNS",
    "STATUSES",
    "BandedLimits",
    "ChatterVerdict",
    "CutSpectrum",
    "EdgeEndEffect",
    "JudgedCut",
    "KeptCut",
    "Learned",
    "LimitBand",
    "ModelledCut",
    "OnlineClassifier",
    "ProductionCut",
    "RecommendedCut",
    "RobustCut",
    "SimulatedCut",
    "SpeedVariation",
    "StabilityLobes",
    "StateChange",
    "SurfaceError",
    "UnmeasuredDynamics",
    "WatchedCut",
    "certified_cut",
    "certified_lobes",
    "certified_numerics",
    "classify_cut",
    "collocation",
    "collocation_limits",
    "cross_term_effect",
    "cut_spectrum",
    "delay_system",
    "depth_errors",
    "edge_end_effect",
    "edges_end_thin",
    "gather_evidence",
    "judge_mode_coupling",
    "known_lines",
    "largest_unmeasured_part",
    "learned_cut",
    "learned_in_turn",
    "learned_limits",
    "limit_band",
    "limit_sensitivities",
    "lowered",
    "lowest_limits",
    "mode_coupling_limit",
    "multi_frequency",
    "multi_frequency_limits",
    "multipliers",
    "nyquist_limits",
    "prior_limits",
    "ranked_depths",
    "read_cut_table",
    "read_cuts",
    "read_judged_cuts",
    "read_lobes",
    "restricted_to",
    "semi_discretisation",
    "simulate_cut",
    "strongest_lines",
    "surface_error",
    "turns_to_settle",
    "uncertain_by_edge_ends",
    "unmeasured_dynamics",
    "unmeasured_flexibility",
    "varied_speed_limits",
    "varied_speed_radius",
    "with_band",
    "with_edge_ends",
    "with_model",
    "with_residual_flexibility",
    "with_static_high_modes",
    "with_workpiece",
    "write_cuts",
    "write_lobes",
    "zero_order",
]
