from .channels import Channel
from .conversion.array_file import ArrayFile, open_arrays
from .conversion.can_log import SUFFIXES, LogMapping, add_can_log
from .conversion.convert import convert
from .conversion.mapping import CsvOptions, RecordingMapping
from .conversion.uff_sets import UffLines, read_uff_lines, read_uff_sets
from .drivers.rsi import RSI_COUNTS
from .recordings.alignment import ClockFindings, aligned_blocks, aligned_samples, check_clock, rows_left_out
from .recordings.recording import Recording, RecordingFile, all_opened, opened, path_of
from .recordings.recording_writer import RecordingWriter, record
from .recordings.recovery import Recovered, recover
from .recordings.stream import Stream
from .session import Session, SimulatedDevice, build_source, session_from_text, session_text
from .sources.feeds import DEVICES, FAULT, LOST, DeviceSummary, WithFeeds, device_summary
from .sources.source import (
    HOST_AXIS,
    Block,
    DeviceError,
    DriverMissing,
    EventAxis,
    Events,
    Finishes,
    Source,
    SourceWrapper,
    StreamDescription,
    announced_events,
)
from .sources.timing import Paced

__all__ = [
    "DEVICES",
    "FAULT",
    "HOST_AXIS",
    "LOST",
    "RSI_COUNTS",
    "SUFFIXES",
    "ArrayFile",
    "Block",
    "Channel",
    "ClockFindings",
    "CsvOptions",
    "DeviceError",
    "DeviceSummary",
    "DriverMissing",
    "EventAxis",
    "Events",
    "Finishes",
    "LogMapping",
    "Paced",
    "Recording",
    "RecordingFile",
    "RecordingMapping",
    "RecordingWriter",
    "Recovered",
    "Session",
    "SimulatedDevice",
    "Source",
    "SourceWrapper",
    "Stream",
    "StreamDescription",
    "UffLines",
    "WithFeeds",
    "add_can_log",
    "aligned_blocks",
    "aligned_samples",
    "all_opened",
    "announced_events",
    "build_source",
    "check_clock",
    "convert",
    "device_summary",
    "open_arrays",
    "opened",
    "path_of",
    "read_uff_lines",
    "read_uff_sets",
    "record",
    "recover",
    "rows_left_out",
    "session_from_text",
    "session_text",
]
