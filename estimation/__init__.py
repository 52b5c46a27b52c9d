"""Spectra, coherence and frequency response functions from recordings: knows nothing of modes."""

from .band_records import BandDecimator, BandRecord, band_record
from .coherence import input_coherence, multiple_coherence
from .cross_spectra import CrossSpectra, SpectralSettings
from .frf import Frf, FrfCovariance
from .frf_file import read_frf, write_frf
from .h1 import h1, h1_side_by_side
from .independence import InputIndependence, input_independence
from .quantities import correct_high_pass, to_receptance
from .recording_spectra import choose_channels, cross_spectra
from .spectral_accumulator import SpectralAccumulator
from .stacking import sum_tests
from .sweep_plan import SweepDemand, SweepPlan, plan_sweeps, predicted_spectra
from .uff_file import read_frf_uff, write_frf_uff
from .windows import effective_averages, settings_for

__all__ = [
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
    "band_record",
    "choose_channels",
    "correct_high_pass",
    "cross_spectra",
    "effective_averages",
    "h1",
    "h1_side_by_side",
    "input_coherence",
    "input_independence",
    "multiple_coherence",
    "plan_sweeps",
    "predicted_spectra",
    "read_frf",
    "read_frf_uff",
    "settings_for",
    "sum_tests",
    "to_receptance",
    "write_frf",
    "write_frf_uff",
]
