"""Causes near the line between naming and not naming: wide but present, hidden behind another, narrow by chance."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from concealed_recordings import RATE, Concealed, forces, late, trial
from hidden_joint import MOTION, law_of, with_law

from estimation import BandRecording
from millfrf.mismatch import LabError, ModelShape, StructureDiagnosis, diagnose, fit, library
from millfrf.mismatch.faults.tones import find_tone
from millfrf.mismatch.inference.search import Proposal
from millfrf.mismatch.inference.settings import EvidenceSettings, ScreeningSettings
from millfrf.mismatch.models.cause import Cause
from millfrf.mismatch.models.fitting import Fit
from millfrf.mismatch.physics.linear_causes import CHANNEL_COUPLING as COUPLING
from millfrf.mismatch.physics.linear_causes import CHANNEL_DELAY as DELAY
from millfrf.mismatch.physics.linear_causes import MISSING_MODE
from millfrf.mismatch.physics.protocol import JointPhysics
from millfrf.mismatch.screening.linear_causes_fitted import ScreenedMode, linear_candidates
from millfrf.mismatch.structure.acceptance import force_is_clear, is_significant
from modal_fit import ModalModel


def test_a_delay_that_modes_nearly_take_up_is_named(
    small_model: ModalModel, trial_of: Callable[[ModalModel, str, float, int], BandRecording]
) -> None:
    """Real modes follow a delay of 0.3 ms to first order: its number has a wide error, and yet it is not none."""
    levels = ("low", 20.0), ("mid", 40.0), ("high", 80.0)
    made = [trial_of(small_model, name, level, k) for k, (name, level) in enumerate(levels)]
    delayed = [replace(each, response=late(each.response, each.rate, 3e-4)) for each in made]
    diagnosis = diagnose(small_model, delayed)
    assert [cause.name for cause in diagnosis.physics] == ["channel_delay"]
    cause = diagnosis.physics[0]
    assert cause.parameters["delay_s"] == pytest.approx(3e-4, rel=0.15)
    assert cause.parameters["delay_s"] < 4 * cause.standard_errors["delay_s"]


@pytest.mark.long
def test_laws_tried_in_vain_are_tried_again_behind_a_delay(model: ModalModel) -> None:
    """Simulated with the delay unknown every law runs away, and the delay hardly lessens what moves with the signal."""
    rng, direction = np.random.default_rng(11), np.array([0.8, -0.6])
    made = []
    for name, level in (("low", 20.0), ("high", 60.0)):
        force = forces(rng, level, 24.0)
        moved = Concealed(lambda x, v: 5e9 * x**3, direction).acceleration(model, force)
        made.append(trial(name, force, late(moved, RATE, 3e-3), rng))
    diagnosis = diagnose(model, made)
    assert {cause.name for cause in diagnosis.physics} == {"channel_delay", "stiffness_hardening"}


@pytest.mark.parametrize(("half_power_bandwidth", "named"), [(0.1, False), (6.0, True)])
def test_a_narrow_mode_must_outdo_chance_in_all_its_places(
    small_model: ModalModel,
    trial_of: Callable[[ModalModel, str, float, int], BandRecording],
    hand_made: Callable[[ModalModel, list[BandRecording]], StructureDiagnosis],
    half_power_bandwidth: float,
    named: bool,
) -> None:
    """Of modes 0.1 Hz wide four hundred fit into the band, of modes 6 Hz wide seven."""
    known = hand_made(small_model, [trial_of(small_model, "low", 20.0, 1), trial_of(small_model, "high", 60.0, 2)])
    base = known.details.base
    pole = -np.pi * half_power_bandwidth + 2j * np.pi * 20.0
    hypothesis = base.hypothesis.with_mode(pole, small_model.right[0], small_model.left[0], MISSING_MODE)
    gained = EvidenceSettings().least + 5.0
    fitted = Fit(hypothesis, base.noises, -200.0, 0.0, -gained, 1e-6 * np.eye(hypothesis.size))
    proposal = Proposal("missing_mode", {}, fitted, gained)
    # that a wide mode must also stand out of the noise is another rule
    limits = EvidenceSettings(stands_out=0.0)
    assert is_significant(proposal, base, base, list(known.details.recordings), limits) is named


@pytest.mark.parametrize(("share", "named"), [(-0.0013, False), (-0.013, True)])
def test_a_coupling_without_a_clear_share_is_not_significant(
    small_model: ModalModel,
    trial_of: Callable[[ModalModel, str, float, int], BandRecording],
    hand_made: Callable[[ModalModel, list[BandRecording]], StructureDiagnosis],
    share: float,
    named: bool,
) -> None:
    """Where the share of the other channel may be zero, the resonance through which it comes says nothing."""
    known = hand_made(small_model, [trial_of(small_model, "low", 20.0, 1), trial_of(small_model, "high", 60.0, 2)])
    base, gained = known.details.base, EvidenceSettings().least + 5.0
    period = 1 / (2 * np.pi * 9.0)
    coupling = Cause(COUPLING, np.array([period**2, 0.04 * period, share]), place="response TCP:+X from TCP:+Y")
    hypothesis = replace(base.hypothesis, causes=(coupling,))
    errors = np.full(hypothesis.size, 1e-3)
    errors[-1] = 0.00075 / COUPLING.parameters[2].unit_step
    proposal = Proposal(
        COUPLING.name, {}, Fit(hypothesis, base.noises, -200.0, 0.0, -gained, np.diag(errors**2)), gained
    )
    assert is_significant(proposal, base, base, list(known.details.recordings), EvidenceSettings()) is named


@pytest.mark.parametrize("name", [name for name, each in library().items() if isinstance(each, JointPhysics)])
def test_the_force_of_each_law_but_a_drift_stands_for_its_numbers(name: str) -> None:
    """A force that depends on time has no size over a motion; errors of the numbers are errors of the force."""
    physics = law_of(name)
    hypothesis = with_law(physics, physics.starts(MOTION)[0])
    fitted = Fit(hypothesis, (), 0.0, 0.0, 0.0, 1e-12 * np.eye(hypothesis.size))
    assert force_is_clear(fitted, 4.0) is (name not in ("pose_drift", "speed_stiffness"))
    assert not force_is_clear(replace(fitted, covariance=1e6 * np.eye(hypothesis.size)), 4.0)


def test_a_slider_that_slides_almost_always_has_a_clear_force_without_clear_numbers() -> None:
    """Stiffness times yield is known, and neither of them: their errors of 50 % are opposite."""
    physics = law_of("hysteresis")
    values = np.array([1e5, 0.15 * MOTION.deflection, 0.3])
    hypothesis = with_law(physics, values)
    opposite = np.zeros(hypothesis.size)
    opposite[-3:-1] = 0.5 / physics.parameters[0].unit_step, -0.5 / physics.parameters[1].unit_step
    fitted = Fit(hypothesis, (), 0.0, 0.0, 0.0, np.outer(opposite, opposite) + 1e-6 * np.eye(hypothesis.size))
    assert abs(opposite[-3]) * physics.parameters[0].unit_step > 1 / 4.0
    assert force_is_clear(fitted, 4.0)
    alike = np.abs(opposite)
    assert not force_is_clear(replace(fitted, covariance=np.outer(alike, alike)), 4.0)


def test_the_gain_of_a_tone_is_that_of_its_own_line(
    small_model: ModalModel,
    trial_of: Callable[[ModalModel, str, float, int], BandRecording],
    hand_made: Callable[[ModalModel, list[BandRecording]], StructureDiagnosis],
) -> None:
    """A tone in the middle of a line leaves nothing on the lines beside it, which look as if they stood out as much."""
    made = [trial_of(small_model, "low", 20.0, 1), trial_of(small_model, "high", 60.0, 2)]
    lines = hand_made(small_model, made).details.recordings[0]
    frequency = float(lines.frequencies[len(lines.frequencies) // 3])
    wave = 0.02 * np.cos(2 * np.pi * frequency * np.arange(len(made[0].response)) / made[0].rate)
    humming = hand_made(small_model, [replace(each, response=each.response + wave[:, None]) for each in made])
    result = find_tone(humming.details.base, list(humming.details.recordings))
    assert result is not None
    assert result.frequency == pytest.approx(frequency, abs=0.2 / 40.0)
    # a line of a wave of amplitude a over n samples has the power a^2 n / 4, two channels, two recordings
    expected = 2 * 2 * (0.02**2 * len(lines.window) / 4) / 0.02**2
    assert result.gain == pytest.approx(expected, rel=0.5)


def test_a_further_mode_is_tried_beside_other_physics(
    small_model: ModalModel,
    trial_of: Callable[[ModalModel, str, float, int], BandRecording],
    hand_made: Callable[[ModalModel, list[BandRecording]], StructureDiagnosis],
) -> None:
    """What a delay leaves may be a small mode's: neither explains the recordings alone."""
    pole = 2 * np.pi * 20.0 * (-0.03 + 1j)
    right, left = np.full(2, 0.5 / (2j * pole.imag * 40.0)), np.full(2, 0.5 + 0j)
    with_mode = ModelShape(small_model, LabError()).with_mode(pole, right, left).nominal
    known = hand_made(small_model, [trial_of(with_mode, "low", 20.0, 1), trial_of(with_mode, "high", 60.0, 2)])
    lines = list(known.details.recordings)
    delayed = fit(lines, known.details.base.hypothesis.with_cause(Cause(DELAY, np.array([1e-4]))))
    mode = ScreenedMode(MISSING_MODE, pole, right, left, 1e6)
    result = linear_candidates(lines, delayed, [], mode, ScreeningSettings(), 20.0)
    assert [each.name for each in result] == ["missing_mode"]
    assert result[0].evidence > 100.0
