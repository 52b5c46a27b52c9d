"""What `inspect` says of recordings that went wrong."""

import re
from pathlib import Path

import numpy as np
import pytest

from acquisition import Channel, RecordingWriter, StreamDescription
from millfrf.command_line import run

RATE = 5120.0
CHANNELS = (
    Channel("fx", "force", "N", "TCP", "+X", full_scale=2000.0),
    Channel("ax", "acceleration", "m/s^2", "TCP", "+X", full_scale=50.0),
)


def hammer(path: Path, second: float) -> str:
    """Two taps; the second hits again 3 ms later with a share ``second`` of its force."""
    time = np.arange(int(4 * RATE)) / RATE
    force = np.random.default_rng(0).standard_normal(len(time))
    for at, peak in ((0.5, 400.0), (2.5, 300.0), (2.503, 300.0 * second)):
        force += peak * np.exp(-0.5 * ((time - at) / 3e-4) ** 2)
    motion = np.random.default_rng(1).standard_normal(len(time))
    with RecordingWriter(path, (StreamDescription("main", RATE, 0.0, CHANNELS),)) as writer:
        writer.append("main", np.column_stack([force, motion]))
    return str(path)


def test_a_double_hit_is_said_with_its_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["inspect", hammer(tmp_path / "twice.h5", 0.2)]) == 0
    said = capsys.readouterr().out
    assert "1 of 2 taps hit twice (at 2.500 s" in said
    assert "ms with 20 %" in said
    assert run(["inspect", hammer(tmp_path / "once.h5", 0.0)]) == 0
    assert "nothing looks wrong" in capsys.readouterr().out


def test_a_cut_is_not_taken_for_taps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    time = np.arange(int(4 * RATE)) / RATE
    force = 80 * np.maximum(np.sin(2 * np.pi * 20 * time), 0) ** 2
    with RecordingWriter(tmp_path / "cut.h5", (StreamDescription("main", RATE, 0.0, CHANNELS),)) as writer:
        writer.append("main", np.column_stack([force, np.sin(time)]))
    assert run(["inspect", str(tmp_path / "cut.h5")]) == 0
    assert "hit twice" not in capsys.readouterr().out


def test_dead_and_overloaded_channels_are_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    samples = np.column_stack([np.full(1000, 1.0), 60 * np.sin(np.arange(1000))])
    with RecordingWriter(tmp_path / "bad.h5", (StreamDescription("main", RATE, 0.0, CHANNELS),)) as writer:
        writer.append("main", samples)
    assert run(["inspect", str(tmp_path / "bad.h5")]) == 0
    said = capsys.readouterr().out
    assert "fx: every sample is 1 (dead channel)" in said
    assert "at full scale (overload)" in said


def periodic(path: Path, cubic: float) -> str:
    """Six periods of half a second of an odd multisine and its motion: a static spring, then a filter's noise."""
    lines = np.arange(7, 120, 4)
    spectrum = np.zeros(1281, dtype=complex)
    spectrum[lines] = np.exp(2j * np.pi * np.random.default_rng(0).random(len(lines)))
    force = np.tile(np.fft.irfft(spectrum), 6)
    force *= 100 / force.std()
    clean = force + cubic * force**3
    noise = np.random.default_rng(1).standard_normal((len(force), 2))
    with RecordingWriter(path, (StreamDescription("main", RATE, 0.0, CHANNELS),)) as writer:
        writer.append("main", np.column_stack([force + 0.1 * noise[:, 0], 0.1 * clean + 0.1 * noise[:, 1]]))
    return str(path)


def test_forces_that_repeat_tell_noise_and_distortion(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["inspect", periodic(tmp_path / "cubic.h5", 1e-6)]) == 0
    said = capsys.readouterr().out
    result = re.search(
        r"force repeats every 0.5 s; noise of one period, 14 to 238 Hz: (.*) % of ax, (.*) % of fx", said
    )
    assert result is not None
    share = np.sqrt((238 - 14) / (RATE / 2))  # of the noise's variance that lies in the band
    assert float(result[1]) == pytest.approx(100 * 0.1 * share / 10.3, rel=0.1)
    assert float(result[2]) == pytest.approx(100 * 0.1 * share / 100.0, rel=0.1)
    assert "Differences between 6 steady periods of 0.5 s." in said
    assert "distortion at odd lines in the band: -" in said
    assert "even lines" not in said
    assert run(["inspect", periodic(tmp_path / "linear.h5", 0.0)]) == 0
    said = capsys.readouterr().out
    assert "no distortion beyond noise at lines that were not excited" in said
    assert "nothing looks wrong" in said


def test_forces_that_do_not_repeat_say_nothing_of_periods(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    samples = np.random.default_rng(0).standard_normal((8000, 2))
    with RecordingWriter(tmp_path / "random.h5", (StreamDescription("main", RATE, 0.0, CHANNELS),)) as writer:
        writer.append("main", samples)
    assert run(["inspect", str(tmp_path / "random.h5")]) == 0
    assert "repeat" not in capsys.readouterr().out


def test_a_dead_response_beside_forces_that_repeat_is_no_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    force = np.tile(np.random.default_rng(0).standard_normal(1000), 5)
    with RecordingWriter(tmp_path / "dead.h5", (StreamDescription("main", RATE, 0.0, CHANNELS),)) as writer:
        writer.append("main", np.column_stack([force, np.full(len(force), 2.0)]))
    assert run(["inspect", str(tmp_path / "dead.h5")]) == 0
    said = capsys.readouterr().out
    assert "the force repeats every 0.195312 s" in said
    assert "dead channel" in said
