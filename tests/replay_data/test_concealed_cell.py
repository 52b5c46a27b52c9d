"""Concealed effects: a fair draw, each changes the recording, none is named in it."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import csd
from scipy.stats import chisquare

from acquisition import Recording, record
from replay_data import (
    FINE_RATE,
    LEVELS,
    ConcealedCell,
    ConcealedEffect,
    draw_effect,
    draw_name,
    joint_scale,
    milling_force,
    posture_robot,
    tip_motion,
)
from replay_data.concealment import CHANNELS, EFFECTS, in_converter, through_chain
from replay_data.settings import SETTINGS

RATE = SETTINGS.recording_rate
SECONDS = 8.0
ROBOT = posture_robot(np.random.default_rng(2))
FORCE = milling_force(ROBOT, "mid", SECONDS, seed=3)
NOTHING = ConcealedEffect("none", None, {})


def drawn(name: str, seed: int = 5) -> ConcealedEffect:
    direction = np.array([0.6, -0.48, 0.64])
    scale = joint_scale(ROBOT, tip_motion(ROBOT, FORCE, 1 / FINE_RATE), direction, SECONDS)
    return draw_effect(name, np.random.default_rng(seed), scale)


def test_every_effect_is_equally_likely() -> None:
    generator = np.random.default_rng(7)
    counts = Counter(draw_name(generator) for _ in range(3600))
    assert set(counts) == set(EFFECTS)
    assert chisquare(list(counts.values())).pvalue > 0.01


@pytest.mark.long
@pytest.mark.parametrize("name", [name for name in EFFECTS if name != "none"])
def test_every_effect_changes_the_recording_by_more_than_noise(name: str) -> None:
    plain = ConcealedCell(ROBOT, FORCE, NOTHING, 0.01, 1).clean()
    effect = drawn(name)
    shown = in_converter(effect, ConcealedCell(ROBOT, FORCE, effect, 0.01, 1).clean())
    change = np.sqrt(np.mean((shown - plain) ** 2, axis=0)) / plain.std(axis=0)
    assert 0.015 < change.max() < 5.0


def test_noise_is_the_stated_share_and_half_on_forces() -> None:
    cell = ConcealedCell(ROBOT, FORCE, NOTHING, 0.02, 1)
    share = (cell.samples() - cell.clean()).std(axis=0) / cell.clean().std(axis=0)
    np.testing.assert_allclose(share, [0.01] * 3 + [0.02] * 3, rtol=0.06)


def test_forces_and_accelerations_are_those_of_the_linear_robot_without_an_effect() -> None:
    samples = ConcealedCell(ROBOT, FORCE, NOTHING, 0.01, 1).clean()
    n, padded = len(samples), 4 * len(samples)
    f = np.fft.rfftfreq(padded, 1 / RATE)
    force = np.fft.rfft(samples[:, :3], padded, axis=0)
    accelerance = -((2 * np.pi * f) ** 2)[:, None, None] * ROBOT.receptance(f)
    predicted = np.fft.irfft(np.einsum("kpq,kq->kp", accelerance, force), padded, axis=0)
    inside = slice(n // 16, -n // 16)
    error = np.linalg.norm((predicted[:n] - samples[:, 3:])[inside]) / np.linalg.norm(samples[inside, 3:])
    assert error < 0.01


def test_chain_faults_do_what_they_say() -> None:
    times = np.arange(8192) / FINE_RATE
    tone = np.repeat(np.sin(2 * np.pi * 20 * times)[:, None], 6, axis=1)
    late = through_chain(ConcealedEffect("channel_delay", None, {"delay_s": 4e-3}), tone, FINE_RATE)
    np.testing.assert_allclose(late[1000:, 3], np.sin(2 * np.pi * 20 * (times[1000:] - 4e-3)), atol=2e-3)
    np.testing.assert_array_equal(late[:, :3], tone[:, :3])
    high = through_chain(ConcealedEffect("ac_coupling", None, {"corner_hz": 20.0}), tone, FINE_RATE)
    f, cross = csd(tone[:, 3], high[:, 4], FINE_RATE, nperseg=4096)
    _, own = csd(tone[:, 3], tone[:, 3], FINE_RATE, nperseg=4096)
    assert (cross / own)[np.argmin(np.abs(f - 20))] == pytest.approx(0.5 + 0.5j, abs=0.02)
    askew = through_chain(ConcealedEffect("axis_misalignment", None, {"rotation_deg": [0, 0, 90.0]}), tone, FINE_RATE)
    np.testing.assert_allclose(askew[:, 0], -tone[:, 1], atol=1e-12)
    loud = through_chain(ConcealedEffect("gain_error", None, {"channel": "ay", "gain": 1.3}), tone, FINE_RATE)
    np.testing.assert_allclose(loud[:, CHANNELS.index("ay")], 1.3 * tone[:, 4])
    short = in_converter(ConcealedEffect("clipping", None, {"channel": "az", "limit_m_per_s2": 0.5}), tone)
    assert np.abs(short).max(axis=0).tolist() == pytest.approx([1, 1, 1, 1, 1, 0.5], abs=1e-6)


def test_recording_repeats_by_seed_and_does_not_name_the_effect(tmp_path: Path) -> None:
    for name in ("first", "second"):
        record(ConcealedCell(ROBOT, FORCE, drawn("ac_coupling"), 0.01, 1), tmp_path / f"{name}.h5")
    assert (tmp_path / "first.h5").stat().st_size == (tmp_path / "second.h5").stat().st_size
    with Recording(tmp_path / "first.h5") as first, Recording(tmp_path / "second.h5") as second:
        streams = first.stream(), second.stream()
        np.testing.assert_array_equal(streams[0].read(), streams[1].read())
        assert [channel.high_pass_hz for channel in streams[0].channels] == [None] * 6
        assert streams[0].sample_rate == RATE
    raw = (tmp_path / "first.h5").read_bytes()
    assert not [name for name in EFFECTS if name != "none" and name.encode() in raw]


def test_levels_differ_in_force() -> None:
    sizes = [float(milling_force(ROBOT, level, 2.0, seed=3).std()) for level in LEVELS]
    assert sizes[0] < 0.7 * sizes[1] < 0.5 * sizes[2]
