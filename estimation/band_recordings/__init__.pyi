from .channel_matching import (
    MatchedChannel,
    channel_at,
    channels_in_words,
    channels_of,
    matched_channels,
    names_at,
    refuse_shared,
)
from .motion_quantities import (
    DERIVATIVE_ORDERS,
    before_high_pass,
    derivative_orders,
    high_pass_corners,
    kinematic_factor,
)
from .reading import band_of_channels, read_band_recording, require_room_at_rate, require_room_for_band
from .reduced_recording import BandRecording, band_recording, before_force_high_pass
from .resampling import Resampler, needed_ratio, resampled, whole_ratio, widest_band
from .room import require_room
from .spectrum_lines import WindowedSpectrum, padded_force, windowed_spectrum

__all__ = [
    "DERIVATIVE_ORDERS",
    "BandRecording",
    "MatchedChannel",
    "Resampler",
    "WindowedSpectrum",
    "band_of_channels",
    "band_recording",
    "before_force_high_pass",
    "before_high_pass",
    "channel_at",
    "channels_in_words",
    "channels_of",
    "derivative_orders",
    "high_pass_corners",
    "kinematic_factor",
    "matched_channels",
    "names_at",
    "needed_ratio",
    "padded_force",
    "read_band_recording",
    "refuse_shared",
    "require_room",
    "require_room_at_rate",
    "require_room_for_band",
    "resampled",
    "whole_ratio",
    "widest_band",
    "windowed_spectrum",
]
