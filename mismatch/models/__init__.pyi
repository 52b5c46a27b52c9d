from .cause import Cause, held_values, location_of
from .fitting import ENOUGH, Fit, Rival, fit, modes_are_odd, oddity_of_modes, residual
from .freed_laws import EVERYTHING, with_free_forms, with_linear_part
from .hypothesis import Hypothesis, line_response, predict_lines, surround
from .linear_lines import response_to_joint
from .lines import receptance_at
from .misfit import (
    fitted_noise,
    known_noise,
    least_misfit,
    levels,
    outdoes_noise,
    shares_left,
    through_structure,
    whitened,
)
from .model_shape import ModelShape
from .model_terms import hypothesis_of, improved_model
from .plain_fits import even_fit, plain_fit
from .refinement import believed, following_all, gain_at_rest, gives_one_up, settled, with_chain_from_belief
from .scale_of_joints import counted_at_tip, spread_with_scale
from .slopes import jacobian

__all__ = [
    "ENOUGH",
    "EVERYTHING",
    "Cause",
    "Fit",
    "Hypothesis",
    "ModelShape",
    "Rival",
    "believed",
    "counted_at_tip",
    "even_fit",
    "fit",
    "fitted_noise",
    "following_all",
    "gain_at_rest",
    "gives_one_up",
    "held_values",
    "hypothesis_of",
    "improved_model",
    "jacobian",
    "known_noise",
    "least_misfit",
    "levels",
    "line_response",
    "location_of",
    "modes_are_odd",
    "oddity_of_modes",
    "outdoes_noise",
    "plain_fit",
    "predict_lines",
    "receptance_at",
    "residual",
    "response_to_joint",
    "settled",
    "shares_left",
    "spread_with_scale",
    "surround",
    "through_structure",
    "whitened",
    "with_chain_from_belief",
    "with_free_forms",
    "with_linear_part",
]
