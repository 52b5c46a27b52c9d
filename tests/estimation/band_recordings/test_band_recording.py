"""A recording read for a band against the samples that were written, and its parts in time."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from acquisition import Channel, Recording, RecordingWriter, StreamDescription
from estimation import BandRecording, MatchedChannel, band_of_channels, band_recording, channels_of
from millfrf.core import InputError

RATE = 2000.0
CHANNELS = (*channels_of("force", ["TCP:+X"], ["fx"]), *channels_of("acceleration", ["TCP:+X"], ["ax"]))


def written(path: Path, samples: np.ndarray, channels: tuple[Channel, ...] = CHANNELS) -> Path:
    with RecordingWriter(path, [StreamDescription("main", RATE, 0.0, channels)], dtype="float64") as writer:
        writer.append("main", samples)
    return path


def sines(times: np.ndarray) -> np.ndarray:
    return np.column_stack([np.sin(2 * np.pi * 7.0 * times), np.cos(2 * np.pi * 31.0 * times)])


def test_samples_lie_at_the_times_that_it_states(tmp_path: Path) -> None:
    """Brought down, and one channel late by 1.7 samples: both columns are what they were at ``start + i / rate``."""
    delay = 1.7 / RATE
    times = np.arange(20_000) / RATE
    late = np.column_stack([sines(times)[:, 0], sines(times - delay)[:, 1]])
    path = written(tmp_path / "a.h5", late, (CHANNELS[0], replace(CHANNELS[1], input_delay_s=delay)))
    with Recording(path) as recording:
        stream = recording.stream()
        read = band_recording(stream, [MatchedChannel(CHANNELS[0])], [MatchedChannel(CHANNELS[1])], Fraction(3, 20))
    assert read.rate == 300.0
    assert read.start > 31 / RATE
    expected = sines(read.start + np.arange(len(read.force)) / read.rate)
    np.testing.assert_allclose(np.hstack([read.force, read.response]), expected, atol=5e-4)
    assert read.responses[0].input_delay_s is None


def test_channels_and_their_high_passes_stay_as_they_are(tmp_path: Path) -> None:
    channels = (replace(CHANNELS[0], high_pass_hz=0.3), CHANNELS[1])
    path = written(tmp_path / "a.h5", sines(np.arange(20_000) / RATE), channels)
    with Recording(path) as recording:
        stream = recording.stream()
        read = band_of_channels(stream, stream.channels[:1], stream.channels[1:], 40.0)
    assert (read.excitations, read.responses) == (channels[:1], channels[1:])
    assert read.usable_band == pytest.approx(40.0)
    assert np.sqrt(2) * read.force.std() == pytest.approx(1.0, rel=0.01)


def test_too_short_for_the_filter(tmp_path: Path) -> None:
    path = written(tmp_path / "a.h5", sines(np.arange(100) / RATE))
    with Recording(path) as recording:
        stream = recording.stream()
        with pytest.raises(InputError, match=r"0.05 s are too short for a band up to 40 Hz; record longer"):
            band_of_channels(stream, stream.channels[:1], stream.channels[1:], 40.0)


def test_parts_know_when_they_begin() -> None:
    samples = np.arange(100.0)[:, None]
    whole = BandRecording("w", 10.0, samples, 2 * samples, CHANNELS[:1], CHANNELS[1:], start=0.5)
    part = whole.part("second", 40, 100)
    assert (part.name, part.start, part.duration) == ("second", 4.5, 6.0)
    np.testing.assert_array_equal(part.response, 2 * part.force)
    assert part.force[0, 0] == 40.0


def test_level_is_the_root_mean_square_about_the_mean() -> None:
    force = 4.0 + np.array([[3.0], [-3.0]] * 50)
    assert BandRecording("w", 10.0, force, force, CHANNELS[:1], CHANNELS[1:]).level == pytest.approx(3.0)
