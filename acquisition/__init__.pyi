from .channels import Channel
from .conversion.can_log import SUFFIXES, LogMapping, add_can_log
from .conversion.convert import convert
from .conversion.guesses import Question
from .conversion.mapping import RecordingMapping
from .conversion.proposal import proposed_mapping, unit_free
from .conversion.read_arrays import SHEET_SUFFIXES, open_arrays
from .conversion.text_lines import TextOptions
from .conversion.text_table import TEXT_SUFFIXES, TextTable
from .conversion.uff_sets import UFF_AXES, UffLines, read_uff_lines, read_uff_sets, uff_function_types
from .drivers.rsi import RSI_COUNTS
from .recordings.alignment import ClockFindings, aligned_blocks, aligned_samples, check_clock, rows_left_out
from .recordings.opening import RecordingFile, all_opened, opened, path_of
from .recordings.recorded_source import record
from .recordings.recording import Recording
from .recordings.recording_writer import RecordingWriter
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
    "SHEET_SUFFIXES",
    "SUFFIXES",
    "TEXT_SUFFIXES",
    "UFF_AXES",
    "Block",
    "Channel",
    "ClockFindings",
    "DeviceError",
    "DeviceSummary",
    "DriverMissing",
    "EventAxis",
    "Events",
    "Finishes",
    "LogMapping",
    "Paced",
    "Question",
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
    "TextOptions",
    "TextTable",
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
    "proposed_mapping",
    "read_uff_lines",
    "read_uff_sets",
    "record",
    "recover",
    "rows_left_out",
    "session_from_text",
    "session_text",
    "uff_function_types",
    "unit_free",
]
