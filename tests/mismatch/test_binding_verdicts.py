"""Verdicts bind: what a held-out recording must confirm, what an answer may leave, and numbers that cannot be."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from concealed_recordings import RATE, Concealed, forces, linear_acceleration, trial

from estimation import BandRecording, windowed_spectrum
from millfrf.mismatch import (
    AcceptedCause,
    Hypothesis,
    LabError,
    ModelShape,
    Settings,
    StructureDiagnosis,
    diagnose,
    fit,
    library,
    recording_errors,
)
from millfrf.mismatch.inference.diagnosis import Improvement, Remainder, leaves_too_much, share_left
from millfrf.mismatch.inference.settings import VerdictSettings
from millfrf.mismatch.models.fitting import Fit
from millfrf.mismatch.records.reading import band_of
from millfrf.mismatch.structure.answer import verdict_of_structure
from millfrf.mismatch.structure.held_out import block_powers, lowers_held_out_error
from millfrf.mismatch.structure.structured_residual import remainder_of
from millfrf.reports.diagnoses.answers import named, verdict_sentence
from modal_fit import ModalModel

TONE = 11.37


@pytest.fixture(scope="module")
def with_tone(model: ModalModel) -> StructureDiagnosis:
    """A steady tone of a tenth to a half of the response, from a machine nearby."""
    rng, made = np.random.default_rng(21), []
    for name, level in (("low", 20.0), ("high", 60.0)):
        force = forces(rng, level, 24.0)
        clean = linear_acceleration(model, force)
        shaken = clean + 0.08 * np.sin(2 * np.pi * TONE * np.arange(len(force)) / RATE + rng.uniform(0, 6))[:, None]
        made.append(trial(name, force, shaken, rng))
    return diagnose(model, made)


def test_the_p_value_of_a_tone_agrees_with_its_error(with_tone: StructureDiagnosis) -> None:
    """The error falls, and so the test says that it falls: both are of the recording as it was measured."""
    gain = with_tone.improvement
    assert [cause.name for cause in with_tone.physics] == ["unmeasured_excitation"]
    assert gain.after < 0.7 * gain.refitted
    assert gain.after < 1.3 * gain.noise_floor
    assert gain.against == "refitted"
    assert gain.p_value < 0.01
    assert gain.interval[0] <= gain.after / gain.before <= gain.interval[1]


def test_a_tone_is_told_with_its_frequency(with_tone: StructureDiagnosis) -> None:
    cause = with_tone.physics[0]
    assert cause.parameters["frequency_hz"] == pytest.approx(TONE, abs=0.01)
    assert set(cause.parameters) == set(cause.standard_errors)
    shown = f"at {cause.parameters['frequency_hz']:.4f}"
    assert shown in named(cause)
    assert shown in verdict_sentence(with_tone)


def test_errors_of_the_held_out_recording_are_told_once(with_tone: StructureDiagnosis) -> None:
    gain = with_tone.improvement
    (held,) = (each for each in recording_errors(with_tone) if each.held_out)
    assert held.recording == gain.held_out
    stated = (held.nominal, held.refitted, held.final)
    assert stated == pytest.approx((gain.before, gain.refitted, gain.after), rel=1e-9)
    assert held.noise == pytest.approx(gain.noise_floor, rel=1e-9)


def test_powers_in_blocks_sum_to_that_of_the_lines(with_tone: StructureDiagnosis) -> None:
    lines = with_tone.details.recordings[0]
    whole = float(np.sum(np.abs(lines.measured) ** 2))
    assert block_powers(lines, lines.measured).sum() == pytest.approx(whole, rel=1e-9)


def _gain(before: float, refitted: float, after: float, noise: float, p: float, evidence: float) -> Improvement:
    return Improvement("mid", before, refitted, after, noise, p, (0.1, 2.0), evidence)


def _fit(misfit: float, score: float | None = None, laws: int = 0) -> Fit:
    fitted: Fit = object.__new__(Fit)
    object.__setattr__(fitted, "hypothesis", SimpleNamespace(laws=(None,) * laws))
    object.__setattr__(fitted, "misfit", misfit)
    object.__setattr__(fitted, "score", misfit if score is None else score)
    return fitted


@pytest.mark.parametrize(
    ("gain", "gained", "expected"),
    [
        (_gain(0.5, 0.2, 0.1, 0.1, 1e-6, 900.0), 1000.0, True),
        (_gain(0.526, 0.48, 0.491, 0.3, 0.98, 2000.0), 60000.0, False),  # the error rises over that of a refit
        (_gain(0.5, 0.2, 0.19, 0.1, 0.4, 900.0), 1000.0, False),  # it falls by chance
        (_gain(0.5, 0.2, 0.1, 0.1, 1e-6, 2.0), 1000.0, False),  # likelier nowhere but where it was fitted
        (_gain(0.17, 0.015, 0.016, 0.015, 0.6, 0.0), 10.0, True),  # a gain error: as good as any refit
        (_gain(0.015, 0.015, 0.016, 0.015, 0.6, 0.0), 10.0, False),  # no better than the nominal model
    ],
)
def test_what_a_held_out_recording_must_confirm(gain: Improvement, gained: float, expected: bool) -> None:
    assert lowers_held_out_error(gain, _fit(-gained), _fit(0.0), Settings()) is expected


@pytest.mark.parametrize(("laws", "expected"), [(0, True), (1, False)])
def test_a_law_is_confirmed_at_a_stricter_level(laws: int, expected: bool) -> None:
    """A law is the best of several laws, joints and forms, of which one fits by chance more often."""
    gain = _gain(0.5, 0.2, 0.1, 0.1, 0.03, 900.0)
    assert lowers_held_out_error(gain, _fit(-1000.0, laws=laws), _fit(0.0), Settings()) is expected


@pytest.mark.parametrize(
    ("evidence", "score", "expected"),
    [
        (19.4, 2123.6, True),  # a hundredth of its evidence is misfit: a refit that the lab was not off by
        (-3.0, 2123.6, False),  # likelier than the refit where it was fitted, less so elsewhere
        (19.4, 60.0, False),  # a third is misfit, and must be seen elsewhere
    ],
)
def test_a_cause_that_the_labs_belief_tells_need_not_predict_better_than_a_refit(
    evidence: float, score: float, expected: bool
) -> None:
    """A gain 1.67 times too high, 5 % noise. Before: let go of, and the modes were blamed."""
    gain = _gain(0.3422, 0.060647, 0.060607, 0.0606, 0.09, evidence)
    assert lowers_held_out_error(gain, _fit(-20.9, -score), _fit(0.0), Settings()) is expected


def test_what_an_answer_may_leave() -> None:
    limits = VerdictSettings()
    assert not leaves_too_much(_gain(0.3, 0.2, 0.1, 0.1, 0.0, 99.0), limits)
    assert leaves_too_much(_gain(0.799, 0.943, 0.558, 0.25, 0.0, 99.0), limits)
    assert leaves_too_much(
        _gain(0.9, 0.5, limits.most_of_response + 0.01, 0.3, 0.0, 99.0), limits
    )  # noise, or not: nothing shows it
    half = _gain(0.2, 0.2, 0.1, 0.05, 0.0, 99.0)
    assert share_left(half) == pytest.approx(0.2)
    assert share_left(half) > limits.most_left
    assert leaves_too_much(half, limits)


def test_a_quarter_of_the_response_left_is_not_none(
    small_model: ModalModel,
    trial_of: Callable[[ModalModel, str, float, int], BandRecording],
    hand_made: Callable[[ModalModel, list[BandRecording]], StructureDiagnosis],
) -> None:
    known = hand_made(small_model, [trial_of(small_model, "low", 20.0, 1)])
    left = remainder_of(known.details.final.hypothesis, list(known.details.recordings))
    good, bad = _gain(0.1, 0.1, 0.1, 0.1, 1.0, 0.0), _gain(0.5, 0.5, 0.5, 0.5, 1.0, 0.0)

    def verdict_of(
        causes: list[AcceptedCause], gain: Improvement, whole: Improvement | None = None, *, measured: bool = False
    ) -> str:
        final, limits = known.details.final.hypothesis, VerdictSettings()
        return verdict_of_structure(final, causes, (left, left), gain, limits, everywhere=whole, measured=measured)

    assert verdict_of([], good) == "none"
    assert verdict_of([], bad) == "unexplained"
    tone = [AcceptedCause("unmeasured_excitation", {}, {"frequency_hz": 9.0}, {"frequency_hz": 0.1}, 99.0)]
    assert verdict_of(tone, good) == "explained"
    assert verdict_of(tone, bad) == "unexplained"  # a tone that takes nothing away
    assert verdict_of(tone, _gain(0.9, 0.8, 0.3, 0.1, 1e-6, 99.0)) == "partly explained"
    assert verdict_of(tone, _gain(1.2, 1.2, 1.06, 0.1, 1e-6, 99.0)) == "unexplained"  # it predicts nothing
    # an aircraft: nine times the noise that its periods show; a linear refit follows the upper level alone
    upper, both_levels = _gain(0.963, 0.114, 0.066, 0.007, 0.002, 506.0), _gain(0.68, 0.42, 0.085, 0.006, 0.002, 506.0)
    assert verdict_of(tone, upper) == "explained"
    assert verdict_of(tone, upper, measured=True) == "unexplained"
    assert verdict_of(tone, upper, both_levels, measured=True) == "partly explained"
    worse = _gain(0.963, 0.06, 0.066, 0.007, 0.002, 506.0)
    assert verdict_of(tone, worse, both_levels, measured=True) == "unexplained"  # no better where it is told of


def test_what_causes_remove_from_held_out_data_was_structured(
    small_model: ModalModel,
    trial_of: Callable[[ModalModel, str, float, int], BandRecording],
    hand_made: Callable[[ModalModel, list[BandRecording]], StructureDiagnosis],
) -> None:
    """A residual that a refit leaves need not follow the signal: the fall of the held-out error shows its structure."""
    known = hand_made(small_model, [trial_of(small_model, "low", 20.0, 1)])
    hypothesis, limits = known.details.final.hypothesis, VerdictSettings()
    friction = [AcceptedCause("coulomb_friction", {}, {"friction_n": 9.0}, {"friction_n": 0.1}, 99.0)]
    unseen, left = Remainder(0.0, 0.0), Remainder(0.1, 0.01**2)
    fallen = _gain(0.05, 0.05, 0.011, 0.01, 1e-6, 99.0)
    assert verdict_of_structure(hypothesis, friction, (unseen, left), fallen, limits) == "explained"
    less = _gain(0.02, 0.02, 0.0105, 0.01, 1e-6, 99.0)
    assert verdict_of_structure(hypothesis, friction, (unseen, left), less, limits) == "partly explained"
    same = _gain(0.0111, 0.0111, 0.0105, 0.001, 1e-6, 99.0)
    assert verdict_of_structure(hypothesis, friction, (unseen, left), same, limits) == "unexplained"


def test_impossible_numbers_are_said_to_be_so() -> None:
    table, margin = library()["dynamometer_table_inertia"], np.array([0.5])
    assert "-14.8 kg" in table.impossible(np.array([-14.8]), margin)
    assert table.impossible(np.array([-0.4]), margin) == ""
    assert table.impossible(np.array([14.8]), margin) == ""
    force_cell, slack = library()["dynamometer_dynamics"], np.array([1e-8, 1e-5])
    assert "damping" in force_cell.impossible(np.array([2e-6, -1e-3]), slack)
    assert force_cell.impossible(np.array([2e-6, 1e-4]), slack) == ""
    axes, room = library()["dynamometer_axes"], np.full(4, 1e-5)
    damper, loose = library()["non_proportional_damping"], np.full(6, 5.0)
    assert "gives energy" in damper.impossible(np.array([-40.0, 80.0, 60.0, 0.0, 0.0, 0.0]), loose)
    assert "gives energy" in damper.impossible(np.array([10.0, 10.0, 10.0, 60.0, 0.0, 0.0]), loose)
    assert damper.impossible(np.array([40.0, 80.0, -4.0, 0.0, 0.0, 0.0]), loose) == ""
    assert "damping" in axes.impossible(np.array([2e-6, 2e-6, 2e-6, -1e-3]), room)
    wax, error = library()["transducer_resonance"], np.array([1e-8, 1e-4])
    assert "another filter" in wax.impossible(np.array([0.0, 1.8e-3]), error)
    assert wax.impossible(np.array([2e-6, 1e-4]), error) == ""
    # each number alone may be that of a resonance, within 1.02e-3 <= 2 sqrt(3.6e-7); both at once are not
    assert "another filter" in wax.impossible(np.array([0.0, 1.42e-3]), np.array([3.6e-7, 4e-4]))
    assert wax.impossible(np.array([0.0, 2e-4]), error) == ""  # far above the band: within the errors, a resonance
    assert library()["channel_coupling"].impossible(np.array([0.0, 1.8e-3, 0.2]), np.full(3, 1e-4)) == ""


def test_a_table_of_negative_mass_is_not_told(model: ModalModel) -> None:
    """A structure that lacks 4 kg at the tip: the mass fits best, and no table weighs minus 4 kg."""
    made = []
    rng = np.random.default_rng(31)
    for name, level in (("low", 20.0), ("high", 60.0)):
        force = forces(rng, level, 24.0)
        n = len(force)
        s = 2j * np.pi * np.fft.rfftfreq(2 * n, 1 / RATE)[:, None, None]
        receptance = model.receptance(s[:, 0, 0].imag / 2 / np.pi)
        lighter = np.linalg.solve(np.eye(2) - 4.0 * s**2 * receptance, receptance)
        spectrum = np.einsum("kpq,kq->kp", s**2 * lighter, np.fft.rfft(force, n=2 * n, axis=0))
        made.append(trial(name, force, np.fft.irfft(spectrum, n=2 * n, axis=0)[:n], rng))
    diagnosis = diagnose(model, made)
    assert "dynamometer_table_inertia" not in [cause.name for cause in diagnosis.physics]
    reasons = [each.location["impossible"] for each in diagnosis.candidates if each.stage == "impossible"]
    assert any("a table cannot have a mass of -" in reason for reason in reasons)


def _periodic(model: ModalModel, law: bool) -> BandRecording:
    """Four periods of 8 s."""
    rng = np.random.default_rng(41)
    force = np.tile(forces(rng, 40.0, 8.0), (4, 1))
    if law:
        response = Concealed(lambda x, v: 25 * float(np.tanh(v / 2e-3)), np.array([0.8, -0.6])).acceleration(
            model, force
        )
    else:
        response = linear_acceleration(model, force)
    return trial("steady", force, response, rng)


@pytest.mark.long
@pytest.mark.parametrize("law", [False, True])
def test_what_repeats_with_the_force_is_no_noise(model: ModalModel, law: bool) -> None:
    """A steady periodic test has no times of more and of less signal; a missing law repeats, noise does not."""
    single = _periodic(model, law)
    lines = [windowed_spectrum(single, band_of(model, RATE), float((-model.poles.real).min()))]
    shape = ModelShape(model, LabError())
    base = fit(lines, Hypothesis(shape, np.zeros(shape.size)))
    share = remainder_of(base.hypothesis, lines).share
    assert share > 0.7 if law else share < 0.05


def test_accepted_numbers_are_those_of_the_improved_model(
    model: ModalModel, linear_trials: list[BandRecording]
) -> None:
    """A gain error found in a model that is off too: told numbers and final hypothesis are one."""
    wrong = [replace(each, response=each.response * np.array([1.0, 1.25])) for each in linear_trials]
    diagnosis = diagnose(model, wrong)
    causes = [cause for cause in diagnosis.physics if cause.name == "gain_error"]
    assert len(causes) == 1
    held = [cause for cause in diagnosis.details.final.hypothesis.causes if cause.physics.name == "gain_error"]
    assert causes[0].parameters["gain_minus_one"] == pytest.approx(float(held[0].values[0]), rel=1e-9)
