"""A cutting diagnosis that does not apply, or leaves too much, says so: cuts of a simulator that shares no code."""

import math
from dataclasses import replace

import numpy as np
import pytest
from independent_cut import Mill, simulated

from millfrf.cutting import MillingProcess
from millfrf.mismatch import CutDiagnosis, diagnose_cut
from millfrf.mismatch.cut.motion import SpindleLaw
from millfrf.mismatch.cut.recordings import CutRecording, chatter_of, cut_recording
from millfrf.steps.cut_diagnose import summary

CUT = MillingProcess(2, 12.7e-3, math.pi / 2, 119e6, 0.17, 0.33, math.pi / 2, math.pi, 0.15e-3)
HELIX = math.radians(30)


def recorded(mill: Mill, *, noise: float = 0.01, seed: int = 0, seconds: float = 6.5) -> CutRecording:
    """A cut of the independent simulator, believed to be CUT."""
    force, acceleration, rate = simulated(mill, seconds, noise, seed)
    stated = SpindleLaw(0.0, 0.0, 0.998 * mill.rpm * math.pi / 30)
    motion = (acceleration, (0, 1, 2), (2, 2, 2))
    return cut_recording(f"mill{seed}", rate, force, (0, 1, 2), CUT, stated, motion=motion)


def stands_together(found: CutDiagnosis) -> None:
    """What every answer keeps, whatever was cut."""
    stated = found.verdict in ("explained", "partly explained")
    assert stated == bool(found.physics)
    assert (found.verdict == "explained") <= (found.leftover <= 0.08)
    if found.details.final.freed:
        assert found.improvement.after < found.improvement.refitted
        assert found.improvement.p_value < 0.01
    else:
        assert found.improvement.after == found.improvement.refitted
    lines = "\n".join(summary(found))
    assert ("with it" in lines) == bool(found.details.final.freed)
    assert "explained: at most 8 %" in lines
    assert lines.startswith(f"verdict: {found.verdict}")


@pytest.mark.long
def test_a_chattering_helical_cut_is_recognised_and_nothing_is_told() -> None:
    """Before: ``explained`` beside ``93 % of the error still stands out``."""
    mill = Mill(depth=6e-3, helix=HELIX, offsets=(10e-6, -10e-6))
    diagnosis = diagnose_cut(CUT, mill.depth, [recorded(mill)])
    assert (diagnosis.verdict, diagnosis.physics) == ("unexplained", ())
    assert diagnosis.details.chatter[0].kind == "hopf"
    lines = summary(diagnosis)
    assert lines[1].startswith("cannot tell: the recording mill0 chatters")
    assert any("hopf, the line at" in line for line in lines)
    assert {each.stage.split(":")[0] for each in diagnosis.candidates} == {"not weighed"}
    stands_together(diagnosis)


def test_a_stable_cut_is_not_taken_for_chatter() -> None:
    for noise in (0.01, 0.1):
        for mill in (Mill(offsets=(15e-6, -15e-6)), Mill(helix=HELIX, depth=2e-3)):
            verdict = chatter_of(recorded(mill, noise=noise, seed=3), CUT)
            assert not verdict.unstable, (mill, verdict)


def test_a_swept_speed_is_not_judged_and_said_so() -> None:
    recording = recorded(Mill())
    swept = replace(recording, law=replace(recording.law, change=0.02 * recording.law.speed))
    assert chatter_of(swept, CUT).kind == "not judged"


@pytest.mark.slow
def test_a_helix_that_the_cutting_file_leaves_out_is_not_explained_away() -> None:
    """No cause stands for a helix: what is told beside it leaves little, or the verdict says that it does not."""
    for depth, offset in ((2e-3, 0.0), (3e-3, 12e-6)):
        mill = Mill(depth=depth, helix=HELIX, offsets=(offset, -offset), stiffness=(4e6, 6e6, 2e7))
        diagnosis = diagnose_cut(CUT, depth, [recorded(mill, seed=1)])
        stands_together(diagnosis)


@pytest.mark.slow
def test_intervals_hold_the_runout_of_cuts_with_a_law_that_is_in_no_library() -> None:
    """Runout, and beside it a helix or a wrong entry: 95 % intervals hold it, or the tool abstains."""
    rng, inside = np.random.default_rng(8), []
    for seed in range(10):
        offset = float(rng.uniform(6e-6, 25e-6))
        helix = float(rng.uniform(0.0, math.radians(15)))
        start = math.pi / 2 + float(rng.uniform(-0.05, 0.05))
        mill = Mill(offsets=(offset, -offset), helix=helix, start=start)
        diagnosis = diagnose_cut(CUT, mill.depth, [recorded(mill, noise=float(rng.uniform(0.01, 0.03)), seed=seed)])
        stands_together(diagnosis)
        for cause in diagnosis.physics:
            if cause.name == "runout":
                error = cause.standard_errors["radial_offset_m"]
                inside.append(abs(cause.parameters["radial_offset_m"] - offset) < 1.96 * error)
    assert np.mean(inside or [True]) >= 0.85
