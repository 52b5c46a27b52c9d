from .band_recordings.band_recording import (
    BandRecording,
    band_of_channels,
    band_recording,
    before_force_high_pass,
    read_band_recording,
    require_room_at_rate,
    require_room_for_band,
    rounding_step,
)
from .band_recordings.channel_matching import (
    DERIVATIVE_ORDERS,
    MatchedChannel,
    before_high_pass,
    channel_at,
    channels_in_words,
    channels_of,
    derivative_orders,
    high_pass_corners,
    kinematic_factor,
    names_at,
    refuse_shared,
)
from .band_recordings.resampling import Resampler, needed_ratio, require_room, resampled, whole_ratio, widest_band
from .band_recordings.spectrum_lines import WholeSpectrum, WindowedSpectrum, padded_force, windowed_spectrum
from .band_recordings.swept_line import swept_line
from .estimators import (
    h1,
    h1_side_by_side,
    h2,
    hv,
    instrumental_variable,
    local_half_width,
    local_polynomial,
)
from .frf.frf_files import is_uff_number, read_frf, uff_node_numbers, write_frf, write_frf_uff
from .frf.frf_matrix import Frf, FrfCovariance
from .frf.measured_blocks import checked_measured, entries_in_words, measured_blocks
from .frf.quantities import FRF_ORDERS, correct_high_pass, family_of, known_band, quantities_of_unit, to_receptance
from .frf.reciprocity import ReciprocityPair, reciprocity_pairs, shared_points
from .frf.selection import chosen_indices
from .geometry_files import GeometryTable, import_geometry, is_geometry_table, read_geometry, write_geometry
from .geometry_model import Geometry
from .hammer.decay import Decay, response_decay, window_for, without_hum
from .hammer.merging import MergedTaps, merge_taps
from .hammer.segments import (
    TapSettings,
    begins_with_recording,
    choose_segments,
    exponential_window,
    force_window,
    screened,
    window_correlation,
)
from .hammer.tap_spectra import tap_sums
from .hammer.taps import FoundTaps, TapTest, find_taps, found_taps, require_room_for_taps
from .importing.entries import ImportedFrf
from .importing.frf_mapping import FrfMapping, is_frf_mapping, load_frf_mapping
from .importing.import_frf import import_frf, looks_like_frf
from .importing.sources import ArraySource, TextSource, open_source
from .importing.uff_frfs import read_frf_uff
from .importing.units import unit_is_of_frf
from .repeats.cut_periods import SteadyPeriods, steady_periods
from .repeats.distortion import Distortion, Homogeneity, distortion, homogeneity
from .repeats.linear_approximation import LinearApproximation, excited_lines, linear_approximation
from .repeats.noise import MeasuredNoise
from .repeats.noise_between_periods import measured_noise, noise_of_periods
from .repeats.period_search import find_repeats, repeat_of
from .settings import RECORDINGS
from .spectra.coherence_functions import (
    InputIndependence,
    bands_text,
    input_coherence,
    input_independence,
)
from .spectra.cross_spectra import (
    CrossSpectra,
    SpectralSettings,
    count_segments,
    join_parts,
    only_inputs,
    settings_for,
    spectra_in_band,
    sum_tests,
)
from .spectra.recording_spectra import (
    EXCITING,
    RESPONDING,
    AveragingSettings,
    check_equal_rates,
    choose_channels,
    cross_spectra,
    spectra_for_judging,
    spectra_of_test,
    spectra_of_tests,
)
from .spectra.welch import SpectralAccumulator
from .sweep_plan import SweepDemand, SweepPlan, plan_sweeps

__all__ = [
    "DERIVATIVE_ORDERS",
    "EXCITING",
    "FRF_ORDERS",
    "RECORDINGS",
    "RESPONDING",
    "ArraySource",
    "AveragingSettings",
    "BandRecording",
    "CrossSpectra",
    "Decay",
    "Distortion",
    "FoundTaps",
    "Frf",
    "FrfCovariance",
    "FrfMapping",
    "Geometry",
    "GeometryTable",
    "Homogeneity",
    "ImportedFrf",
    "InputIndependence",
    "LinearApproximation",
    "MatchedChannel",
    "MeasuredNoise",
    "MergedTaps",
    "ReciprocityPair",
    "Resampler",
    "SpectralAccumulator",
    "SpectralSettings",
    "SteadyPeriods",
    "SweepDemand",
    "SweepPlan",
    "TapSettings",
    "TapTest",
    "TextSource",
    "WholeSpectrum",
    "WindowedSpectrum",
    "band_of_channels",
    "band_recording",
    "bands_text",
    "before_force_high_pass",
    "before_high_pass",
    "begins_with_recording",
    "channel_at",
    "channels_in_words",
    "channels_of",
    "check_equal_rates",
    "checked_measured",
    "choose_channels",
    "choose_segments",
    "chosen_indices",
    "correct_high_pass",
    "count_segments",
    "cross_spectra",
    "derivative_orders",
    "distortion",
    "entries_in_words",
    "excited_lines",
    "exponential_window",
    "family_of",
    "find_repeats",
    "find_taps",
    "force_window",
    "found_taps",
    "h1",
    "h1_side_by_side",
    "h2",
    "high_pass_corners",
    "homogeneity",
    "hv",
    "import_frf",
    "import_geometry",
    "input_coherence",
    "input_independence",
    "instrumental_variable",
    "is_frf_mapping",
    "is_geometry_table",
    "is_uff_number",
    "join_parts",
    "kinematic_factor",
    "known_band",
    "linear_approximation",
    "load_frf_mapping",
    "local_half_width",
    "local_polynomial",
    "looks_like_frf",
    "measured_blocks",
    "measured_noise",
    "merge_taps",
    "names_at",
    "needed_ratio",
    "noise_of_periods",
    "only_inputs",
    "open_source",
    "padded_force",
    "plan_sweeps",
    "quantities_of_unit",
    "read_band_recording",
    "read_frf",
    "read_frf_uff",
    "read_geometry",
    "reciprocity_pairs",
    "refuse_shared",
    "repeat_of",
    "require_room",
    "require_room_at_rate",
    "require_room_for_band",
    "require_room_for_taps",
    "resampled",
    "response_decay",
    "rounding_step",
    "screened",
    "settings_for",
    "shared_points",
    "spectra_for_judging",
    "spectra_in_band",
    "spectra_of_test",
    "spectra_of_tests",
    "steady_periods",
    "sum_tests",
    "swept_line",
    "tap_sums",
    "to_receptance",
    "uff_node_numbers",
    "unit_is_of_frf",
    "whole_ratio",
    "widest_band",
    "window_correlation",
    "window_for",
    "windowed_spectrum",
    "without_hum",
    "write_frf",
    "write_frf_uff",
    "write_geometry",
]
