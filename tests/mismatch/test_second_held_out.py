"""Where the middle level can confirm nothing, another recording is held out; where it speaks against, none is."""

from dataclasses import replace

import pytest
from one_mode_rig import Rig

from estimation import BandRecording
from millfrf.mismatch import diagnose

LEVELS = (20.0, 40.0, 56.0)


def _recordings(rigs: tuple[Rig, Rig, Rig], noises: tuple[float, float, float]) -> list[BandRecording]:
    """One recording a level, each of a rig and with a noise of its own."""
    made = []
    for k, (rig, level, noise) in enumerate(zip(rigs, LEVELS, noises, strict=True)):
        made.append(rig.recording(f"level_{k + 1}", rig.forces(level, 40.0, k), noise, k))
    return made


@pytest.mark.long
def test_a_middle_recording_full_of_noise_does_not_throw_a_law_out() -> None:
    """It holds five times more noise than motion, and its blocks tell no difference (p = 0.17)."""
    hardening = Rig().stiffened(0.04, LEVELS[-1])
    diagnosis = diagnose(Rig().model, _recordings((hardening,) * 3, (0.02, 5.0, 0.02)))
    assert [cause.name for cause in diagnosis.physics] == ["stiffness_hardening"]
    assert diagnosis.improvement.held_out == "level_3"
    assert diagnosis.improvement.after < 0.1 * diagnosis.improvement.refitted


@pytest.mark.long
def test_a_law_that_the_noise_of_the_middle_recording_hides_is_not_none() -> None:
    """Its gain of 300 is not overwhelming, and held-out data confirm nothing: something is there, but what is open."""
    hardening = Rig().stiffened(0.0008, LEVELS[-1])
    diagnosis = diagnose(Rig().model, _recordings((hardening,) * 3, (0.02, 5.0, 0.02)))
    assert diagnosis.verdict == "unexplained"
    assert not diagnosis.physics
    assert max(each.evidence for each in diagnosis.candidates if each.stage == "not confirmed") > 100


@pytest.mark.long
def test_stiffness_that_falls_between_recordings_is_no_law_of_one() -> None:
    """Each is linear, and the weakest is the stiffest: hysteresis gains 1300, and the middle one speaks against it."""
    rigs = (replace(Rig(), frequency=10.1), Rig(), replace(Rig(), frequency=9.9))
    diagnosis = diagnose(Rig().model, _recordings(rigs, (0.03, 0.03, 0.03)))
    assert not diagnosis.physics
    assert diagnosis.improvement.held_out == "level_2"
