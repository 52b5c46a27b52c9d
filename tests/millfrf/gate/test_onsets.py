"""Delays between forces and responses where forces repeat, and where blocks are short."""

import numpy as np
import pytest
import scipy

from acquisition import Channel
from millfrf.gate.onsets import check_onsets, onsets_of
from millfrf.gate.record_blocks import RecordBlocks

FORCES = tuple(Channel(f"f{axis}", "force", "N", "TCP", f"+{axis.upper()}") for axis in "xyz")
RESPONSES = tuple(Channel(f"u{axis}", "displacement", "m", "TCP", f"+{axis.upper()}") for axis in "xy")
RATE = 500.0


def blocks(n: int, delay: int = 0, period: int = 29, noise: float = 1e-4) -> RecordBlocks:
    """Six blocks of n samples: forces of teeth that pass every ``period`` samples with jitter, and two modes."""
    rng = np.random.default_rng(n + delay)
    teeth = np.hanning(period // 2)
    forces, responses = [], []
    for _ in range(6):
        at = np.arange(0, n + 400, period) + rng.integers(-1, 2, len(np.arange(0, n + 400, period)))
        comb = np.zeros(n + 500)
        comb[at + 20] = 1 + 0.05 * rng.standard_normal(len(at))
        force = np.stack([np.convolve(comb, np.roll(teeth, k) * (1 - 0.3 * k))[: n + 400] for k in range(3)], axis=1)
        force += 0.02 * rng.standard_normal(force.shape)
        answer = []
        for frequency, mix in ((18.0, [1.0, 0.4, 0.1]), (41.0, [0.2, 1.0, 0.5])):
            pole = np.exp((-0.05 + 1j) * 2 * np.pi * frequency / RATE)
            answer.append(scipy.signal.lfilter([1.0], [1.0, -2 * pole.real, abs(pole) ** 2], force @ mix))
        x = np.stack(answer, axis=1)
        x += noise * x.std(axis=0) * rng.standard_normal(x.shape)
        forces.append(force[400:] - force[400:].mean(axis=0))
        x = x[400 - delay : 400 - delay + n]
        responses.append(x - x.mean(axis=0))
    times = np.arange(6) * n / RATE
    return RecordBlocks(
        "cut.h5", RATE, times, tuple(forces), tuple(responses), np.zeros((6, 3)), FORCES, RESPONSES, "", RATE
    )


@pytest.mark.parametrize("delay", [0, 7, 90])
def test_forces_that_repeat_with_each_tooth_show_the_delay_in_every_block(delay: int) -> None:
    onsets = onsets_of(blocks(3000, delay))
    np.testing.assert_allclose(onsets.joint * RATE, delay, atol=1)
    warnings = check_onsets([onsets])
    assert bool(warnings) == (delay > 0)
    assert all("behind the forces" in text for text in warnings)


@pytest.mark.parametrize("n", [180, 240, 400])
def test_short_blocks_have_as_many_unknowns_as_they_can_determine(n: int) -> None:
    onsets = onsets_of(blocks(n))
    assert np.isfinite(onsets.p_values).all()
    assert abs(np.median(onsets.joint)) * RATE <= 1
