"""Check of signals before a cut: dead channels, headroom, open or shorted sensors, noise floor.

Taps show whether force and acceleration agree in time and sign.
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

from ..settings import STEPS


@dataclass(frozen=True)
class ChannelCheck:
    """Levels of one channel in quiet, or while tapping."""

    channel: Channel
    mean: float  # in the channel's unit, as deviation and peak
    deviation: float  # standard deviation
    peak: float  # about zero
    noise_density: float  # square root of the median spectral density, unit/sqrt(Hz)

    @property
    def margin_db(self) -> float:
        """Full scale over peak, dB; infinite where unknown."""
        full_scale = self.channel.full_scale
        return math.inf if not full_scale or self.peak == 0 else 20 * math.log10(full_scale / self.peak)

    def concerns(self) -> list[str]:
        """Faults of the channel, one sentence each; the first that applies explains the others."""
        name, full_scale = self.channel.name, self.channel.full_scale
        if self.deviation == 0:
            return [f"{name}: every sample is {self.mean:g} (no signal); check cable, terminal and supply"]
        if full_scale and abs(self.mean) > STEPS.open_offset * full_scale:
            return [f"{name}: rests at {100 * self.mean / full_scale:.0f} % of full scale (sensor open?); check cable"]
        if full_scale and self.deviation < STEPS.shorted * full_scale:
            return [f"{name}: quieter than an input alone (shorted?); check cable and connector"]
        if self.margin_db < 0.01:
            return [f"{name}: overload, peak at full scale {full_scale:g} {self.channel.unit}; choose a larger range"]
        if self.margin_db < STEPS.least_margin_db:
            return [f"{name}: peak only {self.margin_db:.1f} dB below full scale; choose a larger range"]
        return []


@dataclass(frozen=True)
class TapCheck:
    """A tap's force against one acceleration at the same point and axis."""

    force: Channel
    acceleration: Channel
    delay: float  # s; delay of the acceleration behind the force, beyond what the channels' known input delays explain
    agrees: bool  # whether the signs of both agree with their stated directions

    def concerns(self) -> list[str]:
        """Faults of the pair, one sentence each."""
        pair, concerns = f"{self.force.name} and {self.acceleration.name}", []
        if not self.agrees:
            concerns.append(
                f"{pair}: a tap moves them in opposite senses; correct the sign of a direction or sensitivity"
            )
        if abs(self.delay) > STEPS.largest_delay:
            concerns.append(f"{pair}: {1e6 * self.delay:.0f} us apart; state the later amplifier's delay in delay_us")
        return concerns


@dataclass(frozen=True)
class Preflight:
    """All checks made before a recording."""

    checks: tuple[ChannelCheck, ...]
    taps: tuple[TapCheck, ...]  # pairs of channels that show taps
    doubts: tuple[str, ...] = ()  # auxiliary devices that were lost or silent, one sentence each

    def concerns(self) -> list[str]:
        """Faults of channels, pairs and devices, one sentence each."""
        checks: tuple[ChannelCheck | TapCheck, ...] = (*self.checks, *self.taps)
        return [*(line for check in checks for line in check.concerns()), *self.doubts]

    def table(self) -> Table:
        """Table with one row for each channel."""
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
class SourceSamples:
    """Samples that a source gave while it was checked."""

    streams: tuple[tuple[StreamDescription, Real], ...]  # each stream with its samples (n, n_channels)
    doubts: tuple[str, ...]  # auxiliary devices that were lost or silent, one sentence each


def listen(source: Source, seconds: float) -> SourceSamples:
    """Read some seconds of every stream into memory, and the events of auxiliary devices meanwhile."""
    taken: dict[str, list[Real]] = {stream.name: [] for stream in source.streams}
    events: list[Events] = []
    latest = time.monotonic() + 10 * seconds + 30  # a device that starts slowly or stalls must not block forever
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
    return SourceSamples(streams, tuple(_device_doubts(source, events, seconds)))


def _device_doubts(source: Source, events: Sequence[Events], seconds: float) -> list[str]:
    """Return the losses and faults in the log of the devices, and the series without a value."""
    lines = [
        text
        for logged in events
        if logged.series == DEVICES
        for value, text in zip(logged.values, logged.texts or (), strict=True)
        if value in (LOST, FAULT)
    ]
    received = {series.series for series in events if len(series.values)}
    # marks with texts, values by sample and counters of lost packets may stay empty in a sound set-up
    silent = [
        name
        for name, axis in announced_events(source).items()
        if name not in received and not axis.texts and axis.kind != "samples" and name not in RSI_COUNTS
    ]
    if silent:
        lines.append(f"no value came of {', '.join(silent)} in {seconds:g} s; check the device, its names and its wire")
    return lines


def preflight(streams: Sequence[tuple[StreamDescription, Real]], doubts: Sequence[str] = ()) -> Preflight:
    """Check each channel and each pair with taps; ``doubts`` about auxiliary devices are added."""
    checks, taps = [], []
    for stream, samples in streams:
        for column, channel in enumerate(stream.channels):
            checks.append(_channel_check(channel, samples[:, column], stream.sample_rate))
        taps += _tap_checks(stream, samples)
    return Preflight(tuple(checks), tuple(taps), tuple(doubts))


def _channel_check(channel: Channel, samples: Real, rate: float) -> ChannelCheck:
    """Compute the levels of a channel; the noise floor is the median of a Hann-windowed spectrum of 1 s segments."""
    # the median over frequency ignores the few lines of mains hum and of the spindle
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
    checks = []
    for i, force in enumerate(stream.channels):
        signal = samples[:, i] - np.median(samples[:, i])
        if force.quantity != "force" or not force.node or np.abs(signal).max() < STEPS.tap_crest * signal.std():
            continue
        times = [tap.time for tap in find_taps(signal, stream.sample_rate) if tap.second_hit is None]
        for k, other in enumerate(stream.channels):
            same = other.node == force.node and other.direction[1:] == force.direction[1:]
            if other.quantity == "acceleration" and same and times:
                sign = 1.0 if other.direction == force.direction else -1.0
                checks.append(_tap_check(force, other, signal, sign * samples[:, k], times, stream.sample_rate))
    return checks


def _tap_check(
    force: Channel, acceleration: Channel, forces: Real, motions: Real, times: Sequence[float], rate: float
) -> TapCheck:
    """Compute delay and sign of an acceleration from the peak of its cross-correlation with the force about the taps.

    A parabola gives the position of the peak between samples.
    """
    reach = max(4, round(2e-3 * rate))  # delays up to 2 ms are found
    lags = np.arange(-reach, reach + 1)
    total = np.zeros(len(lags))
    for tap in times:
        centre = round(tap * rate)
        low, high = centre - 2 * reach, centre + 2 * reach
        if low - reach < 0 or high + reach > len(forces):
            continue
        pulse = forces[low:high]
        total += [float(pulse @ motions[low + lag : high + lag]) for lag in lags]
    top = int(np.clip(np.argmax(np.abs(total)), 1, len(lags) - 2))
    left, middle, right = total[top - 1 : top + 2]
    curvature = left - 2 * middle + right
    shift = 0.5 * (left - right) / curvature if curvature else 0.0
    known = (acceleration.input_delay_s or 0.0) - (force.input_delay_s or 0.0)
    return TapCheck(force, acceleration, float((lags[top] + shift) / rate) - known, bool(middle > 0))
