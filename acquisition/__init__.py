"""Channels, recordings and the sources they come from: knows nothing of spectra or models."""

from .aligner import Aligner, aligned_blocks, aligned_samples
from .channel import Channel
from .conversion import ArrayFile, CsvOptions, UffLines, convert, open_arrays, read_uff_lines, read_uff_sets
from .drivers import ReplaySource
from .errors import DeviceError, DeviceTimeout, Disconnected, DiskFull, DriverMissing, Overrun
from .event_series import EventSeries
from .events import HOST_AXIS, SAMPLES_AXIS, EventAxis, Events
from .feeds import EventFeed, WithFeeds
from .pacing import Paced
from .record import record
from .recording import Recording, Stream
from .recording_writer import RecordingWriter
from .recovery import Recovered, recover
from .source import Block, Source, StreamDescription

__all__ = [
    "HOST_AXIS",
    "SAMPLES_AXIS",
    "Aligner",
    "ArrayFile",
    "Block",
    "Channel",
    "CsvOptions",
    "DeviceError",
    "DeviceTimeout",
    "Disconnected",
    "DiskFull",
    "DriverMissing",
    "EventAxis",
    "EventFeed",
    "EventSeries",
    "Events",
    "Overrun",
    "Paced",
    "Recording",
    "RecordingWriter",
    "Recovered",
    "ReplaySource",
    "Source",
    "Stream",
    "StreamDescription",
    "UffLines",
    "WithFeeds",
    "aligned_blocks",
    "aligned_samples",
    "convert",
    "open_arrays",
    "read_uff_lines",
    "read_uff_sets",
    "record",
    "recover",
]
