from .coherence import input_coherence, multiple_coherence, partial_coherence, principal_inputs, virtual_coherence
from .independence import RANK_TOLERANCE, InputIndependence, bands_text, independent_lines, input_independence
from .judging_spectra import spectra_for_judging
from .order_tracking import excitation_map, spectrogram, track_order
from .recording_spectra import EXCITING, RESPONDING, choose_channels, count_segments, cross_spectra
from .spectral_accumulator import SpectralAccumulator
from .spectral_matrix import CrossSpectra, SpectralSettings, lines_of
from .stacking import check_stackable, join_parts, sum_tests
from .trusted_samples import OVERLOAD, usable_samples
from .windows import effective_averages, settings_for, spectral_width

__all__ = [
    "EXCITING",
    "OVERLOAD",
    "RANK_TOLERANCE",
    "RESPONDING",
    "CrossSpectra",
    "InputIndependence",
    "SpectralAccumulator",
    "SpectralSettings",
    "bands_text",
    "check_stackable",
    "choose_channels",
    "count_segments",
    "cross_spectra",
    "effective_averages",
    "excitation_map",
    "independent_lines",
    "input_coherence",
    "input_independence",
    "join_parts",
    "lines_of",
    "multiple_coherence",
    "partial_coherence",
    "principal_inputs",
    "settings_for",
    "spectra_for_judging",
    "spectral_width",
    "spectrogram",
    "sum_tests",
    "track_order",
    "usable_samples",
    "virtual_coherence",
]
