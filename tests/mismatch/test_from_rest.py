"""Recordings that begin at rest: hammer blows at the very beginning count, and records may be short."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from one_mode_rig import Real, Rig, written

from estimation import BandRecording, windowed_spectrum
from millfrf.core import InputError
from millfrf.mismatch import diagnose, predict, read_recording
from modal_fit import ModalModel

SECONDS = 4.0


def blow(rig: Rig, at: float, size: float, seconds: float = SECONDS) -> Real:
    """A half sine of 40 ms, whose first sample is zero where it begins with the recording."""
    time = np.arange(int(seconds * rig.rate)) / rig.rate - at
    return np.asarray(size * np.sin(np.pi * time / 0.04) * ((time >= 0) & (time < 0.04)))


def blows(rig: Rig, at: float, seconds: float = SECONDS) -> list[BandRecording]:
    return [
        rig.recording(f"blow_{k + 1}", blow(rig, at, size, seconds), seed=k) for k, size in enumerate((50, 100, 200))
    ]


@pytest.mark.parametrize("at", [0.0, 0.3])
def test_a_blow_at_the_beginning_counts(at: float) -> None:
    """Its whole answer is compared: with run-in and ramp it would be gone, and noise alone would be left."""
    rig = Rig(response="displacement", rate=256.0)
    single = blows(rig, at)[1]
    assert single.at_rest
    lines = windowed_spectrum(single, (4.0, 22.0), 1.9)
    assert lines.start == 0
    held = (
        np.sum(np.abs(lines.measured) ** 2)
        / np.sum(lines.window[:1] ** 2 * single.response**2)
        / (len(lines.window) / 2)
    )
    assert held > 0.9
    assert predict(rig.model, single).total_error < 0.03


@pytest.mark.long
@pytest.mark.parametrize("response", ["displacement", "acceleration"])
@pytest.mark.parametrize(("share", "wanted"), [(0.0, []), (0.25, ["stiffness_hardening"])])
def test_hammer_blows_at_the_beginning_are_diagnosed(share: float, wanted: list[str], response: str) -> None:
    rig = Rig(response=response, rate=256.0, damping=0.02)
    if share:
        x = rig.motion(blow(rig, 0.0, 200.0))[0]
        rig = replace(rig, cubic=share * rig.stiffness / np.max(x**2))
    diagnosis = diagnose(rig.model, blows(rig, 0.0, 2.2))
    assert [cause.name for cause in diagnosis.physics] == wanted, diagnosis.verdict
    assert diagnosis.improvement.after < 0.05


def test_what_was_moving_before_is_not_at_rest() -> None:
    """A piece from the middle of a random record, a blow while the last one still rings, and a steady sine."""
    rig = Rig(response="displacement", rate=256.0)
    running = rig.recordings((40.0,), 20.0)[0].part("middle", 1000, 3000)
    assert not running.at_rest
    second = rig.recording("two", blow(rig, 0.1, 100.0) + blow(rig, 0.6, 20.0)).part("late", 140, 1000)
    assert not second.at_rest
    time = np.arange(2000)[:, None] / 256.0
    assert not replace(running, force=np.sin(60 * time), response=np.sin(60 * time - 1)).at_rest
    # a run-in is left out, unless the modes ring on after it: then their motion at the first sample is estimated
    assert windowed_spectrum(running, (4.0, 22.0), 5.0, first_motion=True).start > 0
    ringing = windowed_spectrum(running, (4.0, 22.0), 1.9, first_motion=True)
    assert ringing.start == 0
    assert ringing.rings(rig.model.poles).all()


def test_a_blow_on_a_moving_structure_is_predicted_with_its_first_motion() -> None:
    rig = Rig(response="displacement", rate=256.0)
    moving = rig.recording("moving", blow(rig, 0.1, 100.0) + blow(rig, 0.5, 50.0)).part("late", 120, 1000)
    diagnosis = diagnose(rig.model, [moving])
    assert diagnosis.verdict == "none"
    assert diagnosis.improvement.after < 0.03


def test_a_filter_does_not_take_the_beginning(tmp_path: Path) -> None:
    """Sampled far above the band, so that the samples are brought down; against the same rig sampled slowly."""
    rig = Rig(response="displacement", rate=2048.0)
    fast = rig.recording("blow", blow(rig, 0.0, 100.0, 4.0), noise=0.0)
    model = replace(rig.model, band=(4.0, 22.0))
    read = read_recording(written(tmp_path, fast), model)
    assert read.rate < 400
    assert read.start < 1 / 2048.0
    assert read.at_rest
    pushed = read.force.sum() / read.rate
    assert pushed == pytest.approx(fast.force.sum() / fast.rate, rel=0.01)
    assert predict(model, read).total_error < 0.01
    assert Fraction(read.rate / fast.rate).limit_denominator(200) < 1


def test_records_that_are_too_short_say_so(tmp_path: Path) -> None:
    rig = Rig(response="displacement", rate=256.0)
    shorter = rig.recording("short", blow(rig, 0.0, 100.0, 0.2))
    with pytest.raises(InputError, match=r"short lasts 0.199 s: 5 lines .*, 7 are the least .*; record 1 s or more"):
        diagnose(rig.model, [shorter])
    short = rig.recording("short", blow(rig, 0.0, 100.0, 0.6))
    diagnosis = diagnose(rig.model, [short])
    assert diagnosis.verdict == "none"
    assert any("Their damping, and what depends on it, is not determined" in doubt for doubt in diagnosis.doubts)
    # a prediction needs no line more than the blow excites
    assert predict(rig.model, read_recording(written(tmp_path, short), rig.model)).total_error < 0.05
    shortest = rig.recording("enough", blow(rig, 0.0, 100.0, 2.1))
    assert predict(rig.model, read_recording(written(tmp_path, shortest), rig.model)).total_error < 0.05


def test_a_recording_may_be_short_for_a_mode_below_the_band() -> None:
    """Of 0.6 s, five periods of the mode in the band are compared; one of the slow mode below it is not asked for."""
    rig = Rig(response="displacement", rate=256.0)
    short, model = rig.recording("short", blow(rig, 0.0, 100.0, 0.6)), rig.model
    slow = 2 * np.pi * 2.5 * (-0.2 + 1j * np.sqrt(1 - 0.2**2))
    vectors = (np.vstack([part, 1e-3 * part[:1]]) for part in (model.right, model.left))
    both = ModalModel(np.append(model.poles, slow), *vectors, model.responses, model.excitations, band=(5.0, 40.0))
    diagnose(both, [short])
    with pytest.raises(InputError, match=r"1\.5 periods of the slowest mode in the band; 3 are the least"):
        diagnose(replace(both, band=(1.0, 40.0)), [short])
