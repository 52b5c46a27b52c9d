from .elimination import Complex, Elimination, Modes, Real, derivatives, eliminate
from .held_out_lines import holds_on_held_out_lines
from .neighbourhood import (
    around,
    half_power_lines,
    mode_power,
    outside_power,
    participation,
    participations,
    without_modes,
)
from .noise_of_entries import entry_noise
from .outer_modes import inside, just_outside, with_outer_as_residuals
from .outside_terms import with_fewest_terms, with_fixed_poles
from .refinement import Refined, normal_equations, refine, weighted_matrix, without_response
from .whitened_lines import MeasuredLines, correlated_lines, measured_lines

__all__ = [
    "Complex",
    "Elimination",
    "MeasuredLines",
    "Modes",
    "Real",
    "Refined",
    "around",
    "correlated_lines",
    "derivatives",
    "eliminate",
    "entry_noise",
    "half_power_lines",
    "holds_on_held_out_lines",
    "inside",
    "just_outside",
    "measured_lines",
    "mode_power",
    "normal_equations",
    "outside_power",
    "participation",
    "participations",
    "refine",
    "weighted_matrix",
    "with_fewest_terms",
    "with_fixed_poles",
    "with_outer_as_residuals",
    "without_modes",
    "without_response",
]
