"""Session files: TOML tables of channels and devices, checked, and the source that they describe."""

import os
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, ValidationError, model_validator

from millfrf.core import FileFormatError, InputError, mistake_in_words

from ..drivers.ni_source import NiClocks, NiSource
from ..drivers.replay import ReplaySource
from ..sources.feeds import WithFeeds
from ..sources.source import Source
from .channel_table import STRICT, ChannelTable, CounterTable, Name, Positive
from .feed_tables import AmplifierTable, CanTable, ModbusTable, RsiTable, TachometerTable

FREQUENCIES_A_SAMPLE_RATE = 2.56
"""A sample rate must be at least this many times the band's upper end, so that the anti-alias filter fits between."""


class NiDevice(BaseModel):
    """`[device]` with ``driver = "ni"``; clocks and trigger as in `NiClocks`, empty: as DAQmx chooses.

    Parameters
    ----------
    driver
        ``ni``: a device of National Instruments through DAQmx.
    sample_rate_hz : Hz
        Samples a second of every channel; at least 2.56 times the upper end of ``band_hz``.
    block_s : s
        Duration of a block that is read and written at once.
    buffer_s : s
        Duration that the driver's buffer holds while the disk is slow.
    timeout_s : s
        Time without samples after which the device counts as lost.
    sample_clock
        Terminal of an external sample clock, such as ``/cDAQ1/PFI0``; empty: the device's own.
    reference_clock
        Terminal of a reference clock that several chassis share, such as ``/PXI1Slot2/PXI_Clk10``.
    reference_clock_hz : Hz
        Rate of that clock; left out: DAQmx knows it.
    sync_pulse
        Terminal of the pulse that aligns the converters of several devices.
    start_trigger
        Terminal whose edge starts the samples; empty: at once.
    start_edge
        Edge that counts.
    trigger_timeout_s : s
        Time to wait for that edge.
    """

    model_config = STRICT
    driver: Literal["ni"]
    sample_rate_hz: Positive
    block_s: Annotated[float, Field(gt=0.001, le=10)] = 0.1
    buffer_s: Annotated[float, Field(ge=0.2, le=600)] = 10.0
    timeout_s: Positive = 5.0
    sample_clock: str = ""
    reference_clock: str = ""
    reference_clock_hz: Positive | None = None
    sync_pulse: str = ""
    start_trigger: str = ""
    start_edge: Literal["rising", "falling"] = "rising"
    trigger_timeout_s: Positive = 600.0

    def clocks(self) -> NiClocks:
        """Clocks and trigger as the driver takes them."""
        return NiClocks(
            self.sample_clock,
            self.reference_clock,
            self.reference_clock_hz,
            self.sync_pulse,
            self.start_trigger,
            self.start_edge,
            self.trigger_timeout_s,
        )


class ReplayDevice(BaseModel):
    """`[device]` with ``driver = "replay"``: a recording instead of a device, ``speed`` times as fast as it was.

    Parameters
    ----------
    driver
        ``replay``: a recording instead of a device.
    file
        Recording, from the folder of the session file.
    speed
        Factor over real time.
    """

    model_config = STRICT
    driver: Literal["replay"]
    file: Name
    speed: Positive = 1.0


class SimulatedDevice(BaseModel):
    """`[device]` with ``driver = "simulated"``: the simulated cell, milling, ``speed`` times as fast as real.

    Parameters
    ----------
    sample_rate_hz : Hz
        Samples a second of every channel.
    sweep_rpm : rpm
        First and last spindle speed of a sweep, back and forth as long as it is recorded; left out: those of the plan,
        else of the demonstration.
    sweep_s : s
        Duration of a sweep; left out: as planned, and without ``[plan]`` ``duration_s``, else 60 s.
    spindle_speed_rpm : rpm
        A steady speed instead of a sweep.
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
        Recordings beside the one to write that are stacked with it, a pattern of names; "" for none.
    frf_error
        Wanted standard deviation of the FRF over its magnitude; lines below it count as having enough data.
    bands
        Number of frequency bands for which that is told.
    """

    model_config = STRICT
    segment_s: Annotated[float, Field(gt=0, le=60)] | None = None
    tests: Annotated[str, Field(pattern=r"^[^/\\]*$")] = "*.h5"
    frf_error: Positive = 0.1
    bands: Annotated[int, Field(ge=1, le=40)] = 8


Device = Annotated[NiDevice | ReplayDevice | SimulatedDevice, Field(discriminator="driver")]
FeedTable = CanTable | TachometerTable | ModbusTable | RsiTable | AmplifierTable


class Session(BaseModel):
    """A session file: what is recorded, from which devices, and for how long.

    Parameters
    ----------
    title
        Title of the recording.
    duration_s : s
        Duration of the recording; left out: until stopped.
    band_hz : Hz
        Lowest and highest frequency that matter; the sample rate is held against them.
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
        Inputs of that device; needed for ``ni``, refused for the others, which bring their own.
    counters
        Counters of that device, read at each sample of the inputs; with ``ni`` only.
    can
        CAN buses that are heard beside.
    tachometer
        Instruments that send a number a line.
    modbus
        Drives that are asked for registers.
    rsi
        KUKA controllers that send their joint angles.
    amplifier
        Charge amplifiers that are told their ranges.
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
    def _consistent(self) -> "Session":
        for complaint in self._complaints():
            raise ValueError(complaint)
        return self

    def _complaints(self) -> Iterator[str]:
        driver = self.device.driver
        if driver == "ni" and not self.channels:
            yield "no [[channels]]; describe what is wired to the device"
        if driver != "ni" and (self.channels or self.counters):
            yield f"[[channels]] do not go with driver {driver!r}, which brings its own; remove them"
        for what, values in (
            ("channel name", [*(each.name for each in self.channels), *(each.name for each in self.counters)]),
            ("terminal", [*(each.terminal for each in self.channels), *(each.counter for each in self.counters)]),
        ):
            twice = sorted({value for value in values if values.count(value) > 1})
            if twice:
                yield f"{what} {', '.join(twice)} appears twice; each must be unique"
        if driver == "ni":
            yield from self._amplifier_complaints()
        if isinstance(self.device, SimulatedDevice) and self.device.sweep_rpm and self.device.spindle_speed_rpm:
            yield "device has sweep_rpm and spindle_speed_rpm; a spindle sweeps or runs steadily: remove one"
        if self.band_hz is not None:
            yield from self._band_complaints(self.band_hz)

    def _amplifier_complaints(self) -> Iterator[str]:
        """A range must stand in one place: with its channel, from where the amplifier is told it."""
        called = [table.called for table in self.amplifier]
        for channel in self.channels:
            if channel.amplifier and channel.amplifier not in called:
                yield f"channel {channel.name}: no [[amplifier]] {channel.amplifier!r}; there are {', '.join(called)}"
        for table in self.amplifier:
            own, told = self.ranges_of(table), table.ranges_told()
            for name in sorted(told - set(own)):
                yield (
                    f"amplifier {table.called}: {{{name}}} is the range of no channel; give the channel {name} "
                    f"amplifier = {table.called!r} and amplifier_range"
                )
            for name in sorted(set(own) - told):
                yield (
                    f"amplifier {table.called} is not told the range of channel {name}; write {{{name}}} for it in a "
                    "command of on_open or check"
                )
            if not own:
                yield (
                    f"amplifier {table.called} belongs to no channel, so that its range could differ from the scale; "
                    f"give channels amplifier = {table.called!r} and amplifier_range"
                )

    def ranges_of(self, table: AmplifierTable) -> dict[str, float]:
        """Range by name of the channels that an amplifier serves."""
        served = [channel for channel in self.channels if channel.amplifier == table.called]
        return {channel.name: channel.amplifier_range or 0.0 for channel in served}

    def _band_complaints(self, band: tuple[float, float]) -> Iterator[str]:
        if band[0] >= band[1]:
            yield f"band_hz {list(band)} is empty; give the lower frequency first"
        rate = getattr(self.device, "sample_rate_hz", None)
        needed = FREQUENCIES_A_SAMPLE_RATE * band[1]
        if rate is not None and rate < needed:
            yield (
                f"sample_rate_hz {rate:g} is too low for band_hz up to {band[1]:g} Hz; "
                f"sample at {needed:g} Hz or more, or narrow the band"
            )

    @property
    def feeds(self) -> tuple[FeedTable, ...]:
        """All tables of further devices; amplifiers first, so that they are set before anything runs."""
        return (*self.amplifier, *self.can, *self.tachometer, *self.modbus, *self.rsi)


_DRIVERS = {
    "union_tag_not_found": ".driver is missing; use ni, replay or simulated",
    "union_tag_invalid": ".driver is not known; use ni, replay or simulated",
}
_LARGEST = 1_000_000


def read_session(path: str | os.PathLike[str]) -> Session:
    """Read and check a session file.

    Raises
    ------
    InputError
        No such file, or a value that cannot be: the line names the key, the value and the remedy.
    FileFormatError
        Not TOML.
    """
    return session_from_text(session_text(path), os.fspath(path))


def session_text(path: str | os.PathLike[str]) -> str:
    """The file's text, to be kept in the recording.

    Raises
    ------
    InputError, FileFormatError
    """
    file = Path(path)
    if not file.is_file():
        raise InputError(f"no session file {path}; check the name")
    if file.stat().st_size > _LARGEST:
        raise FileFormatError(f"{path} has {file.stat().st_size} bytes; that is no session file")
    try:
        return file.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path} is not text in UTF-8; save it so") from error


def session_from_text(text: str, name: str = "session") -> Session:
    """Check a session given as text.

    Raises
    ------
    InputError, FileFormatError
    """
    try:
        content = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
        raise FileFormatError(f"{name} is not TOML: {' '.join(str(error).split())}") from error
    try:
        return Session.model_validate(content)
    except ValidationError as error:
        raise InputError(f"{name}: {mistake_in_words(error, Session, _DRIVERS)}") from error


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
