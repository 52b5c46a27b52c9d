"""What is known about the cut of a session before it is recorded."""

import math
from collections.abc import Callable, Sequence

from acquisition import Channel, Session, Source, StreamDescription, announced_events
from millfrf.core import InputError
from millfrf.live.chatter_watch import CHATTER_EVENTS, Announcement, ChatterWatch
from millfrf.stability import WatchedCut

from ..chatter import DERIVATIVES, CutOptions, cut_channels, require_rate, tool_channels
from ..settings import RPM, SPEED_EVENTS
from .simulated_device import number_in


def chatter_watch(
    session: Session,
    source: Source,
    options: CutOptions,
    announce: Callable[[Announcement], None],
    *,
    waits: bool = False,
) -> ChatterWatch:
    """Make the watch of a session's source; the speed may come from a device while it is recorded.

    Raises
    ------
    InputError
        No spindle speed, no such stream or channel, or a sample rate too low for the tooth passing.
    """
    stream = _stream(source.streams, options.stream)
    channels = cut_channels(stream, options.responses)
    rpm = options.speed_rpm or number_in(session.cut, SPEED_EVENTS) or math.nan
    announced = announced_events(source)
    if math.isnan(rpm) and SPEED_EVENTS not in announced:
        raise InputError(f"the spindle speed is not known; give --speed RPM, or {SPEED_EVENTS} in [cut] of the session")
    require_rate(stream.name, stream.sample_rate, options.teeth, rpm)
    columns = tuple(stream.channels.index(channel) for channel in channels)
    cut = _watched(stream.sample_rate, rpm, channels, options)
    series = CHATTER_EVENTS if CHATTER_EVENTS not in announced else f"{CHATTER_EVENTS}_while_replaying"
    return ChatterWatch(stream.name, stream.start_time, columns, cut, announce, series=series, waits=waits)


def _watched(sample_rate: float, rpm: float, channels: Sequence[Channel], options: CutOptions) -> WatchedCut:
    tool = tool_channels(channels)
    return WatchedCut(
        sample_rate,
        len(channels),
        rpm * RPM,
        options.teeth,
        tuple(channel.quantity for channel in channels),
        tuple(DERIVATIVES.get(channel.quantity, 0) for channel in channels),
        () if options.model is None else tuple(options.model.natural_frequencies.tolist()),
        options.runout,
        options.chip if tool else math.nan,
        tool,
        options.process is not None and options.process.has_constant_force,
    )


def _stream(streams: Sequence[StreamDescription], name: str | None) -> StreamDescription:
    names = [stream.name for stream in streams]
    if name is None and len(streams) == 1:
        return streams[0]
    if name not in names:
        wrong = "several sample clocks" if name is None else f"no stream {name}"
        raise InputError(f"the session has {wrong}; give --stream with one of {', '.join(names)}")
    return streams[names.index(name)]


def with_teeth_of(session: Session, teeth: int | None) -> int | None:
    """Return the number of teeth: the given one, or that of `[cutting]` or `[tool]` of the session."""
    stated = number_in(session.cutting, "teeth") or number_in(session.tool, "teeth")
    return teeth if teeth is not None or not stated else int(stated)


def watched_by_page(session: Session, source: Source) -> ChatterWatch | None:
    """Return the watch of a live page; None where the session does not state teeth and speed."""
    teeth = with_teeth_of(session, None)
    if teeth is None:
        return None
    try:
        return chatter_watch(session, source, CutOptions(teeth), lambda announcement: None)
    except InputError:
        return None
