"""The gate: one place decides whether what is given makes sense for a job.

A function ``check_...`` raises :class:`millfrf.core.InputError` (one line: the value and the remedy) where the job
cannot
be done with what is given, and returns doubts: sentences that a command prints as warnings and stores with the
result."""

from .clocks import Gain, check_sample_rates, clock_concerns, gain_of, missing_concerns
from .cutting_data import (
    check_cutting,
    check_depth,
    check_one_speed,
    check_speed,
    check_speeds,
    lowest_frequency,
    read_checked_cutting,
    rigid_directions,
)
from .frfs import check_band_recordings, check_frf, check_frf_for_fit, check_inputs, check_local_frf, driven_lines
from .hammer import check_tap_recordings, check_taps_found, check_taps_used, check_window_damping, doubts_of_taps
from .lobes_band import check_band_of_lobes, limits_inside_band
from .models import check_model, fit_doubts, smearing_doubts, stored_doubts, terms_left_out
from .passivity import check_model_reciprocity, check_reciprocity, plainly_different, shown_pairs
from .plans import check_demand, check_duration
from .recordings import (
    IMPULSIVE,
    LONGEST,
    RECORD_AGAIN,
    JudgedRecording,
    Segmentation,
    check_channels,
    check_recordings,
    doubts_of,
    doubts_of_rate,
    join_judged,
    judge_recording,
)
from .signals import ChannelLevel, level_table, look
from .witnesses import Given, check_belonging, check_model_and_recordings, check_scales, check_tip_and_sensor

__all__ = [
    "IMPULSIVE",
    "LONGEST",
    "RECORD_AGAIN",
    "ChannelLevel",
    "Gain",
    "Given",
    "JudgedRecording",
    "Segmentation",
    "check_band_of_lobes",
    "check_band_recordings",
    "check_belonging",
    "check_channels",
    "check_cutting",
    "check_demand",
    "check_depth",
    "check_duration",
    "check_frf",
    "check_frf_for_fit",
    "check_inputs",
    "check_local_frf",
    "check_model",
    "check_model_and_recordings",
    "check_model_reciprocity",
    "check_one_speed",
    "check_reciprocity",
    "check_recordings",
    "check_sample_rates",
    "check_scales",
    "check_speed",
    "check_speeds",
    "check_tap_recordings",
    "check_taps_found",
    "check_taps_used",
    "check_tip_and_sensor",
    "check_window_damping",
    "clock_concerns",
    "doubts_of",
    "doubts_of_rate",
    "doubts_of_taps",
    "driven_lines",
    "fit_doubts",
    "gain_of",
    "join_judged",
    "judge_recording",
    "level_table",
    "limits_inside_band",
    "look",
    "lowest_frequency",
    "missing_concerns",
    "plainly_different",
    "read_checked_cutting",
    "rigid_directions",
    "shown_pairs",
    "smearing_doubts",
    "stored_doubts",
    "terms_left_out",
]
