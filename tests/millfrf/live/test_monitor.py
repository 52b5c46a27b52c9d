"""The live page's parts: traces, amount of data, monitor and buttons."""

import time

import numpy as np
import pytest

from acquisition import Block, Channel, Events
from estimation import SpectralAccumulator, h1, settings_for
from millfrf.live.control import LiveControl
from millfrf.live.monitor import LiveMonitor
from millfrf.live.spectra import TraceBuffer, band_progress

RATE = 4096.0
CHANNELS = (
    Channel("fx", "force", "N", "TCP", "+X", full_scale=10.0),
    Channel("ax", "acceleration", "m/s^2", "TCP", "+X", full_scale=3.0),
)


def _samples(n: int, seed: int = 0) -> np.ndarray:
    generator = np.random.default_rng(seed)
    force = generator.standard_normal(n)
    return np.stack([force, 0.5 * force + 0.1 * generator.standard_normal(n)], axis=1)


def test_traces_keep_every_peak_whatever_the_blocks() -> None:
    samples = _samples(20000)
    samples[12345, 0] = 99.0
    whole, parts = TraceBuffer(2, RATE, 5.0, 100), TraceBuffer(2, RATE, 5.0, 100)
    whole.add(samples)
    for start in range(0, 20000, 37):
        parts.add(samples[start : start + 37])
    for each, other in zip(whole.drawn(), parts.drawn(), strict=True):
        np.testing.assert_array_equal(each, other)
    times, values = whole.drawn()
    assert len(times) <= 200
    assert values[:, 0].max() == 99.0
    assert times[np.argmax(values[:, 0])] == pytest.approx(12345 / RATE, abs=5.0 / 100)


def test_enough_data_grows_with_the_averages() -> None:
    accumulator = SpectralAccumulator(CHANNELS[:1], CHANNELS[1:], RATE, settings_for(RATE, 0.25, window="hann"))
    done = []
    for seed in range(4):
        samples = _samples(int(8 * RATE), seed)
        accumulator.add(samples[:, :1], samples[:, 1:])
        bands = band_progress(h1(accumulator.result()), (0.0, 2000.0), 5, relative=0.02)
        done.append(np.mean([band.done for band in bands]))
    # H1 of y = 0.5 x + noise: sigma^2 / |H|^2 = (0.1 / 0.5)^2 / N, wanted 0.02^2: N = 100 averages
    assert done[0] == pytest.approx(accumulator.result().effective_averages / 4 / 100, rel=0.2)
    assert done == sorted(done)
    assert all(band.enough for band in band_progress(h1(accumulator.result()), (0.0, 2000.0), 5, relative=0.1))
    assert band_progress(None, (0.0, 100.0), 3, relative=0.1)[0].done == 0.0


def test_a_monitor_shows_what_came_and_never_waits(monitor: LiveMonitor) -> None:
    samples = _samples(int(12 * RATE))
    samples[100, 1] = 3.0
    for start in range(0, len(samples), 1024):
        began = time.monotonic()
        monitor(Block("main", start, samples[start : start + 1024]))
        assert time.monotonic() - began < 0.05
        time.sleep(0.03)
    latest = time.monotonic() + 5
    while monitor.snapshot().spectra is None and time.monotonic() < latest:
        monitor(Block("main", len(samples), samples[:1024]))
        time.sleep(0.05)
    shown = monitor.snapshot()
    assert shown.tooth_passing == 200.0
    assert shown.overloads.tolist() == [0, 1]
    assert shown.frf is not None
    assert shown.known.mean() > 0.9
    assert np.median(np.abs(shown.frf.values[shown.known])) == pytest.approx(0.5, rel=0.05)
    monitor(Events("spindle_speed_rpm", np.array([1.0]), np.array([3000.0])))
    assert monitor.snapshot().tooth_passing == 100.0
    monitor.restart()
    assert monitor.snapshot().overloads.tolist() == [0, 0]


def test_samples_that_are_no_numbers_end_no_drawing(monitor: LiveMonitor) -> None:
    samples = _samples(4096)
    samples[5, 0] = np.nan
    monitor(Block("main", 0, samples))
    monitor(Block("main", 4096, _samples(8192, 1)))
    monitor.finish()
    shown = monitor.snapshot()
    assert shown.n_samples == 12288
    assert shown.frf is not None
    assert np.isfinite(shown.peaks).all()


def test_a_flood_is_recorded_but_not_all_drawn(monitor: LiveMonitor) -> None:
    samples = _samples(200_000)
    began = time.monotonic()
    for _ in range(200):
        monitor(Block("main", 0, samples))
    assert time.monotonic() - began < 1.0
    assert monitor.snapshot().n_skipped > 0


def test_buttons_count_only_where_they_make_sense() -> None:
    control = LiveControl()
    control.mark()
    assert control.poll() == []
    control.start()
    control.mark()
    control.mark(" entry of the\ncut ", shown_at=3.5)
    [marks] = control.poll()
    assert marks.values.tolist() == [1.0, 2.0]
    assert marks.texts == ("", "entry of the\ncut")
    assert [mark.label for mark in control.marks] == ["mark 1", "entry of the\ncut"]
    control.stop()
    control.start()
    assert control.state == "stopping"
    control.ended("done")
    control.stop()
    assert control.state == "ended"
