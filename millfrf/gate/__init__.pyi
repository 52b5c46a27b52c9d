from .belonging import Given, check_belonging
from .calibrations import check_tip_and_sensor
from .clocks import clock_concerns, missing_concerns
from .cut_statements import check_one_speed, stated_cut
from .cutting_data import check_cutting, read_checked_cutting
from .frfs import check_frf, check_frf_for_fit
from .hammer import check_tap_recordings, check_taps_found, check_taps_used, check_window_damping, doubts_of_taps
from .inputs import check_band_recordings, check_inputs, driven_lines
from .lobes_band import check_band_of_lobes, limits_inside_band
from .local_lines import check_local_frf
from .looking import doubts_of
from .model_and_recordings import check_model_and_recordings
from .models import check_model, fit_doubts, smearing_doubts, stored_doubts, terms_left_out
from .plans import check_demand, check_duration
from .reciprocity import check_model_reciprocity, check_reciprocity, plainly_different, shown_pairs
from .recordings import (
    RECORD_AGAIN,
    JudgedRecording,
    check_channels,
    check_recordings,
    doubts_of_rate,
    join_judged,
    judge_recording,
)
from .sample_rates import Gain, check_sample_rates, gain_of
from .scales import check_scales
from .signals import ChannelLevel, level_table, look
from .spindle import check_depth, check_speed, check_speeds, lowest_frequency, rigid_directions
from .taps_in_segments import IMPULSIVE, LONGEST, Segmentation

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
    "stated_cut",
    "stored_doubts",
    "terms_left_out",
]
