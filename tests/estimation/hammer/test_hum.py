"""Hum in tap tests: it was there before the taps, is no ringing, and asks for no window."""

from pathlib import Path

import numpy as np
import pytest
from simulated_taps import Bench, Hits, frf_of, plate, write_taps

from estimation import response_decay

DIED = (0.05, 0.04, 0.03, 0.03)  # damping with which every response dies out in a segment
RINGS = (0.002, 0.04, 0.03, 0.03)


@pytest.mark.parametrize("hum", [0.01, 0.1])
@pytest.mark.parametrize(
    ("files", "seconds"),
    [
        ([(0.15,)], 2.0),  # a single tap, soon after the recording begins
        ([(0.13,), (0.17,), (0.11,)], 2.0),  # one tap a file
        ([(0.2, 1.7, 3.2, 4.7)], 6.2),  # taps in step with the hum, which is then coherent with the force
    ],
)
def test_hum_is_no_ringing(tmp_path: Path, files: list[tuple[float, ...]], seconds: float, hum: float) -> None:
    """Before: 73 % of the response "still rings", and a window of 0.24 s."""
    for damping in (DIED, RINGS):
        structure = plate(damping=damping)
        paths = [
            write_taps(
                tmp_path / f"{damping[0]}_{k}.h5",
                structure,
                Hits(times, at="P1:+Z"),
                ("P1:+Z",),
                Bench(rate=2560.0, seconds=seconds, hum=hum, seed=k),
            )
            for k, times in enumerate(files)
        ]
        _, found, settings = frf_of(paths)
        decay = response_decay(found, settings)
        assert np.abs(np.array(decay.hum) - 50.0).min() < 1.0
        if damping is DIED:
            assert decay.left == 0.0
            assert settings.time_constant is None
        else:  # a mode that does ring is still found, beside the hum
            assert abs(decay.frequency - structure.frequencies[0]) < 1.0
            assert decay.left > 0.1


def test_without_hum_none_is_reported(tmp_path: Path) -> None:
    path = write_taps(
        tmp_path / "a.h5", plate(damping=RINGS), Hits((0.15,), at="P1:+Z"), ("P1:+Z",), Bench(rate=2560.0, seconds=2.0)
    )
    _, found, settings = frf_of([path])
    assert response_decay(found, settings).hum == ()
