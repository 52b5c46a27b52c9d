"""Channels, recordings and the sources they come from: knows nothing of spectra or models."""

from .channel import Channel
from .conversion import convert
from .drivers import ReplaySource
from .pacing import Paced
from .record import record
from .recording import EventSeries, Recording, Stream
from .recording_writer import RecordingWriter
from .source import Block, Source, StreamDescription

__all__ = [
    "Block",
    "Channel",
    "EventSeries",
    "Paced",
    "Recording",
    "RecordingWriter",
    "ReplaySource",
    "Source",
    "Stream",
    "StreamDescription",
    "convert",
    "record",
]
