from .beyond_band import with_residual_flexibility
from .delayed_state import DelaySystem, delay_system
from .engagement import Piece, engagement_pieces
from .high_modes import with_static_high_modes
from .measured_lines import known_lines
from .tip_receptance import ToolReceptance, reaching, tool_directions, tool_receptance

__all__ = [
    "DelaySystem",
    "Piece",
    "ToolReceptance",
    "delay_system",
    "engagement_pieces",
    "known_lines",
    "reaching",
    "tool_directions",
    "tool_receptance",
    "with_residual_flexibility",
    "with_static_high_modes",
]
