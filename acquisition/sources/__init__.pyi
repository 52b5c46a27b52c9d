from .events import HOST_AXIS, SAMPLES_AXIS, TEXT_BYTES, EventAxis, Events, announced_events, stored_texts
from .feeds import EventFeed, WithFeeds
from .pacing import Pace, Paced
from .receiver import Put
from .source import Block, Source, StreamDescription
from .threaded_feed import ThreadedFeed

__all__ = [
    "HOST_AXIS",
    "SAMPLES_AXIS",
    "TEXT_BYTES",
    "Block",
    "EventAxis",
    "EventFeed",
    "Events",
    "Pace",
    "Paced",
    "Put",
    "Source",
    "StreamDescription",
    "ThreadedFeed",
    "WithFeeds",
    "announced_events",
    "stored_texts",
]
