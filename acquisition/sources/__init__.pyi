from .around_source import AroundSource
from .device_log import BACK, CLEARED, DEVICES, DEVICES_AXIS, FAULT, LOST, NOTE, DeviceStory, device_event, device_story
from .event_feed import EventFeed
from .events import HOST_AXIS, SAMPLES_AXIS, TEXT_BYTES, EventAxis, Events, announced_events, stored_texts
from .feeds import WithFeeds
from .pacing import Pace, Paced
from .receiver import Put
from .source import Block, Finishes, Source, StreamDescription
from .steady_stamps import Stamped, SteadyStamps
from .threaded_feed import ThreadedFeed
from .wall_clock import WallClock

__all__ = [
    "BACK",
    "CLEARED",
    "DEVICES",
    "DEVICES_AXIS",
    "FAULT",
    "HOST_AXIS",
    "LOST",
    "NOTE",
    "SAMPLES_AXIS",
    "TEXT_BYTES",
    "AroundSource",
    "Block",
    "DeviceStory",
    "EventAxis",
    "EventFeed",
    "Events",
    "Finishes",
    "Pace",
    "Paced",
    "Put",
    "Source",
    "Stamped",
    "SteadyStamps",
    "StreamDescription",
    "ThreadedFeed",
    "WallClock",
    "WithFeeds",
    "announced_events",
    "device_event",
    "device_story",
    "stored_texts",
]
