"""The step from a session file to the source that it describes."""

from pathlib import Path

from foundation import InputError

from ..drivers import NiSource, ReplaySource
from ..sources import Source, WithFeeds
from .feed_tables import AmplifierTable
from .tables import NiDevice, ReplayDevice, Session


def build_source(session: Session, setup: str, folder: Path, sampled: Source | None = None) -> Source:
    """Build the source of a session; its sampled device is set up already, so that the achieved rate is known.

    Parameters
    ----------
    session
        Session that was read and checked.
    setup
        Set-up of the recording, TOML text.
    folder
        Folder in which files that the session names are looked for.
    sampled
        The sampled source where the device is not one of this package (the simulated cell).

    Raises
    ------
    DriverMissing, Disconnected, DeviceError, InputError
    """
    if sampled is None:
        sampled = _sampled(session, setup, folder)
    feeds = [
        table.feed(folder, session.ranges_of(table)) if isinstance(table, AmplifierTable) else table.feed(folder)
        for table in session.feeds
    ]
    return WithFeeds(sampled, feeds) if feeds else sampled


def _sampled(session: Session, setup: str, folder: Path) -> Source:
    device = session.device
    if isinstance(device, NiDevice):
        return NiSource(
            [channel.wired() for channel in session.channels],
            device.sample_rate_hz,
            counters=[counter.wired() for counter in session.counters],
            clocks=device.clocks(),
            block_duration=device.block_s,
            buffer_duration=device.buffer_s,
            timeout=device.timeout_s,
            duration=session.duration_s,
            title=session.title,
            setup=setup,
        )
    if isinstance(device, ReplayDevice):
        return ReplaySource(folder / device.file, speed=device.speed)
    raise InputError(f"driver {device.driver!r} is built elsewhere; give the source")
