from .channels import Channel
from .clocks import ClockFindings, check_clock
from .conversion.array_file import ArrayFile, open_arrays
from .conversion.can_log import SUFFIXES, LogMapping, add_can_log
from .conversion.convert import convert
from .conversion.mapping import CsvOptions, RecordingMapping
from .conversion.uff_sets import UffLines, read_uff_lines, read_uff_sets
from .drivers.ni_channels import NiCounter, NiInput
from .drivers.ni_source import NiClocks, NiSource
from .drivers.rsi import RSI_COUNTS
from .errors import DeviceError, DriverMissing
from .recordings.alignment import aligned_blocks, aligned_samples, rows_left_out
from .recordings.recording import Recording, RecordingFile, all_opened, opened, path_of
from .recordings.recording_loop import record
from .recordings.recording_writer import RecordingWriter
from .recordings.recovery import Recovered, recover
from .recordings.stream import Stream
from .session.session_file import Session, SimulatedDevice, build_source, session_from_text, session_text
from .sources.feeds import DEVICES, FAULT, LOST, DeviceStory, WithFeeds, device_story
from .sources.source import (
    HOST_AXIS,
    AroundSource,
    Block,
    EventAxis,
    Events,
    Finishes,
    Source,
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
    "AroundSource",
    "ArrayFile",
    "Block",
    "Channel",
    "ClockFindings",
    "CsvOptions",
    "DeviceError",
    "DeviceStory",
    "DriverMissing",
    "EventAxis",
    "Events",
    "Finishes",
    "LogMapping",
    "NiClocks",
    "NiCounter",
    "NiInput",
    "NiSource",
    "Paced",
    "Recording",
    "RecordingFile",
    "RecordingMapping",
    "RecordingWriter",
    "Recovered",
    "Session",
    "SimulatedDevice",
    "Source",
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
    "device_story",
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
