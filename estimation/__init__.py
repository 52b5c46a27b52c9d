"""Spectra, coherence and frequency response functions from recordings: knows nothing of modes."""

from .band_records import BandDecimator, BandRecord, band_record
from .coherence import input_coherence, multiple_coherence, partial_coherence, principal_inputs, virtual_coherence
from .cross_spectra import CrossSpectra, SpectralSettings
from .error_in_variables import h2, hv, instrumental_variable
from .frf import Frf, FrfCovariance
from .frf_file import read_frf, write_frf
from .h1 import h1, h1_side_by_side
from .hammer import Tap, exponential_window, find_taps, force_window, without_added_damping
from .independence import RANK_TOLERANCE, InputIndependence, bands_text, input_independence
from .integration import displacement_from_acceleration
from .known_band import known_band
from .local_polynomial import local_polynomial
from .order_tracking import excitation_map, spectrogram, track_order
from .quantities import correct_high_pass, to_receptance
from .recording_spectra import choose_channels, cross_spectra
from .spectral_accumulator import SpectralAccumulator
from .stacking import sum_tests
from .sweep_plan import SweepDemand, SweepPlan, plan_sweeps, predicted_spectra
from .uff_file import read_frf_uff, write_frf_uff
from .usable_samples import usable_samples
from .windows import effective_averages, settings_for

__all__ = [
    "RANK_TOLERANCE",
    "BandDecimator",
    "BandRecord",
    "CrossSpectra",
    "Frf",
    "FrfCovariance",
    "InputIndependence",
    "SpectralAccumulator",
    "SpectralSettings",
    "SweepDemand",
    "SweepPlan",
    "Tap",
    "band_record",
    "bands_text",
    "choose_channels",
    "correct_high_pass",
    "cross_spectra",
    "displacement_from_acceleration",
    "effective_averages",
    "excitation_map",
    "exponential_window",
    "find_taps",
    "force_window",
    "h1",
    "h1_side_by_side",
    "h2",
    "hv",
    "input_coherence",
    "input_independence",
    "instrumental_variable",
    "known_band",
    "local_polynomial",
    "multiple_coherence",
    "partial_coherence",
    "plan_sweeps",
    "predicted_spectra",
    "principal_inputs",
    "read_frf",
    "read_frf_uff",
    "settings_for",
    "spectrogram",
    "sum_tests",
    "to_receptance",
    "track_order",
    "usable_samples",
    "virtual_coherence",
    "without_added_damping",
    "write_frf",
    "write_frf_uff",
]
