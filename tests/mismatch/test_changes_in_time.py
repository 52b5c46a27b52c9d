"""Gains and clocks that change during a recording of a linear rig are no noise; steady noise is no change."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from one_mode_rig import Rig

from estimation import BandRecording, windowed_spectrum
from millfrf.mismatch import Hypothesis, LabError, ModelShape, diagnose
from millfrf.mismatch.structure.changes_in_time import changes_in_time

LEVELS, BAND = (20.0, 40.0, 60.0), (2.0, 25.0)

Change = Callable[[BandRecording], BandRecording]


def with_lost_samples(recording: BandRecording) -> BandRecording:
    """Twelve milliseconds of the response are missing in the middle, and the last sample is repeated."""
    lost, middle = round(0.012 * recording.rate), len(recording.response) // 2
    kept = np.delete(recording.response, slice(middle, middle + lost), axis=0)
    return replace(recording, response=np.concatenate([kept, np.repeat(kept[-1:], lost, axis=0)]))


def with_warming_amplifier(recording: BandRecording) -> BandRecording:
    """The gain of the response rises by 6 % in the course of the recording."""
    gain = 0.97 + 0.06 * np.linspace(0, 1, len(recording.response))[:, None]
    return replace(recording, response=gain * recording.response)


def as_it_is(recording: BandRecording) -> BandRecording:
    return recording


@pytest.mark.parametrize("change", [with_lost_samples, with_warming_amplifier, as_it_is])
def test_what_changes_during_recordings_is_not_none(change: Change) -> None:
    """Lost samples are close to a clock that runs apart, which the library has; a gain that changes is not in it."""
    rig = Rig()
    diagnosis = diagnose(rig.model, [change(recording) for recording in rig.recordings(LEVELS)])
    assert (diagnosis.verdict == "none") is (change is as_it_is)
    stated = any("change during the recording" in doubt for doubt in diagnosis.doubts)
    assert stated is (change is with_warming_amplifier)


def test_a_tone_beside_a_warming_amplifier_is_still_named() -> None:
    """The change leaves the answer incomplete; what was removed from the recordings stays in it."""
    rig = Rig()
    recordings = [with_warming_amplifier(recording) for recording in rig.recordings(LEVELS)]
    time = np.arange(len(recordings[0].response))[:, None] / rig.rate
    hum = 0.3 * recordings[0].response.std() * np.sin(2 * np.pi * 17.3 * time)
    diagnosis = diagnose(rig.model, [replace(each, response=each.response + hum) for each in recordings])
    assert diagnosis.verdict == "partly explained"
    assert [cause.name for cause in diagnosis.physics] == ["unmeasured_excitation"]
    assert any("change during the recording" in doubt for doubt in diagnosis.doubts)


@pytest.mark.parametrize("change", [with_lost_samples, with_warming_amplifier, as_it_is])
def test_changes_are_measured_against_chance(change: Change) -> None:
    """The residual of the true model alone, in each recording."""
    rig = Rig()
    shape = ModelShape(rig.model, LabError())
    lines = [windowed_spectrum(change(recording), BAND, 1.0) for recording in rig.recordings(LEVELS)]
    changes = changes_in_time(Hypothesis(shape, np.zeros(shape.size)), lines, 0.05)
    assert len(changes) == (0 if change is as_it_is else len(lines))
