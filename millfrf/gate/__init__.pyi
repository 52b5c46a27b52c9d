from .clocks import Gain, check_sample_rates, clock_warnings, gain_of, missing_sample_warnings
from .comparisons import (
    ReportFile,
    check_belonging,
    check_model_and_recordings,
    check_scales,
    check_tip_and_sensor,
    check_tip_mass,
)
from .consistency import check_consistency
from .cross_terms import cross_term_warnings
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
from .file_kinds import FileKind, kind_of
from .frfs import (
    check_band_recordings,
    check_frf,
    check_frf_for_fit,
    check_inputs,
    check_local_frf,
    check_window_damping,
    driven_lines,
)
from .hammer import check_tap_recordings, check_taps_found, check_taps_used, double_hit_warnings, tap_test_warnings
from .lobes_band import check_band_of_lobes, highest_needed
from .model_witness import check_fit_of_recordings, check_prediction
from .models import check_model, fit_warnings, smearing_warnings, stored_warnings, terms_left_out
from .passivity import check_model_reciprocity, check_reciprocity, clearly_different, shown_pairs
from .plans import check_demand, check_duration
from .recordings import (
    RECORD_AGAIN,
    CheckedRecording,
    Segmentation,
    check_channels,
    check_recording,
    check_recordings,
    join_checks,
    rate_warnings,
    warnings_of,
)
from .signals import check_signals, level_table

__all__ = [
    "RECORD_AGAIN",
    "CheckedRecording",
    "FileKind",
    "Gain",
    "ReportFile",
    "Segmentation",
    "check_band_of_lobes",
    "check_band_recordings",
    "check_belonging",
    "check_channels",
    "check_consistency",
    "check_cutting",
    "check_demand",
    "check_depth",
    "check_duration",
    "check_fit_of_recordings",
    "check_frf",
    "check_frf_for_fit",
    "check_inputs",
    "check_local_frf",
    "check_model",
    "check_model_and_recordings",
    "check_model_reciprocity",
    "check_one_speed",
    "check_prediction",
    "check_reciprocity",
    "check_recording",
    "check_recordings",
    "check_sample_rates",
    "check_scales",
    "check_signals",
    "check_speed",
    "check_speeds",
    "check_tap_recordings",
    "check_taps_found",
    "check_taps_used",
    "check_tip_and_sensor",
    "check_tip_mass",
    "check_window_damping",
    "clearly_different",
    "clock_warnings",
    "cross_term_warnings",
    "double_hit_warnings",
    "driven_lines",
    "fit_warnings",
    "gain_of",
    "highest_needed",
    "join_checks",
    "kind_of",
    "level_table",
    "lowest_frequency",
    "missing_sample_warnings",
    "rate_warnings",
    "read_checked_cutting",
    "rigid_directions",
    "shown_pairs",
    "smearing_warnings",
    "stored_warnings",
    "tap_test_warnings",
    "terms_left_out",
    "warnings_of",
]
