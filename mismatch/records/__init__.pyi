from .common_band import ComparedBand, compared_band
from .deflection_form import in_deflections, without_delay
from .excited_lines import compared_lines, excited_band
from .held_out_parts import Recordings
from .measured_noise import noise_content, with_measured_noise
from .reading import (
    band_of,
    measured_part,
    read_at,
    read_recording,
    read_recordings,
    require_room_for_comparison,
)
from .true_forces import without_force_noise

__all__ = [
    "ComparedBand",
    "Recordings",
    "band_of",
    "compared_band",
    "compared_lines",
    "excited_band",
    "in_deflections",
    "measured_part",
    "noise_content",
    "read_at",
    "read_recording",
    "read_recordings",
    "require_room_for_comparison",
    "with_measured_noise",
    "without_delay",
    "without_force_noise",
]
