from .common_band import ComparedBand, compared_band
from .reading import band_of, measured_part, read_at, read_recording, read_recordings
from .true_forces import without_force_noise

__all__ = [
    "ComparedBand",
    "band_of",
    "compared_band",
    "measured_part",
    "read_at",
    "read_recording",
    "read_recordings",
    "without_force_noise",
]
