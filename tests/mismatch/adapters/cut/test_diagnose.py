"""Each effect hidden in simulated closed-loop cuts is found with its numbers, and nothing is found where nothing is."""

import math
from dataclasses import replace

import numpy as np
import pytest
from independent_cut import Mill, simulated

from millfrf.core import InputError
from millfrf.cutting import MillingProcess
from millfrf.mismatch import AcceptedCause, CutDiagnosis, diagnose_cut
from millfrf.mismatch.cut.motion import SpindleLaw
from millfrf.mismatch.cut.recordings import CutRecording, cut_recording
from modal_fit import ModalModel
from replay_data import (
    LinearSweep,
    MillingCell,
    SpeedProfile,
    default_structure,
    dynamometer,
    tip_accelerometers,
    tip_model,
)

CUT = MillingProcess(2, 12.7e-3, math.pi / 2, 119e6, 0.17, 0.33, math.pi / 2, math.pi, 0.15e-3)
DEPTH, SPEED = 1e-3, 800 * math.pi / 30
ACCELERATIONS = ((0, 1, 2), (2, 2, 2))


def _of_cell(
    process: MillingProcess,
    *,
    noise: float = 0.01,
    seed: int = 0,
    speed: float | SpeedProfile = SPEED,
    seconds: float = 6.5,
    structure: ModalModel | None = None,
    model: ModalModel | None = None,
) -> CutRecording:
    """A cut of the simulated cell, seen by someone who believes in CUT and knows the speed to 0.3 %."""
    sensors = dynamometer(noise) + tip_accelerometers(noise)
    cell = MillingCell(
        structure or tip_model(default_structure()), process, DEPTH, speed, seconds, seed=seed, sensors=sensors
    )
    samples = cell.samples()
    if isinstance(speed, LinearSweep):
        stated = SpindleLaw(0.0, 0.0, speed.first, (speed.last - speed.first) / speed.duration)
    else:
        assert isinstance(speed, float)
        stated = SpindleLaw(0.0, 0.0, 1.003 * speed)
    motion = None if model is not None else (samples[:, 3:], *ACCELERATIONS)
    return cut_recording(f"cell{seed}", cell.sample_rate, samples[:, :3], (0, 1, 2), CUT, stated, motion=motion,
                         model=model)  # fmt: skip


def _of_mill(mill: Mill, *, noise: float = 0.01, seed: int = 0, seconds: float = 6.5, skip: float = 0.0,
             believed: MillingProcess = CUT) -> CutRecording:  # fmt: skip
    """A cut of the independent simulator, the first ``skip`` seconds cut off."""
    force, acceleration, rate = simulated(mill, seconds + skip, noise, seed)
    first = round(skip * rate)
    stated = SpindleLaw(0.0, 0.0, 0.998 * mill.rpm * math.pi / 30)
    motion = (acceleration[first:], *ACCELERATIONS)
    return cut_recording(f"mill{seed}", rate, force[first:], (0, 1, 2), believed, stated, motion=motion)


def _named(found: CutDiagnosis) -> dict[str, AcceptedCause]:
    return {cause.name: cause for cause in found.physics}


def _holds(cause: AcceptedCause, name: str, truth: float, errors: float = 3.0) -> None:
    assert abs(cause.parameters[name] - truth) < errors * cause.standard_errors[name], (name, cause)


@pytest.mark.long
@pytest.mark.parametrize("noise", [0.01, 0.03])
def test_runout_and_feedback_of_the_simulated_cell(noise: float) -> None:
    diagnosis = diagnose_cut(CUT, DEPTH, [_of_cell(replace(CUT, runout=15e-6), noise=noise)])
    named = _named(diagnosis)
    assert diagnosis.verdict == "explained"
    assert set(named) == {"runout", "regenerative_feedback"}
    _holds(named["runout"], "radial_offset_m", 15e-6)
    _holds(named["regenerative_feedback"], "share", 1.0, 3.5)
    assert diagnosis.improvement.before > 0.25
    assert diagnosis.improvement.after < 1.4 * diagnosis.improvement.noise_floor
    assert diagnosis.improvement.p_value < 1e-3
    assert diagnosis.located["spindle_orders"][0] == 1
    assert diagnosis.details.improved_process().runout == pytest.approx(15e-6, rel=0.02)


@pytest.mark.long
def test_process_damping_runout_and_feedback_of_another_simulator() -> None:
    mill = Mill(damping=2e5, offsets=(15e-6, -15e-6))
    diagnosis = diagnose_cut(CUT, DEPTH, [_of_mill(mill)])
    named = _named(diagnosis)
    assert set(named) == {"runout", "regenerative_feedback", "process_damping"}
    _holds(named["runout"], "radial_offset_m", 15e-6)
    _holds(named["regenerative_feedback"], "share", 1.0)
    _holds(named["process_damping"], "coefficient_n_per_m", 2e5)
    assert diagnosis.details.improved_process().process_damping == pytest.approx(2e5, rel=0.06)


@pytest.mark.long
def test_process_damping_alone_is_not_taken_for_feedback() -> None:
    diagnosis = diagnose_cut(CUT, DEPTH, [_of_mill(Mill(damping=1.5e5, feedback=0.0), noise=0.02, seed=4)])
    named = _named(diagnosis)
    assert set(named) == {"process_damping"}
    _holds(named["process_damping"], "coefficient_n_per_m", 1.5e5)


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2])
def test_nothing_concealed_nothing_named(seed: int) -> None:
    """A rigid structure moves too little for feedback, one without feedback moves in vain."""
    stiff = tip_model(default_structure())
    rigid = replace(stiff, right=1e-6 * stiff.right)
    for recording in (
        _of_cell(CUT, structure=rigid, seed=seed, noise=0.02),
        _of_mill(Mill(feedback=0.0), seed=seed, noise=0.02),
    ):
        diagnosis = diagnose_cut(CUT, DEPTH, [recording])
        assert (diagnosis.verdict, diagnosis.physics) == ("none", ())
        assert diagnosis.leftover < 0.06


@pytest.mark.long
def test_coefficients_within_a_labs_error_are_refitted_and_not_blamed() -> None:
    true = Mill(feedback=0.0, ktc=1.12 * 119e6, krc=0.2)
    diagnosis = diagnose_cut(CUT, DEPTH, [_of_mill(true)])
    assert diagnosis.verdict == "none"
    improved = diagnosis.details.improved_process()
    assert improved.ktc == pytest.approx(true.ktc, rel=0.01)
    assert improved.krc == pytest.approx(true.krc, abs=0.004)
    assert diagnosis.improvement.before > 0.1
    assert diagnosis.improvement.refitted < 1.4 * diagnosis.improvement.noise_floor


@pytest.mark.long
def test_coefficients_far_off_are_named() -> None:
    diagnosis = diagnose_cut(CUT, DEPTH, [_of_mill(Mill(feedback=0.0, ktc=2 * 119e6), seed=2)])
    named = _named(diagnosis)
    assert set(named) == {"force_coefficients"}
    assert named["force_coefficients"].location == {"coefficients": ["ktc_pa"]}
    assert named["force_coefficients"].parameters["ktc_pa"] == pytest.approx(2 * 119e6, rel=0.01)


@pytest.mark.long
def test_a_wrong_engagement_is_in_no_library_and_left_unexplained() -> None:
    diagnosis = diagnose_cut(CUT, DEPTH, [_of_mill(Mill(feedback=0.0, start=math.radians(75)))])
    assert (diagnosis.verdict, diagnosis.physics) == ("unexplained", ())
    assert diagnosis.leftover > 0.5
    assert diagnosis.details.improved_process().runout == 0


@pytest.mark.long
def test_feedback_that_one_block_alone_shows_is_not_named() -> None:
    """Without runout a cut regenerates only while its entry dies out: nothing confirms it, and something is left."""
    diagnosis = diagnose_cut(CUT, DEPTH, [_of_mill(Mill())])
    assert (diagnosis.verdict, diagnosis.physics) == ("unexplained", ())
    assert diagnosis.candidates[0].name == "regenerative_feedback"
    assert diagnosis.candidates[0].stage.startswith("fitted, but not confirmed")


@pytest.mark.slow
def test_recordings_that_number_the_teeth_differently_agree() -> None:
    """The second begins half a turn later: its tooth 0 is the other one."""
    mill = Mill(offsets=(12e-6, -12e-6))
    half = 30 / mill.rpm
    recordings = [_of_mill(mill, seed=1), _of_mill(replace(mill, rpm=870.0), seed=2, skip=half)]
    diagnosis = diagnose_cut(CUT, DEPTH, recordings)
    named = _named(diagnosis)
    assert {"runout", "regenerative_feedback"} <= set(named)
    _holds(named["runout"], "radial_offset_m", 12e-6)


@pytest.mark.long
def test_runout_of_three_teeth_has_an_angle() -> None:
    believed = replace(CUT, teeth=3, start_angle=math.radians(120))
    offsets = tuple(12e-6 * np.cos(2 * np.pi * np.arange(3) / 3 - 0.5))
    mill = Mill(teeth=3, start=math.radians(120), offsets=offsets, feedback=0.0)
    diagnosis = diagnose_cut(believed, DEPTH, [_of_mill(mill, believed=believed)])
    named = _named(diagnosis)
    assert set(named) == {"runout"}
    _holds(named["runout"], "radial_offset_m", 12e-6)
    assert named["runout"].parameters["angle_rad"] == pytest.approx(0.5, abs=0.02)


@pytest.mark.long
def test_a_swept_speed_is_followed() -> None:
    sweep = LinearSweep(760 * math.pi / 30, 900 * math.pi / 30, 6.5)
    diagnosis = diagnose_cut(CUT, DEPTH, [_of_cell(replace(CUT, runout=10e-6), speed=sweep)])
    named = _named(diagnosis)
    assert set(named) == {"runout", "regenerative_feedback"}
    _holds(named["runout"], "radial_offset_m", 10e-6)
    _holds(named["regenerative_feedback"], "share", 1.0)


@pytest.mark.long
def test_a_model_moves_the_tip_where_no_sensor_was() -> None:
    truth = replace(CUT, runout=10e-6)
    diagnosis = diagnose_cut(CUT, DEPTH, [_of_cell(truth, model=default_structure(), seconds=10.0)])
    named = _named(diagnosis)
    assert set(named) == {"runout", "regenerative_feedback"}
    _holds(named["regenerative_feedback"], "share", 1.0)


def test_what_cannot_be_weighed_is_said() -> None:
    single = replace(CUT, teeth=1)
    force, _, rate = simulated(Mill(teeth=1, offsets=(0.0,), feedback=0.0), 6.5, 0.01, 0)
    recording = cut_recording("one", rate, force, (0, 1, 2), single, SpindleLaw(0.0, 0.0, SPEED))
    diagnosis = diagnose_cut(single, DEPTH, [recording])
    assert diagnosis.verdict == "none"
    stages = {candidate.name: candidate.stage for candidate in diagnosis.candidates}
    assert stages["runout"] == "not weighed: one tooth alone shows none"
    assert stages["process_damping"] == "not weighed: no motion at the tip is known"


@pytest.mark.parametrize(
    ("depth", "wrong", "message"),
    [
        (0.0, {}, "depth = 0.0 m must be positive"),
        (math.nan, {}, "depth = nan m must be positive"),
        (DEPTH, {"coefficient_error": 2.0}, "coefficients off by 2.0"),
        (DEPTH, {"force_error": -0.1}, "force error -0.1"),
    ],
)
def test_numbers_that_cannot_be(depth: float, wrong: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        diagnose_cut(CUT, depth, [_of_mill(Mill(feedback=0.0))], **wrong)


def test_recordings_that_cannot_be_used() -> None:
    force, _, rate = simulated(Mill(feedback=0.0), 6.5, 0.01, 0)
    with pytest.raises(InputError, match="holds 13 revolutions; 80 are the least"):
        cut_recording("short", rate, force[: round(rate)], (0, 1, 2), CUT, SpindleLaw(0.0, 0.0, SPEED))
    with pytest.raises(InputError, match="no recording given"):
        diagnose_cut(CUT, DEPTH, [])


@pytest.mark.slow
def test_no_false_alarm_over_many_seeds() -> None:
    verdicts = [
        diagnose_cut(CUT, DEPTH, [_of_mill(Mill(feedback=0.0), seed=seed, noise=0.01 + 0.002 * seed)]).verdict
        for seed in range(20)
    ]
    assert verdicts == ["none"] * 20


@pytest.mark.slow
def test_standard_errors_cover_the_truth() -> None:
    """With 3 % noise and next to no error of the model 95 % intervals hold the truth in at least 85 %."""
    scores = []
    for seed in range(20):
        mill = Mill(damping=2e5, offsets=(10e-6, -10e-6))
        diagnosis = diagnose_cut(CUT, DEPTH, [_of_mill(mill, seed=seed, noise=0.03)], force_error=0.003)
        named = _named(diagnosis)
        for name, key, truth in (
            ("runout", "radial_offset_m", 10e-6),
            ("regenerative_feedback", "share", 1.0),
            ("process_damping", "coefficient_n_per_m", 2e5),
        ):
            cause = named[name]
            scores.append((cause.parameters[key] - truth) / cause.standard_errors[key])
    table = np.abs(np.array(scores).reshape(20, 3))
    assert np.mean(table < 1.96) >= 0.85
    assert table.max() < 5
