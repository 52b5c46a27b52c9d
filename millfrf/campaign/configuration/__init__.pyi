from .campaign_tables import JOBS, CampaignFile, EstimateTable
from .copied_recordings import without_copies
from .file_look import FileLook, hash_all, keep, look_at_other, place_below, read_kept
from .found_recordings import FoundRecording, find_recordings
from .labels import Labels, filled_in, labels_in, shown_value
from .stated_postures import agree, without_wrong_postures

__all__ = [
    "JOBS",
    "CampaignFile",
    "EstimateTable",
    "FileLook",
    "FoundRecording",
    "Labels",
    "agree",
    "filled_in",
    "find_recordings",
    "hash_all",
    "keep",
    "labels_in",
    "look_at_other",
    "place_below",
    "read_kept",
    "shown_value",
    "without_copies",
    "without_wrong_postures",
]
