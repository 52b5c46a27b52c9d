"""Spectra by which inputs are judged: each input can have a segment of its own, and white inputs are white."""

import numpy as np
import pytest

from estimation import BandRecording, channels_of, spectra_for_judging

RATE = 100.0
FORCES = channels_of("force", ["TCP:+X", "TCP:+Y"])
MOTIONS = channels_of("acceleration", ["TCP:+X"])


def recordings(seconds: float, count: int) -> list[BandRecording]:
    rng, n = np.random.default_rng(0), round(seconds * RATE)
    return [
        BandRecording(f"test {k}", RATE, rng.normal(size=(n, 2)), rng.normal(size=(n, 1)), FORCES, MOTIONS)
        for k in range(count)
    ]


@pytest.mark.parametrize(
    ("seconds", "count", "segment"), [(200.0, 1, 8.0), (12.0, 1, 3.0), (4.0, 3, 3.0), (0.1, 1, 0.08)]
)
def test_length_of_a_segment(seconds: float, count: int, segment: float) -> None:
    """8 s at most, a quarter of one recording of two inputs, never longer than the shortest, 8 samples at least."""
    result = spectra_for_judging(recordings(seconds, count))
    assert [each.settings.segment_length for each in result] == [round(segment * RATE)] * count


def test_white_inputs_have_their_density() -> None:
    """Variance 1 at 100 Hz: 0.02 N^2/Hz, one-sided; both inputs are independent."""
    spectra = spectra_for_judging(recordings(400.0, 1))[0].input_spectra[5:-5]
    assert np.real(spectra[:, 0, 0]).mean() == pytest.approx(2 / RATE, rel=0.05)
    assert abs(spectra[:, 0, 1].mean()) < 0.05 * 2 / RATE
