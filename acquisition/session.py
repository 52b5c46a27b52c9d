"""Session files: TOML tables of channels and devices, checked, and the source that they describe."""

import os
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, ValidationError, model_validator

from millfrf.core import FileFormatError, InputError, mistake_in_words

from .channels import STRICT, Name, Positive
from .drivers.can_bus import CanFeed, CanTable
from .drivers.modbus import ModbusFeed, ModbusTable
from .drivers.ni_channels import ChannelTable, CounterTable
from .drivers.ni_source import NiDevice, NiSource
from .drivers.replay import ReplaySource
from .drivers.rsi import RsiFeed, RsiTable
from .drivers.serial_lines import Amplifier, AmplifierTable, TachometerFeed, TachometerTable
from .settings import SETTINGS
from .sources.feeds import WithFeeds
from .sources.source import EventFeed, Source


class ReplayDevice(BaseModel):
    """`[device]` with ``driver = "replay"``: a recording instead of a device, ``speed`` times as fast as it was.

    Parameters
    ----------
    driver
        ``replay``: a recording instead of a device.
    file
        Recording, relative to the folder of the session file.
    speed
        Factor over real time.
    """

    model_config = STRICT
    driver: Literal["replay"]
    file: Name
    speed: Positive = 1.0


class SimulatedDevice(BaseModel):
    """`[device]` with ``driver = "simulated"``: the simulated milling cell, ``speed`` times as fast as a real one.

    Parameters
    ----------
    sample_rate_hz : Hz
        Samples per second of every channel.
    sweep_rpm : rpm
        First and last spindle speed of a sweep, which runs back and forth; left out: those of the plan, else those of
        the demonstration.
    sweep_s : s
        Duration of a sweep; left out: as planned; without ``[plan]`` it is ``duration_s``, else 60 s.
    spindle_speed_rpm : rpm
        A constant speed instead of a sweep.
    noise
        Noise of every sensor as a share of its signal.
    seed
        Seed of the noise.
    speed
        Factor over real time.
    driver
        ``simulated``: the simulated cell.
    """

    model_config = STRICT
    driver: Literal["simulated"]
    sample_rate_hz: Positive = 2048.0
    sweep_rpm: tuple[Positive, Positive] | None = None
    sweep_s: Positive | None = None
    spindle_speed_rpm: Positive | None = None
    noise: Annotated[float, Field(ge=0, le=10)] = 0.01
    seed: Annotated[int, Field(ge=0)] = 0
    speed: Positive = 1.0


class LiveTable(BaseModel):
    """`[live]`: what the live page estimates.

    Parameters
    ----------
    segment_s : s
        Length of a segment of the spectra; left out: two periods of the resolution of `[plan]`, else 1 s.
    tests
        Pattern of the names of recordings in the same folder that are averaged with the new one; "" for none.
    frf_error
        Required standard deviation of the FRF over its magnitude; lines below it count as having enough data.
    bands
        Number of frequency bands for which this is shown.
    """

    model_config = STRICT
    segment_s: Annotated[float, Field(gt=0, le=60)] | None = None
    tests: Annotated[str, Field(pattern=r"^[^/\\]*$")] = "*.h5"
    frf_error: Positive = 0.1
    bands: Annotated[int, Field(ge=1, le=40)] = 8


Device = Annotated[NiDevice | ReplayDevice | SimulatedDevice, Field(discriminator="driver")]


class Session(BaseModel):
    """A session file: what is recorded, from which devices, and for how long.

    Parameters
    ----------
    title
        Title of the recording.
    duration_s : s
        Duration of the recording; left out: until stopped.
    band_hz : Hz
        Lowest and highest frequency of interest; the sample rate is checked against them.
    tool, cut, pose
        Free tables; they go into the recording as its set-up.
    cutting
        Table ``[cutting]`` of a cutting file; it goes into the recording as part of its set-up.
    plan
        Table ``[plan]`` as `millfrf plan` reads it; it goes into the recording as part of its set-up.
    live
        Settings of the live page.
    device
        The device that samples.
    channels
        Inputs of that device; required for ``ni``, refused for the others, which have their own.
    counters
        Counters of that device, read at each sample of the inputs; with ``ni`` only.
    can
        CAN buses that are recorded as well.
    tachometer
        Instruments that send one number per line.
    modbus
        Drives whose registers are read.
    rsi
        KUKA controllers that send their joint angles.
    amplifier
        Charge amplifiers to which ranges are sent.
    """

    model_config = STRICT
    title: str = ""
    duration_s: Positive | None = None
    band_hz: tuple[Annotated[float, Field(ge=0)], Positive] | None = None
    tool: dict[str, Any] = Field(default_factory=dict)
    cut: dict[str, Any] = Field(default_factory=dict)
    pose: dict[str, Any] = Field(default_factory=dict)
    cutting: dict[str, Any] = Field(default_factory=dict)
    plan: dict[str, Any] = Field(default_factory=dict)
    live: LiveTable = LiveTable()
    device: Device
    channels: tuple[ChannelTable, ...] = ()
    counters: tuple[CounterTable, ...] = ()
    can: tuple[CanTable, ...] = ()
    tachometer: tuple[TachometerTable, ...] = ()
    modbus: tuple[ModbusTable, ...] = ()
    rsi: tuple[RsiTable, ...] = ()
    amplifier: tuple[AmplifierTable, ...] = ()

    @model_validator(mode="after")
    def _check(self) -> "Session":
        for mistake in self._mistakes():
            raise ValueError(mistake)
        return self

    def _mistakes(self) -> Iterator[str]:
        driver = self.device.driver
        if driver == "ni" and not self.channels:
            yield "no [[channels]]; describe what is wired to the device"
        if driver != "ni" and (self.channels or self.counters):
            yield f"[[channels]] do not go with driver {driver!r}, which has its own channels; remove them"
        names = [*(channel.name for channel in self.channels), *(counter.name for counter in self.counters)]
        terminals = [*(channel.terminal for channel in self.channels), *(counter.counter for counter in self.counters)]
        for kind, values in (("channel name", names), ("terminal", terminals)):
            repeated = sorted({value for value in values if values.count(value) > 1})
            if repeated:
                yield f"{kind} {', '.join(repeated)} appears twice; each must be unique"
        if driver == "ni":
            yield from self._amplifier_mistakes()
        if isinstance(self.device, SimulatedDevice) and self.device.sweep_rpm and self.device.spindle_speed_rpm:
            yield "device has sweep_rpm and spindle_speed_rpm; a spindle sweeps or runs steadily: remove one"
        if self.band_hz is not None:
            yield from self._band_mistakes(self.band_hz)

    def _amplifier_mistakes(self) -> Iterator[str]:
        # A range is stated once, with its channel, so that the samples' scale and the amplifier's range cannot differ.
        labels = [table.label for table in self.amplifier]
        for channel in self.channels:
            if channel.amplifier and channel.amplifier not in labels:
                yield f"channel {channel.name}: no [[amplifier]] {channel.amplifier!r}; there are {', '.join(labels)}"
        for table in self.amplifier:
            ranges, sent = self.ranges_of(table), table.ranges_sent()
            for name in sorted(sent - set(ranges)):
                yield (
                    f"amplifier {table.label}: {{{name}}} is the range of no channel; give the channel {name} "
                    f"amplifier = {table.label!r} and amplifier_range"
                )
            for name in sorted(set(ranges) - sent):
                yield (
                    f"amplifier {table.label} does not receive the range of channel {name}; write {{{name}}} for "
                    "it in a command of on_open or check"
                )
            if not ranges:
                yield (
                    f"amplifier {table.label} belongs to no channel, so that its range could differ from the scale; "
                    f"give channels amplifier = {table.label!r} and amplifier_range"
                )

    def ranges_of(self, table: AmplifierTable) -> dict[str, float]:
        """Return the range of each channel of an amplifier, by name."""
        channels = [channel for channel in self.channels if channel.amplifier == table.label]
        return {channel.name: channel.amplifier_range or 0.0 for channel in channels}

    def _band_mistakes(self, band: tuple[float, float]) -> Iterator[str]:
        if band[0] >= band[1]:
            yield f"band_hz {list(band)} is empty; give the lower frequency first"
        rate = getattr(self.device, "sample_rate_hz", None)
        needed = SETTINGS.sample_rate_over_band * band[1]
        if rate is not None and rate < needed:
            yield (
                f"sample_rate_hz {rate:g} is too low for band_hz up to {band[1]:g} Hz; "
                f"sample at {needed:g} Hz or more, or narrow the band"
            )

    def feeds(self, folder: Path) -> list[EventFeed]:
        """Return the feeds of all auxiliary devices; ``folder`` is the folder of the session file.

        Amplifiers come first, so that their ranges are set before another device is started.
        """
        return [
            *(Amplifier(table, self.ranges_of(table)) for table in self.amplifier),
            *(CanFeed(table, folder) for table in self.can),
            *(TachometerFeed(table) for table in self.tachometer),
            *(ModbusFeed(table) for table in self.modbus),
            *(RsiFeed(table) for table in self.rsi),
        ]


def session_text(path: str | os.PathLike[str]) -> str:
    """Read the text of a session file, which is also stored in the recording.

    Parameters
    ----------
    path
        Path of the session file.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        The file is too large for a session, or not text in UTF-8.
    """
    file = Path(path)
    if not file.is_file():
        raise InputError(f"no session file {path}; check the name")
    if file.stat().st_size > SETTINGS.largest_session_bytes:
        raise FileFormatError(f"{path} has {file.stat().st_size} bytes; that is no session file")
    try:
        return file.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path} is not text in UTF-8; save it in that encoding") from error


def session_from_text(text: str, name: str = "session") -> Session:
    """Parse and check the text of a session.

    Parameters
    ----------
    text
        Session as TOML text.
    name
        Name of the file, for messages.

    Raises
    ------
    InputError
        A value that cannot be: the message names the key, the value and the remedy.
    FileFormatError
        The text is not TOML.
    """
    try:
        content = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
        raise FileFormatError(f"{name} is not TOML: {' '.join(str(error).split())}") from error
    try:
        return Session.model_validate(content)
    except ValidationError as error:
        texts = {
            "union_tag_not_found": ".driver is missing; use ni, replay or simulated",
            "union_tag_invalid": ".driver is not known; use ni, replay or simulated",
        }
        raise InputError(f"{name}: {mistake_in_words(error, Session, texts)}") from error


def build_source(session: Session, setup: str, folder: Path, sampled: Source | None = None) -> Source:
    """Build the source of a session and set up the sampling device, so that the achieved rate is known.

    Parameters
    ----------
    session
        Session that was read and checked.
    setup
        Set-up of the recording, TOML text.
    folder
        Folder to which the file names in the session are relative.
    sampled
        Source of the samples if the device is not one of this package (the simulated cell).

    Raises
    ------
    DriverMissing, Disconnected, DeviceError, InputError
    """
    if sampled is None:
        sampled = _sampled_source(session, setup, folder)
    feeds = session.feeds(folder)
    return WithFeeds(sampled, feeds) if feeds else sampled


def _sampled_source(session: Session, setup: str, folder: Path) -> Source:
    device = session.device
    if isinstance(device, NiDevice):
        return NiSource(
            device,
            session.channels,
            session.counters,
            duration=session.duration_s,
            title=session.title,
            setup=setup,
        )
    if isinstance(device, ReplayDevice):
        return ReplaySource(folder / device.file, speed=device.speed)
    raise InputError(f"driver {device.driver!r} is built elsewhere; give the source")
