from .aligner import Aligner, aligned_blocks, aligned_samples, rows_left_out
from .checked_samples import DamagedRows, DamagedSamplesError
from .event_series import EventSeries
from .record_source import record
from .recording import Recording
from .recording_format import FORMAT, FORMAT_VERSION, check_format, stream_from_attributes
from .recording_writer import RecordingWriter
from .recovery import Recovered, recover
from .stream import Stream

__all__ = [
    "FORMAT",
    "FORMAT_VERSION",
    "Aligner",
    "DamagedRows",
    "DamagedSamplesError",
    "EventSeries",
    "Recording",
    "RecordingWriter",
    "Recovered",
    "Stream",
    "aligned_blocks",
    "aligned_samples",
    "check_format",
    "record",
    "recover",
    "rows_left_out",
    "stream_from_attributes",
]
