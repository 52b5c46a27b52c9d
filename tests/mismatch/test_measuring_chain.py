"""Faults of the measuring chain are named as such, with their numbers, and structures are not called so."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy
from concealed_recordings import Concealed, forces, linear_acceleration, structure, trial
from hypothesis import given
from hypothesis import strategies as st

from estimation import BandRecording, WindowedSpectrum, rounding_step, windowed_spectrum
from millfrf.core import Complex, Real
from millfrf.mismatch import (
    Hypothesis,
    LabError,
    ModelShape,
    Settings,
    StructureDiagnosis,
    diagnose,
    fit,
    improved_model_of,
    predict,
)
from millfrf.mismatch.faults.measuring_chain import Side, Wiring, correct_skew, find_wiring, stated_wiring
from millfrf.mismatch.records.reading import band_of

DECAY = 1.7
Change = Callable[[Real, Real, float], tuple[Real, Real]]


def recordings(change: Change, seed: int = 4, law: Concealed | None = None) -> list[BandRecording]:
    """Three cuts whose forces and responses pass a measuring chain before the noise is added."""
    rng, model = np.random.default_rng(seed), structure()
    made = []
    for level in (20.0, 40.0, 80.0):
        force = forces(rng, level, 24.0)
        response = linear_acceleration(model, force) if law is None else law.acceleration(model, force)
        clean = trial(f"{level:g} N", force, response, rng)
        shown = change(clean.force, clean.response, clean.rate)
        made.append(replace(clean, force=shown[0], response=shown[1]))
    return made


def spectra(made: list[BandRecording]) -> list[WindowedSpectrum]:
    return [windowed_spectrum(each, band_of(structure(), each.rate), DECAY) for each in made]


def nominal(frequency: float = 1.01) -> Hypothesis:
    """A laboratory's model, off by its usual errors."""
    model = structure()
    shape = ModelShape(replace(model, poles=model.poles * frequency), LabError())
    return Hypothesis(shape, np.zeros(shape.size))


def named(diagnosis: StructureDiagnosis) -> list[str]:
    return [cause.name for cause in diagnosis.physics]


def whole(order: tuple[int, ...], signs: tuple[float, ...]) -> Side:
    return Side(np.array(order), np.array(signs))


@pytest.mark.parametrize(
    ("forces_side", "responses_side"),
    [
        (whole((0, 1), (1, 1)), whole((0, 1), (1, -1))),
        (whole((0, 1), (1, 1)), whole((1, 0), (1, 1))),
        (whole((1, 0), (1, 1)), whole((0, 1), (1, 1))),
        (whole((0, 1), (-1, 1)), whole((1, 0), (1, -1))),
    ],
)
def test_each_wiring_is_found(forces_side: Side, responses_side: Side) -> None:
    wrong = Wiring(forces_side, responses_side)
    lines = [wrong.inverse.lines(each) for each in spectra(recordings(lambda force, response, _: (force, response)))]
    wiring, evidence = find_wiring(lines, nominal(), Settings().evidence, 20)
    assert wiring is not None
    assert evidence > 1000
    assert wiring.forces.recorded.tolist() == wrong.forces.recorded.tolist()
    assert wiring.responses.recorded.tolist() == wrong.responses.recorded.tolist()
    # reversing all forces and all responses changes nothing
    signs, true = (np.outer(each.responses.signs, each.forces.signs) for each in (wiring, wrong))
    np.testing.assert_array_equal(signs, true)


def test_the_stated_wiring_stays_under_friction() -> None:
    law = Concealed(lambda x, v: 25 * float(np.tanh(v / 2e-3)), np.array([0.3, 0.95]))
    lines = spectra(recordings(lambda force, response, _: (force, response), law=law))
    assert find_wiring(lines, nominal(), Settings().evidence, 20) == (None, 0.0)


@given(st.permutations(range(4)), st.lists(st.sampled_from([-1.0, 1.0]), min_size=4, max_size=4))
def test_wirings_are_inverted_and_told_by_their_causes(order: list[int], signs: list[float]) -> None:
    side = whole(tuple(order), tuple(signs))
    columns = np.arange(12.0).reshape(3, 4)
    np.testing.assert_array_equal(side.inverse.corrected(side.corrected(columns)), columns)
    channels = trial("t", np.ones((300, 2)), np.ones((300, 2)), np.random.default_rng(0)).responses
    four = tuple(replace(channels[0], name=name) for name in "abcd")
    recording = BandRecording("t", 1.0, columns[:, :1], columns, channels[:1], four)
    wiring = Wiring(whole((0,), (1.0,)), side)
    terms = [{"name": cause.name, "location": cause.location} for cause in wiring.causes(recording, 30.0)]
    stated = stated_wiring(recording, terms)
    assert stated.responses.recorded.tolist() == order
    assert stated.responses.signs.tolist() == signs
    np.testing.assert_array_equal(stated.recording(recording).response, side.corrected(columns))


@pytest.mark.parametrize("reversed_response", [True, False])
def test_a_reversed_channel_is_named_and_predicted(reversed_response: bool) -> None:
    """It was told as modal parameters, and the improved model did not predict other recordings."""
    sign = np.array([1.0, -1.0])
    made = recordings(
        lambda force, response, _: (force, response * sign) if reversed_response else (force * sign, response)
    )
    diagnosis = diagnose(replace(structure(), poles=structure().poles * 1.005), made[:2])
    assert diagnosis.verdict == "explained"
    assert named(diagnosis) == ["reversed_channel"]
    side = made[0].responses if reversed_response else made[0].excitations
    assert diagnosis.physics[0].location == {"channel": side[1].name}
    assert diagnosis.improvement.before > 1
    improved = predict(improved_model_of(diagnosis), made[2])
    assert improved.total_error < 1.2 * diagnosis.improvement.noise_floor
    np.testing.assert_allclose(improved.response.std(axis=0), made[2].response.std(axis=0), rtol=0.05)


def skewed(rate: float, delay: float = 0.0) -> Change:
    def change(force: Real, response: Real, sample_rate: float) -> tuple[Real, Real]:
        time = np.arange(len(response)) / sample_rate
        spline = scipy.interpolate.make_interp_spline(time, response, k=7)
        return force, spline(np.clip(time - rate * time - delay, 0, time[-1]))

    return change


@pytest.mark.parametrize("seed", range(4))
def test_the_skew_of_two_clocks_has_honest_errors(seed: int) -> None:
    rate = np.random.default_rng(seed).uniform(-2e-4, 2e-4)
    lines = spectra(recordings(skewed(rate, 1e-4), seed))
    base = fit(lines, nominal(), iterations=20)
    corrected, fitted, causes = correct_skew(lines, base, Settings())
    assert [cause.name for cause in causes] == ["clock_skew"]
    error = causes[0].standard_errors["rate_error"]
    assert causes[0].parameters["rate_error"] == pytest.approx(rate, abs=3.3 * error)
    assert error < 1e-6
    assert fitted.score < base.score - Settings().evidence.least
    assert len(corrected) == len(lines)


@pytest.mark.parametrize("seed", range(3))
def test_a_structure_that_changes_during_the_cut_is_no_skew(seed: int) -> None:
    """Its own modes are delayed more and more, and the others not."""
    first = recordings(lambda force, response, _: (force, response), seed)
    softer = replace(structure(), poles=structure().poles * np.array([0.98, 1.0]))
    made = []
    for each in first:
        late = linear_acceleration(softer, each.force)
        share = np.linspace(0, 1, len(late))[:, None]
        made.append(replace(each, response=(1 - share) * each.response + share * late))
    lines = spectra(made)
    base = fit(lines, nominal(1.0), iterations=20)
    assert correct_skew(lines, base, Settings())[2] == ()


@pytest.mark.parametrize("steps", [1, 2, 3])
def test_modes_that_are_still_far_off_are_no_skew(steps: int) -> None:
    """What their further steps gain is no evidence for a clock."""
    lines = spectra(recordings(lambda force, response, _: (force, response)))
    base = fit(lines, nominal(1.03), iterations=steps)
    assert correct_skew(lines, base, Settings())[2] == ()


@given(st.floats(1e-6, 10.0), st.floats(-1e3, 1e3), st.integers(5, 50))
def test_the_step_of_rounding_is_found(step: float, offset: float, amplitude: int) -> None:
    wave = amplitude * np.sin(0.37 * np.arange(2048)) + np.random.default_rng(amplitude).normal(size=2048)
    assert rounding_step(offset + step * np.rint(wave)) == pytest.approx(step, rel=1e-3)
    assert rounding_step(offset + step * wave) == 0.0


def through(first: Complex, place: int, source: int) -> Change:
    """A filter from one response channel to another one, over the whole recording."""

    def change(force: Real, response: Real, sample_rate: float) -> tuple[Real, Real]:
        spectrum = scipy.fft.rfft(response, axis=0)
        s = 2j * np.pi * scipy.fft.rfftfreq(len(response), 1 / sample_rate)
        part = spectrum[:, source] / (1 + first[1] * s + first[0] * s**2)
        spectrum[:, place] = part if place == source else spectrum[:, place] + first[2] * part
        return force, scipy.fft.irfft(spectrum, n=len(response), axis=0)

    return change


def resonance(frequency: float, damping: float, share: float) -> Complex:
    natural = 2 * np.pi * frequency
    return np.array([natural**-2, 2 * damping / natural, share])


@pytest.mark.parametrize(("place", "source", "name"), [(0, 0, "transducer_resonance"), (1, 0, "channel_coupling")])
def test_a_resonance_behind_the_structure_is_no_mode(place: int, source: int, name: str) -> None:
    made = recordings(through(resonance(24.0, 0.05, 0.2), place, source))
    model = structure()
    diagnosis = diagnose(model, made)
    assert named(diagnosis) == [name]
    numbers, errors = diagnosis.physics[0].parameters, diagnosis.physics[0].standard_errors
    assert numbers["resonance_hz"] == pytest.approx(24.0, abs=4 * errors["resonance_hz"])
    assert numbers["damping_ratio"] == pytest.approx(0.05, abs=4 * errors["damping_ratio"])
    assert diagnosis.physics[0].location["channel"] == model.responses[place]
