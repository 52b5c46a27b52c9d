"""A hum of drifting frequency is no noise of one smooth colour; smooth noise, and noise of a resonance, are."""

from dataclasses import replace

import numpy as np
import pytest
import scipy
from one_mode_rig import Rig

from estimation import BandRecording
from millfrf.mismatch import diagnose

LEVELS = (20.0, 40.0, 60.0)


def with_drifting_hum(recording: BandRecording) -> BandRecording:
    """A tone around 17 Hz, outside the resonance, whose frequency wanders by 1 Hz and back in ten seconds."""
    time = np.arange(len(recording.response)) / recording.rate
    phase = 2 * np.pi * 17 * time + 5 * np.sin(2 * np.pi * 0.1 * time)
    size = 0.1 * recording.response.std()
    return replace(recording, response=recording.response + size * np.sin(phase)[:, None])


def with_red_noise(recording: BandRecording) -> BandRecording:
    """Noise whose power falls with the frequency, as that of a sensor that drifts."""
    noise = np.random.default_rng(len(recording.response)).standard_normal(len(recording.response))
    red = scipy.signal.lfilter([1.0], [1.0, -0.8], noise)[:, None]
    return replace(recording, response=recording.response + 0.02 * recording.response.std() * red / red.std())


@pytest.mark.parametrize("change", [with_drifting_hum, with_red_noise])
def test_noise_with_a_narrow_hump_is_unexplained(change) -> None:
    rig = Rig()
    diagnosis = diagnose(rig.model, [change(recording) for recording in rig.recordings(LEVELS)])
    stated = [doubt for doubt in diagnosis.doubts if "times the noise around it" in doubt]
    assert (diagnosis.verdict == "none") is (change is with_red_noise)
    assert len(stated) == (change is with_drifting_hum)
