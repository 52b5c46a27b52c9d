"""One clock: drift, offset and stalls; events land on the samples' axis within a millisecond."""

from collections.abc import Iterator
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition import (
    HOST_AXIS,
    Block,
    Channel,
    EventAxis,
    Events,
    Recording,
    RecordingWriter,
    StreamDescription,
    record,
)
from acquisition.recordings.alignment import Aligner, fit_clock
from acquisition.sources.timing import pulse_times, shaft_angle
from millfrf.core import FileFormatError, InputError

RATE = 1000.0
STREAM = StreamDescription("main", RATE, 0.5, (Channel("fx", "force", "N"),))


def _lateness(generator: np.random.Generator, n: int) -> np.ndarray:
    """A fifth of a millisecond usually, and stalls of up to seconds that hold several readings back."""
    late = generator.exponential(2e-4, n)
    for start in np.flatnonzero(generator.random(n) < 0.02):
        stop = min(start + int(generator.integers(1, 20)), n)
        late[start:stop] += generator.uniform(0.01, 2.0)
    return late


@given(seed=st.integers(0, 1000), drift=st.floats(-100e-6, 100e-6), offset=st.floats(-1e6, 1e6))
def test_drift_and_offset_are_found_through_stalls(seed: int, drift: float, offset: float) -> None:
    generator = np.random.default_rng(seed)
    samples = np.arange(1, 6001) * 5120.0
    true = offset + samples / 51200 * (1 + drift)
    fit = fit_clock(samples, true + _lateness(generator, 6000), 1 / 51200)
    assert fit.drift == pytest.approx(drift, abs=0.5e-6)
    assert np.abs(fit.host(samples) - true).max() < 0.5e-3
    np.testing.assert_allclose(fit.local(fit.host(samples)), samples, atol=1e-3)


@pytest.mark.parametrize("duration", [0.5, 2.0, 10.0])
def test_a_short_recording_is_not_given_an_absurd_drift(duration: float) -> None:
    generator = np.random.default_rng(1)
    seconds = np.arange(0.1, duration, 0.1)
    fit = fit_clock(seconds, seconds + _lateness(generator, len(seconds)), 1.0)
    assert abs(fit.drift) < 100e-6
    assert np.abs(fit.host(seconds) - seconds).max() < 1.5e-3


def test_no_pair_and_bad_pairs_are_refused() -> None:
    with pytest.raises(InputError, match="at least one pair"):
        fit_clock(np.empty(0), np.empty(0), 1.0)
    with pytest.raises(InputError, match="NaN"):
        fit_clock(np.array([1.0]), np.array([np.nan]), 1.0)


class DriftingLab:
    """Ten minutes of a slow data logger, a CAN bus with a fast clock of its own, and a serial line, on a busy host.

    The true time of an event is its value. The logger's sample i is taken at i / RATE * (1 + 50 ppm).
    """

    title, setup, streams, n_samples = "", "", (STREAM,), None
    event_series: ClassVar = {
        "can": EventAxis("device", "can0"),
        "other": EventAxis("device", "can0"),
        "serial": HOST_AXIS,
    }
    logger_drift, can_drift, can_epoch, host_epoch = 50e-6, -80e-6, 1.7e9, 4321.0

    def __init__(self, duration: float, seed: int) -> None:
        self.duration, self.generator = duration, np.random.default_rng(seed)
        self._given: Iterator[Block | Events] = iter(())

    def open(self) -> None:
        self._given = self._play()

    def read(self) -> Block | Events | None:
        return next(self._given, None)

    def close(self) -> None:
        self._given = iter(())

    def _play(self) -> Iterator[Block | Events]:
        length, g = 500, self.generator
        n = int(self.duration * RATE / length)
        late = _lateness(g, n)
        for k in range(n):
            true = (k + 1) * length / RATE * (1 + self.logger_drift)
            yield Block("main", k * length, np.zeros((length, 1)), self.host_epoch + true + late[k])
            for name in ("can", "other"):
                at = true - g.uniform(0, 0.5, 3 if name == "can" else 1)
                clock = self.can_epoch + at * (1 + self.can_drift)
                yield Events(name, clock, at, self.host_epoch + at + _lateness(g, len(at)))
            at = np.array([true - 0.1])
            yield Events("serial", self.host_epoch + at + g.uniform(0, 3e-4, 1), at)

    def on_sample_axis(self, true: np.ndarray) -> np.ndarray:
        return STREAM.start_time + true / (1 + self.logger_drift)


@pytest.mark.long
def test_events_land_within_a_millisecond_after_ten_minutes(tmp_path: Path) -> None:
    lab = DriftingLab(600.0, 5)
    record(lab, tmp_path / "a.h5", spare_bytes=0)
    with Recording(tmp_path / "a.h5") as recording:
        for name, series in recording.events.items():
            times, true = series.read()
            assert len(times) >= 1200
            assert np.abs(times - lab.on_sample_axis(true)).max() < 1e-3, name
            raw, _, _ = series.read_raw()
            unfitted = raw - raw[0] - (lab.on_sample_axis(true) - lab.on_sample_axis(true[:1]))
            assert np.abs(unfitted).max() > 15e-3, "the test injects no drift"


def test_events_without_any_clock_pair_are_an_error_in_one_line(tmp_path: Path) -> None:
    lab = DriftingLab(2.0, 1)
    lab.open()
    events = [item for item in lab._play() if isinstance(item, Events)]
    with RecordingWriter(tmp_path / "a.h5", [STREAM], event_axes=lab.event_series) as writer:
        for item in events:
            writer.append_events(item)
    with Recording(tmp_path / "a.h5") as recording, pytest.raises(FileFormatError, match="cannot be aligned"):
        recording.events["can"].read()


@pytest.mark.parametrize(("delays", "late"), [((0.02, 0.02), 0.02), ((0.05, None), 0.0), ((0.05, 0.02), 0.02)])
def test_events_lie_where_the_least_delayed_channel_shows_them(
    tmp_path: Path, delays: tuple[float, float | None], late: float
) -> None:
    channels = tuple(Channel(f"a{k}", "acceleration", "m/s^2", input_delay_s=d) for k, d in enumerate(delays))
    stream = StreamDescription("main", RATE, 0.5, channels)
    with RecordingWriter(tmp_path / "a.h5", [stream], event_axes={"speed": HOST_AXIS}) as writer:
        writer.append("main", np.zeros((1000, 2)))
        writer.append_clock_pairs("main", np.array([[0, 77.0], [500, 77.5], [1000, 78.0]]))
        writer.append_events(Events("speed", np.array([77.25]), np.array([1.0])))
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.events["speed"].read()[0] == pytest.approx([0.5 + 0.25 + late], abs=1e-9)
        assert recording.stream().channels == channels


@given(cuts=st.lists(st.integers(0, 600), max_size=6), delays=st.lists(st.floats(0, 0.05), min_size=1, max_size=3))
def test_channels_are_aligned_alike_in_any_blocks(cuts: list[int], delays: list[float]) -> None:
    """Tones below 0.45 of the rate, each channel as late as it says: the same values at the same times."""
    rate, tones = 1000.0, np.array([3.7, 61.0, 210.0, 440.0])
    time = np.arange(600)[:, None] / rate - np.array(delays)
    late = np.sin(2 * np.pi * time[..., None] * tones).sum(axis=-1)
    whole = Aligner(delays, rate)
    even = whole.add(late)
    rows = np.arange(len(even)) + whole.skipped
    true = np.sin(2 * np.pi * rows[:, None] / rate * tones).sum(axis=1)
    if not whole.is_trivial or not any(delays):
        assert np.abs(even - true[:, None]).max() < 1e-3
    parts = Aligner(delays, rate)
    pieces = [parts.add(part) for part in np.split(late, sorted(cuts))]
    np.testing.assert_allclose(np.concatenate(pieces), even, atol=1e-12)


def test_shaft_angle_follows_a_changing_speed() -> None:
    rate, pulses = 25600.0, 2
    time = np.arange(int(4 * rate)) / rate
    angle = 2 * np.pi * (40.0 * time + 2.0 * time**2 + 0.02 * np.sin(2 * np.pi * 1.5 * time))
    voltage = 5.0 * (np.mod(angle * pulses / (2 * np.pi) - 0.25, 1.0) < 0.3)
    voltage += 0.2 * np.random.default_rng(0).standard_normal(len(time))
    result = shaft_angle(voltage, rate, pulses)
    true = angle[result.first_sample : result.first_sample + len(result.angle)]
    error = np.degrees(result.angle - true - np.mean(result.angle - true))
    late = shaft_angle(voltage, rate, pulses, delay=100 / rate)
    assert late.first_sample == result.first_sample - 100
    np.testing.assert_allclose(late.angle, result.angle[: len(late.angle)], atol=1e-9)
    assert np.abs(error).max() < 0.8  # one sample at 56 revolutions a second is 0.79 degrees
    assert len(pulse_times(np.zeros(10) + np.arange(10.0), 1.0)) == 1
    with pytest.raises(InputError, match="0 pulses"):
        shaft_angle(np.r_[np.ones(50), np.zeros(50)], 1.0)
