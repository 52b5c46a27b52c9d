"""Forces against the cut that their recording states: signs, axes, units, coupling, teeth, rate."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy

from acquisition import all_opened
from benchmarks.lab_cell import Record, draw_structure, sweeps
from millfrf.gate import check_consistency

RATE = 512.0
Written = Callable[[dict[str, Record]], list[Path]]


def coupled(samples: np.ndarray) -> None:
    high_pass = scipy.signal.butter(1, 5.0, "high", fs=RATE, output="sos")
    samples[:, :3] = scipy.signal.sosfilt(high_pass, samples[:, :3], axis=0)


def reversed_forces(samples: np.ndarray) -> None:
    samples[:, :3] *= -1


def exchanged_axes(samples: np.ndarray) -> None:
    samples[:, [0, 1]] = samples[:, [1, 0]]


def kilonewtons(samples: np.ndarray) -> None:
    samples[:, :3] /= 1000


def slow_clock(samples: np.ndarray) -> None:
    at = np.arange(len(samples))
    samples[:] = scipy.interpolate.CubicSpline(at, samples)(0.95 * at)


MISTAKES = {
    "have no mean: an AC coupling": coupled,
    "taken as -fx, -fy, -fz": reversed_forces,
    "taken as fy, fx, fz": exchanged_axes,
    "mean forces are 0.001 times": kilonewtons,
    "teeth pass at 0.9": slow_clock,
}


@pytest.mark.parametrize("says", MISTAKES)
def test_a_mistake_in_all_recordings(written: Written, says: str) -> None:
    rng = np.random.default_rng(7)
    records = sweeps(draw_structure(rng), rng)
    for record in records.values():
        MISTAKES[says](record.samples)
    with all_opened(written(records)) as recordings:
        (text,) = check_consistency(recordings)
    assert says in text


@pytest.mark.parametrize(("teeth", "says"), [(1, "teeth pass at 2 times"), (60, "the tooth passing is aliased")])
def test_a_wrong_number_of_teeth(written: Written, teeth: int, says: str) -> None:
    rng = np.random.default_rng(8)
    records = sweeps(draw_structure(rng), rng)
    for record in records.values():
        record.setup = record.setup.replace("teeth = 2", f"teeth = {teeth}")
    with all_opened(written(records)) as recordings:
        assert any(says in text for text in check_consistency(recordings))
