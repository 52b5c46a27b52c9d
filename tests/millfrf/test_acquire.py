"""`millfrf acquire`: the simulated cell, a replay, Ctrl-C, and the pre-flight check."""

import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition import Channel, Events, Recording, RecordingWriter, StreamDescription
from acquisition.sources.source import SAMPLES_AXIS
from millfrf.command_line import run
from millfrf.steps.recording.signal_check import preflight

SIMULATED = """
title = "rehearsal"
duration_s = {duration}
[tool]
name = "two flutes"
[device]
driver = "simulated"
speed = {speed}
"""
RATE = 25600.0


def _session(folder: Path, duration: float = 0.6, speed: float = 20.0) -> Path:
    path = folder / "session.toml"
    path.write_text(SIMULATED.format(duration=duration, speed=speed))
    return path


def test_a_session_is_recorded_with_its_set_up(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "a.h5"
    assert run(["acquire", str(_session(tmp_path)), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "6 channels at 2048 Hz" in said
    assert "longest delay" in said
    with Recording(out) as recording:
        assert recording.complete
        assert recording.stream().n_samples == round(0.6 * 2048)
    assert run(["acquire", str(_session(tmp_path)), "--out", str(out)]) == 2
    assert "exists" in capsys.readouterr().err
    replay = tmp_path / "replay.toml"
    replay.write_text('[device]\ndriver = "replay"\nfile = "a.h5"\nspeed = 50.0\n')
    assert run(["acquire", str(replay), "--out", str(tmp_path / "b.h5")]) == 0
    with Recording(out) as first, Recording(tmp_path / "b.h5") as second:
        np.testing.assert_array_equal(first.stream().read(), second.stream().read())


@pytest.mark.parametrize("duration", [0.4, 1.0])
def test_a_replay_that_stops_by_its_duration_keeps_the_events_of_its_last_block(
    tmp_path: Path, duration: float
) -> None:
    stream = StreamDescription("main", 20480.0, 0.0, (Channel("fx", "force", "N", "TCP", "+X"),))
    times = np.arange(0.0, 1.0, 0.05) + 0.001
    with RecordingWriter(tmp_path / "a.h5", [stream], event_axes={"speed": SAMPLES_AXIS}) as writer:
        writer.append("main", np.zeros((20480, 1)))
        writer.append_events(Events("speed", times, times))
    session = tmp_path / "replay.toml"
    session.write_text(f'duration_s = {duration}\n[device]\ndriver = "replay"\nfile = "a.h5"\nspeed = 50.0\n')
    assert run(["acquire", str(session), "--out", str(tmp_path / "b.h5")]) == 0
    with Recording(tmp_path / "b.h5") as kept:
        end = kept.stream().n_samples / 20480
        np.testing.assert_allclose(kept.events["speed"].read()[0], times[times < end])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [([], "either --out"), (["--out", "x.csv"], "writes .h5"), (["--out", "no/x.h5"], "does not exist")],
)
def test_wrong_options_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], words: str
) -> None:
    assert run(["acquire", str(_session(tmp_path)), *arguments]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="needs signals")
def test_ctrl_c_ends_in_order(tmp_path: Path) -> None:
    out = tmp_path / "a.h5"
    command = [sys.executable, "-m", "millfrf", "acquire", str(_session(tmp_path, 600, 1.0)), "--out", str(out)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    for _ in range(600):
        time.sleep(0.1)
        if out.exists() and out.stat().st_size > 50_000:
            break
    process.send_signal(signal.SIGINT)
    said, complained = process.communicate(timeout=30)
    assert (process.returncode, complained) == (0, "")
    assert f"wrote {out}" in said
    with Recording(out) as recording:
        assert recording.complete is True
        assert recording.stream().n_samples > 0


@pytest.mark.skipif(sys.platform == "win32", reason="needs signals")
def test_ctrl_c_while_checking_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "millfrf.steps.recording.signal_check.time.monotonic", lambda: signal.raise_signal(signal.SIGINT)
    )
    # a shell that starts the tests in the background has Ctrl-C ignored
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        assert run(["acquire", str(_session(tmp_path)), "--check"]) == 1
    finally:
        signal.signal(signal.SIGINT, before)
    assert capsys.readouterr().err == "millfrf: stopped; unfinished files were removed\n"


def test_the_check_finds_nothing_wrong_with_the_cell(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["acquire", str(_session(tmp_path)), "--check", "--seconds", "0.5"]) == 0
    assert "nothing wrong" in capsys.readouterr().out


def _judge(samples: np.ndarray, *channels: Channel) -> list[str]:
    return preflight([(StreamDescription("s", RATE, 0.0, channels), samples)]).concerns()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda noise: 0 * noise, "no signal"),
        (lambda noise: noise + 80.0, "sensor open"),
        (lambda noise: 1e-5 * noise, "shorted"),
        (lambda noise: np.clip(60 * noise, -100, 100), "overload"),
        (lambda noise: 90 * np.sin(np.arange(len(noise)) / 9) + noise, "peak only 0.6 dB below full scale"),
    ],
)
def test_each_fault_of_a_channel_is_named(make: object, words: str) -> None:
    noise = np.random.default_rng(0).standard_normal(20000)
    channel = Channel("ax", "acceleration", "m/s^2", full_scale=100.0)
    [line] = _judge(make(noise)[:, None], channel)  # type: ignore[operator]
    assert words in line
    assert _judge(noise[:, None], channel) == []


@pytest.mark.parametrize(("sign", "delay"), [(1.0, 0.0), (-1.0, 0.0), (1.0, 8.0), (1.0, -3.4)])
def test_a_tap_tells_polarity_and_delay(sign: float, delay: float) -> None:
    """A free mass: acceleration is force over mass at once; delayed by whole and by broken numbers of samples."""
    n, generator = 60000, np.random.default_rng(1)
    time = np.arange(n, dtype=float)
    starts = (10000.0, 30000.0, 50000.0)
    force = sum(200 * np.exp(-0.5 * ((time - s) / 8) ** 2) for s in starts)
    motion = sum(sign * 20 * np.exp(-0.5 * ((time - delay - s) / 8) ** 2) for s in starts)
    samples = np.stack([force, motion], axis=1) + 0.01 * generator.standard_normal((n, 2))
    channels = (
        Channel("f", "force", "N", "TCP", "+X", full_scale=1000.0),
        Channel("a", "acceleration", "m/s^2", "TCP", "+X", full_scale=100.0),
    )
    result = preflight([(StreamDescription("s", RATE, 0.0, channels), samples)])
    [tap] = result.taps
    assert tap.agrees == (sign > 0)
    assert tap.delay == pytest.approx(delay / RATE, abs=0.1 / RATE)
    concerns = " ".join(result.concerns())
    assert ("opposite senses" in concerns) == (sign < 0)
    assert ("us apart" in concerns) == (abs(delay / RATE) > 50e-6)
    late = (max(-delay, 0) / RATE, max(delay, 0) / RATE)
    stated = tuple(replace(channel, input_delay_s=known) for channel, known in zip(channels, late, strict=True))
    [known] = preflight([(StreamDescription("s", RATE, 0.0, stated), samples)]).taps
    assert known.delay == pytest.approx(0.0, abs=0.1 / RATE), "a delay that is known is no concern"
