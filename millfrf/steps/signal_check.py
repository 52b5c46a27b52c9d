"""Before a cut: are the signals alive, is there headroom, are sensors open or shorted, what is the noise floor,
and does a tap say that force and acceleration agree in time and sign?
"""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition import DEVICES, FAULT, LOST, RSI_COUNTS, Channel, Events, Source, StreamDescription, announced_events
from estimation import find_taps
from millfrf.core import InputError, Real
from millfrf.core.terminal import Table

LEAST_MARGIN_DB = 6.0
"""Headroom below which a peak is too near to full scale."""

SHORTED = 3e-6
"""Deviation over full scale below which an input is taken for shorted; a 24-bit input has 1e-6 to 1e-5 of its own."""

OPEN_OFFSET = 0.5
"""Mean over full scale above which a sensor is taken for open: its supply drives the input to the rail."""

TAP = 12.0
"""Peak over deviation of a force that is taken for taps."""

LARGEST_DELAY = 50e-6
"""Delay between force and acceleration that shifts phases by 2 degrees at 100 Hz, s."""


@dataclass(frozen=True)
class ChannelCheck:
    """Levels of one channel in quiet, or while tapping.

    Parameters
    ----------
    channel
        The channel that was checked.
    mean, deviation, peak
        Mean, standard deviation and peak about zero, in the channel's unit.
    noise_density
        Median of the spectral density's root, unit/sqrt(Hz).
    """

    channel: Channel
    mean: float
    deviation: float
    peak: float
    noise_density: float

    @property
    def margin_db(self) -> float:
        """Full scale over peak, dB; infinite where unknown."""
        full_scale = self.channel.full_scale
        return math.inf if not full_scale or self.peak == 0 else 20 * math.log10(full_scale / self.peak)

    def concerns(self) -> list[str]:
        """What is wrong, one sentence each."""
        name, full_scale = self.channel.name, self.channel.full_scale
        if self.deviation == 0:
            return [f"{name}: every sample is {self.mean:g} (no signal); check cable, terminal and supply"]
        if full_scale and abs(self.mean) > OPEN_OFFSET * full_scale:
            return [f"{name}: rests at {100 * self.mean / full_scale:.0f} % of full scale (sensor open?); check cable"]
        if full_scale and self.deviation < SHORTED * full_scale:
            return [f"{name}: quieter than an input alone (shorted?); check cable and connector"]
        if self.margin_db < 0.01:
            return [f"{name}: overload, peak at full scale {full_scale:g} {self.channel.unit}; choose a larger range"]
        if self.margin_db < LEAST_MARGIN_DB:
            return [f"{name}: peak only {self.margin_db:.1f} dB below full scale; choose a larger range"]
        return []


@dataclass(frozen=True)
class TapCheck:
    """A tap's force against one acceleration at the same point and axis.

    Parameters
    ----------
    force, acceleration
        Channels of the force and of the acceleration.
    delay : s
        Delay of the acceleration behind the force, beyond what the channels' known input delays explain.
    agrees
        Whether both point the way that their signed directions say.
    """

    force: Channel
    acceleration: Channel
    delay: float
    agrees: bool

    def concerns(self) -> list[str]:
        """What is wrong, one sentence each."""
        pair, found = f"{self.force.name} and {self.acceleration.name}", []
        if not self.agrees:
            found.append(f"{pair}: a tap moves them in opposite senses; correct a direction's sign or a sensitivity's")
        if abs(self.delay) > LARGEST_DELAY:
            found.append(f"{pair}: {1e6 * self.delay:.0f} us apart; tell the later one's amplifier by delay_us")
        return found


@dataclass(frozen=True)
class Preflight:
    """All checks made before a recording.

    Parameters
    ----------
    checks, taps
        Checks of each channel, and of each pair of channels where there were taps.
    doubts
        Auxiliary devices that were lost or silent, one sentence each.
    """

    checks: tuple[ChannelCheck, ...]
    taps: tuple[TapCheck, ...]
    doubts: tuple[str, ...] = ()

    def concerns(self) -> list[str]:
        """What is wrong; empty where nothing is."""
        found = [check.concerns() for check in self.checks] + [tap.concerns() for tap in self.taps]
        return [*(line for lines in found for line in lines), *self.doubts]

    def table(self) -> Table:
        """One row a channel."""
        rows = tuple(
            (
                check.channel.name,
                check.channel.unit,
                f"{check.mean:.3g}",
                f"{check.deviation:.3g}",
                f"{check.peak:.3g}",
                "" if math.isinf(check.margin_db) else f"{check.margin_db:.1f}",
                f"{check.noise_density:.3g}",
            )
            for check in self.checks
        )
        columns = ("channel", "unit", "mean", "rms about mean", "peak", "margin (dB)", "noise (unit/sqrt Hz)")
        return Table("Pre-flight", columns, rows)


@dataclass(frozen=True)
class Heard:
    """What came from a source while it was listened to.

    Parameters
    ----------
    streams
        Each stream with its samples (n, n_channels).
    doubts
        Auxiliary devices that were lost or silent, one sentence each.
    """

    streams: tuple[tuple[StreamDescription, Real], ...]
    doubts: tuple[str, ...]


def listen(source: Source, seconds: float) -> Heard:
    """Samples of every stream for a while, in memory, and what auxiliary devices did meanwhile.

    Raises
    ------
    InputError
        Nothing came.
    DeviceError
        The device failed.
    """
    taken: dict[str, list[Real]] = {stream.name: [] for stream in source.streams}
    events: list[Events] = []
    latest = time.monotonic() + 10 * seconds + 30
    try:
        source.open()
        while time.monotonic() < latest:
            block = source.read()
            if block is None:
                break
            if isinstance(block, Events):
                events.append(block)
                continue
            taken[block.stream].append(block.samples)
            if all(sum(map(len, taken[s.name])) >= seconds * s.sample_rate for s in source.streams):
                break
    finally:
        source.close()
    if not all(taken.values()):
        raise InputError("the device gave no samples; nothing can be checked")
    streams = tuple((stream, np.concatenate(taken[stream.name])) for stream in source.streams)
    return Heard(streams, tuple(_device_doubts(source, events, seconds)))


def _device_doubts(source: Source, events: Sequence[Events], seconds: float) -> list[str]:
    """What the log of the devices says, and series that nothing came of."""
    lines = [
        text
        for one in events
        if one.series == DEVICES
        for value, text in zip(one.values, one.texts or (), strict=True)
        if value in (LOST, FAULT)
    ]
    heard = {one.series for one in events if len(one.values)}
    mute = [
        name
        for name, axis in announced_events(source).items()
        if name not in heard and not axis.texts and axis.kind != "samples" and name not in RSI_COUNTS
    ]
    if mute:
        lines.append(f"no value came of {', '.join(mute)} in {seconds:g} s; check the device, its names and its wire")
    return lines


def preflight(streams: Sequence[tuple[StreamDescription, Real]], doubts: Sequence[str] = ()) -> Preflight:
    """Judge what was listened to; ``doubts`` about auxiliary devices are passed on."""
    checks, taps = [], []
    for stream, samples in streams:
        for column, channel in enumerate(stream.channels):
            checks.append(_channel_check(channel, samples[:, column], stream.sample_rate))
        taps += _tap_checks(stream, samples)
    return Preflight(tuple(checks), tuple(taps), tuple(doubts))


def _channel_check(channel: Channel, samples: Real, rate: float) -> ChannelCheck:
    length = min(len(samples), 1 << int(np.log2(max(rate, 2))))
    segments = samples[: len(samples) // length * length].reshape(-1, length)
    window = np.hanning(length)
    lines = np.fft.rfft((segments - segments.mean(axis=1, keepdims=True)) * window, axis=1)
    density = 2 * np.mean(np.abs(lines) ** 2, axis=0) / (rate * np.sum(window**2))
    mean = float(samples.mean())
    return ChannelCheck(
        channel, mean, float(samples.std()), float(np.abs(samples).max()), float(np.sqrt(np.median(density)))
    )


def _tap_checks(stream: StreamDescription, samples: Real) -> list[TapCheck]:
    found = []
    for i, force in enumerate(stream.channels):
        signal = samples[:, i] - np.median(samples[:, i])
        if force.quantity != "force" or not force.node or np.abs(signal).max() < TAP * signal.std():
            continue
        times = [tap.time for tap in find_taps(signal, stream.sample_rate) if tap.second_hit is None]
        for k, other in enumerate(stream.channels):
            same = other.node == force.node and other.direction[1:] == force.direction[1:]
            if other.quantity == "acceleration" and same and times:
                sign = 1.0 if other.direction == force.direction else -1.0
                found.append(_tap_check(force, other, signal, sign * samples[:, k], times, stream.sample_rate))
    return found


def _tap_check(
    force: Channel, acceleration: Channel, forces: Real, motions: Real, times: Sequence[float], rate: float
) -> TapCheck:
    """Peak of the cross-correlation about each tap, in thirds of a sample or better by a parabola."""
    reach = max(4, round(2e-3 * rate))
    lags = np.arange(-reach, reach + 1)
    total = np.zeros(len(lags))
    for tap in times:
        centre = round(tap * rate)
        low, high = centre - 2 * reach, centre + 2 * reach
        if low - reach < 0 or high + reach > len(forces):
            continue
        part = forces[low:high]
        total += [float(part @ motions[low + lag : high + lag]) for lag in lags]
    top = int(np.clip(np.argmax(np.abs(total)), 1, len(lags) - 2))
    left, middle, right = total[top - 1 : top + 2]
    curvature = left - 2 * middle + right
    shift = 0.5 * (left - right) / curvature if curvature else 0.0
    known = (acceleration.input_delay_s or 0.0) - (force.input_delay_s or 0.0)
    return TapCheck(force, acceleration, float((lags[top] + shift) / rate) - known, bool(middle > 0))
