"""A prediction holds for the whole recording: forces act to its last sample, and from its first on."""

import numpy as np
import pytest
from one_mode_rig import Rig

from estimation import windowed_spectrum
from millfrf.mismatch import predict


@pytest.mark.parametrize("response", ["acceleration", "displacement"])
def test_a_prediction_goes_to_the_last_sample(response: str) -> None:
    """The rig's own Runge-Kutta is the judge; what moved before the piece begins rings for less than two seconds."""
    rig = Rig(response=response, rate=256.0, damping=0.05)
    middle = rig.recordings((40.0,), 20.0)[0].part("middle", 1024, 4096)
    assert not middle.at_rest
    left = middle.response - predict(rig.model, middle).response
    size = np.std(middle.response)
    assert np.std(left[512:]) < 0.03 * size
    for last in (256, 64, 16):
        assert np.std(left[-last:]) < 0.03 * size, last
    # nothing is faded in: what is off at the beginning is what moved before, and dies out
    assert np.std(left[128:256]) < 0.2 * size


def test_whole_forces_are_those_of_the_recording() -> None:
    rig = Rig(rate=256.0)
    single = rig.recordings((40.0,), 8.0)[0].part("middle", 512, 1536)
    lines = windowed_spectrum(single, (4.0, 22.0), 1.9)
    faded, whole = (spectrum.signal(spectrum.force_lines) for spectrum in (lines, lines.with_whole_forces()))
    np.testing.assert_allclose(whole, single.force, atol=1e-9)
    assert np.abs(faded[-8:]).max() < 0.1 * np.abs(single.force[-8:]).max()
