"""Channels, recordings and the sources they come from: knows nothing of spectra or models."""

from .channel import Channel
from .conversion import ArrayFile, CsvOptions, UffLines, convert, open_arrays, read_uff_lines, read_uff_sets
from .drivers import ReplaySource
from .errors import DeviceError, DeviceTimeout, Disconnected, DiskFull, DriverMissing, Overrun
from .recordings.aligner import Aligner, aligned_blocks, aligned_samples
from .recordings.event_series import EventSeries
from .recordings.record_source import record
from .recordings.recording import Recording, Stream
from .recordings.recording_writer import RecordingWriter
from .recordings.recovery import Recovered, recover
from .sources.events import HOST_AXIS, SAMPLES_AXIS, EventAxis, Events
from .sources.feeds import EventFeed, WithFeeds
from .sources.pacing import Paced
from .sources.source import Block, Source, StreamDescription

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
