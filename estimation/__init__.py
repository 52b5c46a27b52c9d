"""Spectra, coherence and frequency response functions from recordings: knows nothing of modes."""

from .band_records import BandDecimator, BandRecord, band_record, widest_band
from .estimators.error_in_variables import h2, hv, instrumental_variable
from .estimators.least_squares import h1, h1_side_by_side
from .estimators.local_polynomials import local_half_width, local_polynomial
from .frf_matrix.band_of_frf import known_band
from .frf_matrix.frf import Frf, FrfCovariance
from .frf_matrix.frf_file import read_frf, write_frf
from .frf_matrix.quantities import correct_high_pass, to_receptance
from .frf_matrix.uff_file import is_uff_number, uff_node_numbers, write_frf_uff
from .geometry import Geometry, import_geometry, is_geometry_table, read_geometry, write_geometry
from .hammer import (
    Decay,
    Disagreement,
    FoundTaps,
    JudgedTap,
    MergedTaps,
    Tap,
    TapSettings,
    TapSums,
    TapTest,
    answer_decay,
    choose_segments,
    exponential_window,
    find_taps,
    force_window,
    found_taps,
    merge_taps,
    placed,
    screened,
    tap_sums,
    window_correlation,
    window_for,
    without_added_damping,
)
from .importing import (
    FrfMapping,
    ImportedFrf,
    import_frf,
    is_frf_mapping,
    load_frf_mapping,
    looks_like_frf,
    read_frf_uff,
)
from .integration import displacement_from_acceleration
from .reciprocity import ReciprocityPair, SharedPoint, reciprocity_pairs, shared_points
from .spectra.coherence import (
    input_coherence,
    multiple_coherence,
    partial_coherence,
    principal_inputs,
    virtual_coherence,
)
from .spectra.independence import RANK_TOLERANCE, InputIndependence, bands_text, input_independence
from .spectra.order_tracking import excitation_map, spectrogram, track_order
from .spectra.recording_spectra import choose_channels, cross_spectra
from .spectra.spectral_accumulator import SpectralAccumulator
from .spectra.spectral_matrix import CrossSpectra, SpectralSettings
from .spectra.stacking import sum_tests
from .spectra.trusted_samples import usable_samples
from .spectra.windows import effective_averages, settings_for
from .sweep_plan import SweepDemand, SweepPlan, plan_sweeps, predicted_spectra

__all__ = [
    "RANK_TOLERANCE",
    "BandDecimator",
    "BandRecord",
    "CrossSpectra",
    "Decay",
    "Disagreement",
    "FoundTaps",
    "Frf",
    "FrfCovariance",
    "FrfMapping",
    "Geometry",
    "ImportedFrf",
    "InputIndependence",
    "JudgedTap",
    "MergedTaps",
    "ReciprocityPair",
    "SharedPoint",
    "SpectralAccumulator",
    "SpectralSettings",
    "SweepDemand",
    "SweepPlan",
    "Tap",
    "TapSettings",
    "TapSums",
    "TapTest",
    "answer_decay",
    "band_record",
    "bands_text",
    "choose_channels",
    "choose_segments",
    "correct_high_pass",
    "cross_spectra",
    "displacement_from_acceleration",
    "effective_averages",
    "excitation_map",
    "exponential_window",
    "find_taps",
    "force_window",
    "found_taps",
    "h1",
    "h1_side_by_side",
    "h2",
    "hv",
    "import_frf",
    "import_geometry",
    "input_coherence",
    "input_independence",
    "instrumental_variable",
    "is_frf_mapping",
    "is_geometry_table",
    "is_uff_number",
    "known_band",
    "load_frf_mapping",
    "local_half_width",
    "local_polynomial",
    "looks_like_frf",
    "merge_taps",
    "multiple_coherence",
    "partial_coherence",
    "placed",
    "plan_sweeps",
    "predicted_spectra",
    "principal_inputs",
    "read_frf",
    "read_frf_uff",
    "read_geometry",
    "reciprocity_pairs",
    "screened",
    "settings_for",
    "shared_points",
    "spectrogram",
    "sum_tests",
    "tap_sums",
    "to_receptance",
    "track_order",
    "uff_node_numbers",
    "usable_samples",
    "virtual_coherence",
    "widest_band",
    "window_correlation",
    "window_for",
    "without_added_damping",
    "write_frf",
    "write_frf_uff",
    "write_geometry",
]
