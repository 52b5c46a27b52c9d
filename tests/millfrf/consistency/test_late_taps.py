"""A response that is late at its drive point returns power: no passive structure does."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.lab_cell import FINE, draw_structure, record, tap_force
from millfrf.steps.tap import tap

RATE = 2048.0


def tapped(folder: Path, seed: int, samples_late: int) -> tuple[str, ...]:
    """Warnings of three taps along X with the response at the tip."""
    rng = np.random.default_rng(seed)
    single = record(draw_structure(rng), tap_force(0, 12.0, FINE * RATE, rng), RATE, rng, "", tip=True)
    single.samples, single.names, single.places = single.samples[:, [0, 6]], ["fx", "atx"], ["TCP:+X", "TCP:+X"]
    single.samples[:, 1] = np.roll(single.samples[:, 1], samples_late)
    return tap(single.write(folder / "x.h5")).warnings


@pytest.mark.filterwarnings("ignore::millfrf.core.MillfrfWarning")
@pytest.mark.parametrize("seed", range(3))
def test_a_tap_of_a_right_chain_is_not_doubted(tmp_path: Path, seed: int) -> None:
    assert tapped(tmp_path, seed, 0) == ()


@pytest.mark.filterwarnings("ignore::millfrf.core.MillfrfWarning")
@pytest.mark.parametrize(("seed", "late"), [(0, 1), (1, 2), (2, 4)])
def test_a_late_response_is_found_with_its_delay(tmp_path: Path, seed: int, late: int) -> None:
    (text,) = [text for text in tapped(tmp_path, seed, late) if "is at least" in text]
    assert text.startswith("TCP:+X is at least ")
    assert float(text.split("at least ")[1].split()[0]) == pytest.approx(1e3 * late / RATE, rel=0.1)
    assert "ms late for the force at TCP:+X" in text
