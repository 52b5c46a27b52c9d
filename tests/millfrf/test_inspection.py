"""What `inspect` says of recordings that went wrong."""

from pathlib import Path

import numpy as np
import pytest

from acquisition import Channel, RecordingWriter, StreamDescription
from millfrf.__main__ import run

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
