"""Recordings that are short for the damping of their modes: first motion, slow drives, friction in a steady tone."""

from dataclasses import replace

import numpy as np
import pytest
from one_mode_rig import Rig

from estimation import BandRecording, WindowedSpectrum, windowed_spectrum
from millfrf.mismatch import Hypothesis, JointPhysics, LabError, ModelShape, Settings, fit, library, predict_lines
from millfrf.mismatch.faults.tones import harmonics_of_drive
from millfrf.mismatch.joints.joint_axis import JointAxis
from millfrf.mismatch.models.cause import Cause
from millfrf.mismatch.models.hypothesis import predicted_from
from millfrf.mismatch.models.misfit import jacobian
from millfrf.mismatch.records.bands import compared_band, compared_lines, compared_power
from millfrf.mismatch.screening.joint_laws_fitted import laws_not_along
from millfrf.mismatch.screening.short_recordings import laws_of_short_recordings
from millfrf.mismatch.structure.structured_residual import unresolved_modes

RIG = Rig(frequency=3.0, damping=0.005, mass=3.0, rate=64.0, response="displacement")
DECAY = 0.005 * 2 * np.pi * 3.0
FRICTION, DRIVE = 1.2, 0.8  # N, Hz


def compared(recording: BandRecording) -> WindowedSpectrum:
    return compared_lines(recording, compared_band(RIG.model, RIG.rate), DECAY)[0]


def nominal() -> Hypothesis:
    shape = ModelShape(RIG.model, LabError())
    return Hypothesis(shape, np.zeros(shape.size))


def cut_from_the_middle() -> BandRecording:
    """Ten of forty seconds, in which the motion before still rings: its time constant is eleven seconds."""
    return RIG.recording("middle", RIG.forces(4.0, 40.0, 3)).part("middle", int(30 * RIG.rate), int(40 * RIG.rate))


def stuck_and_slipping() -> BandRecording:
    """Steady motion of a plate on springs that a base drives by a sine, with dry friction of 1.2 N at the plate.

    Implicit Euler steps of 0.2 ms: in each, the friction stops the plate or has its full size.
    """
    steps, seconds = 80, 30.0
    h, force = 1 / (steps * RIG.rate), []
    x, v, samples, mass = 0.0, 0.0, [], RIG.mass
    viscous = 2 * RIG.damping * np.sqrt(RIG.stiffness * mass)
    for k in range(int(seconds * RIG.rate) * steps):
        push = 3.0 * np.sin(2 * np.pi * DRIVE * k * h)
        if k % steps == 0:
            samples.append(x)
            force.append(push)
        free = v + h * (push - RIG.stiffness * x) / mass
        left = max(abs(free) - h * FRICTION / mass, 0.0) * np.sign(free)
        v = left / (1 + h * viscous / mass + h * h * RIG.stiffness / mass)
        x += h * v
    whole = RIG.recording("plate", np.array(force))
    noise = 0.003 * np.std(samples) * np.random.default_rng(1).normal(size=len(samples))
    plate = replace(whole, response=(np.array(samples) + noise)[:, None])
    return plate.part("plate", int(20 * RIG.rate), int(30 * RIG.rate))


def test_the_first_motion_is_estimated() -> None:
    lines = compared(cut_from_the_middle())
    size = float(np.linalg.norm(lines.measured))
    assert np.linalg.norm(lines.measured - predicted_from(nominal(), lines).response) > 0.3 * size
    assert np.linalg.norm(lines.measured - predict_lines(nominal(), lines).response) < 0.02 * size


@pytest.mark.parametrize("damping", [0.002, 0.005, 0.02, 0.05])
def test_a_first_motion_rings_by_its_share_of_the_compared_part(damping: float) -> None:
    """The root mean square of a simulated free decay, over its first amplitude, against the error of sensors."""
    rig = replace(RIG, damping=damping)
    steady = rig.recording("steady", rig.forces(4.0, 60.0, 3)).part("steady", int(10 * RIG.rate), int(60 * RIG.rate))
    lines = windowed_spectrum(steady, (1.0, 7.5), -float(rig.model.poles.real[0]))
    time = np.arange(len(steady.force)) / RIG.rate
    decay = np.exp(rig.model.poles.real[0] * time)[lines.start : lines.start + len(lines.window)]
    assert lines.rings(rig.model.poles)[0] == (np.sqrt(np.mean(decay**2)) > 0.002)


def test_a_loud_motion_before_a_weak_drive_is_estimated() -> None:
    """A blow before the recording leaves a hundred times the motion of the drive: a trace of it is no noise."""
    rig = replace(RIG, damping=0.015)
    force = rig.forces(0.03, 60.0, 5)
    force[int(18 * rig.rate) : int(18.1 * rig.rate)] += 200.0
    lately = rig.recording("lately", force, noise=0.0).part("lately", int(20 * rig.rate), int(60 * rig.rate))
    lines = compared_lines(lately, compared_band(rig.model, rig.rate), 3 * DECAY)[0]
    assert lines.rings(rig.model.poles).all()
    shape = ModelShape(rig.model, LabError())
    left = lines.measured - predict_lines(Hypothesis(shape, np.zeros(shape.size)), lines).response
    assert np.linalg.norm(left) < 0.02 * np.linalg.norm(lines.measured)


def test_derivatives_of_a_short_recording_are_exact() -> None:
    """Against central differences, in which the first motion is estimated again; the windowed lines leak."""
    lines, hypothesis = compared(cut_from_the_middle()), nominal()
    slopes = jacobian(hypothesis, lines, predict_lines(hypothesis, lines))
    for number in range(hypothesis.size):
        aside = 0.02 * np.eye(hypothesis.size)[number]
        above, below = (predict_lines(replace(hypothesis, u=sign * aside), lines).response for sign in (1, -1))
        np.testing.assert_allclose(slopes[:, :, number], (above - below) / 0.04, atol=0.02 * np.abs(slopes).max())


def test_a_drive_below_the_modes_is_compared() -> None:
    lines = compared(stuck_and_slipping())
    assert lines.frequencies[0] < DRIVE < RIG.frequency
    assert min(compared_power(lines)) > 0.9
    asked = compared_band(RIG.model, RIG.rate)
    # random forces from a fifth of the mode on hardly move it below a third: the default band stays
    assert compared_lines(cut_from_the_middle(), asked, DECAY)[1].low == asked.low


def test_harmonics_of_a_sine_are_no_tones() -> None:
    lines, spacing = compared(stuck_and_slipping()), 0.2
    marked = lines.frequencies[harmonics_of_drive(lines) > 0]
    assert len(marked)
    orders = np.rint(marked / DRIVE)
    np.testing.assert_array_less(np.abs(marked - orders * DRIVE), 1.5 * spacing)
    assert {3.0, 5.0, 7.0} <= set(orders)
    assert not harmonics_of_drive(compared(cut_from_the_middle())).any()


def test_friction_in_a_steady_tone_has_its_size() -> None:
    """Before, the simulation began at rest and rang for the whole recording: the fit ended at a thirtieth of it."""
    lines = [compared(stuck_and_slipping())]
    current = fit(lines, nominal(), iterations=10)
    laws = [law for law in library().values() if isinstance(law, JointPhysics)]
    proposals, simulated = laws_of_short_recordings(lines, current, laws, Settings())
    best = max(proposals, key=lambda proposal: proposal.evidence)
    assert best.name == max(simulated, key=lambda candidate: candidate.evidence).name == "coulomb_friction"
    assert best.fitted.hypothesis.causes[-1].values[0] == pytest.approx(FRICTION, rel=0.1)
    force = RIG.forces(4.0, 30.0, 3)
    force[: int(5 * RIG.rate)] = 0.0
    from_rest = compared(RIG.recording("from_rest", force))
    assert laws_of_short_recordings([from_rest], current, laws, Settings()) == ([], [])


def test_two_joints_may_follow_one_law() -> None:
    law, other = library()["coulomb_friction"], library()["hysteresis"]
    assert isinstance(law, JointPhysics)
    assert isinstance(other, JointPhysics)
    first, second = JointAxis(np.array([1.0, 0.0])), JointAxis(np.array([0.1, 0.995]))
    hypothesis = nominal().with_cause(Cause(law, np.array([1.0, 0.1]), "", first))
    assert laws_not_along(hypothesis, first, [law, other]) == [other]
    assert laws_not_along(hypothesis, second, [law, other]) == [law, other]


@pytest.mark.parametrize(("seconds", "resolved"), [(10.0, False), (30.0, False), (60.0, True)])
def test_a_resonance_narrower_than_the_lines_is_named(seconds: float, resolved: bool) -> None:
    """The resonance at 3 Hz is 0.03 Hz wide; a fifth of the recording is run-in."""
    recording = RIG.recording("short", RIG.forces(4.0, seconds, 3))
    warnings = unresolved_modes(nominal(), [compared(recording)])
    assert (warnings == ()) == resolved
    assert all("the resonances at 3 Hz" in text and "record 67 s or more" in text for text in warnings)
