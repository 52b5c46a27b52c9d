"""Forces that repeat show the noise without a model: what is above it is left over, whatever moves with the signal."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from one_mode_rig import NOISE, PERIOD, Rig, steady

from benchmarks.blind_trial.case_spec import draw_cases
from benchmarks.blind_trial.sealed_case import write_case
from estimation import BandRecording, windowed_spectrum
from estimation.repeats.noise_between_periods import measured_noise
from millfrf.mismatch import Hypothesis, LabError, ModelShape, diagnose, read_recordings
from millfrf.mismatch.models.misfit import is_below_noise
from millfrf.mismatch.records.bands import compared_band, compared_lines, with_measured_noise
from millfrf.mismatch.records.noise_model import fit_noise
from millfrf.mismatch.records.reading import band_of
from millfrf.steps.diagnose import diagnosis_lines
from modal_fit import read_modal_model


@pytest.mark.parametrize("levels", [(1.0, 4.0), (4.0,)])
def test_nothing_is_found_in_a_linear_rig_that_is_driven_steadily(levels: tuple[float, ...]) -> None:
    rig = Rig()
    diagnosis = diagnose(rig.model, [steady(rig, f"level_{level:g}", level, 5) for level in levels])
    assert diagnosis.verdict == "none"
    assert diagnosis.after.share == 0.0
    assert diagnosis.improvement.after == pytest.approx(diagnosis.improvement.noise_floor, rel=0.05)


@pytest.mark.long
@pytest.mark.parametrize("levels", [(1.0, 4.0), (4.0,)])
def test_a_cubic_spring_that_is_driven_steadily_is_told(levels: tuple[float, ...]) -> None:
    """A tenth of stiffening; before: the periodic residual passed for noise."""
    rig = Rig().stiffened(0.1, 4.0)
    diagnosis = diagnose(rig.model, [steady(rig, f"level_{level:g}", level, 5) for level in levels])
    assert diagnosis.verdict == "explained"
    assert [cause.name for cause in diagnosis.physics] == ["stiffness_hardening"]
    assert diagnosis.improvement.after < 1.2 * diagnosis.improvement.noise_floor
    assert diagnosis.before.share > 0.8


def test_what_no_law_explains_is_not_called_noise() -> None:
    """A third of stiffening at one level, which a search for laws may miss: all but the noise is left over."""
    rig = Rig().stiffened(0.3, 4.0)
    diagnosis = diagnose(rig.model, [steady(rig, "only", 4.0, 5)])
    assert diagnosis.before.share > 0.99
    (noise,) = diagnosis.content["noise"]
    assert noise["kind"] == "periods"
    assert noise["share"] == pytest.approx(NOISE, rel=0.5)
    assert diagnosis.improvement.noise_floor < 1.5 * NOISE
    assert any(", periods. " in line and "periods of 8 s" in line for line in diagnosis_lines(diagnosis))


def test_forces_that_hardly_repeat_show_no_noise() -> None:
    """What the model leaves is less than what differs between periods: the forces differed, not the noise."""
    rig = Rig()
    single = steady(rig, "only", 4.0, 5)
    lines = with_measured_noise(windowed_spectrum(single, band_of(rig.model, rig.rate), 1.0))
    shape = ModelShape(rig.model, LabError())
    true = Hypothesis(shape, np.zeros(shape.size))
    assert lines.noise is not None
    assert not is_below_noise(true, lines)
    louder = replace(lines.noise, responses=2 * lines.noise.responses)
    assert is_below_noise(true, replace(lines, noise=louder))


def test_the_noise_of_a_diagnosis_is_the_measured_noise() -> None:
    rig = Rig()
    single = steady(rig, "only", 4.0, 5)
    lines = with_measured_noise(windowed_spectrum(single, band_of(rig.model, rig.rate), 1.0))
    assert lines.noise is not None
    noise = measured_noise([single], (lines.frequencies[0], lines.frequencies[-1])).at(lines.frequencies, rig.rate)
    assert lines.noise.statement == noise.statement
    np.testing.assert_array_equal(lines.noise.responses, noise.responses)
    np.testing.assert_array_equal(lines.noise.forces, noise.forces)


def test_random_forces_show_no_noise() -> None:
    rig = Rig()
    item = rig.recordings((1.0,))[0]
    lines = windowed_spectrum(item, band_of(rig.model, rig.rate), 1.0)
    assert with_measured_noise(lines) is lines
    diagnosis = diagnose(rig.model, [item])
    assert [each["kind"] for each in diagnosis.content["noise"]] == ["inferred"]
    assert any(", inferred. " in line for line in diagnosis_lines(diagnosis))


def test_noise_of_forces_that_was_measured_is_held() -> None:
    """A residual that looks like noise of the force, of which the periods say that there is none."""
    rng = np.random.default_rng(3)
    frequencies = np.linspace(2.0, 30.0, 600)
    through = 1e3 / (1 - (frequencies / 9.0) ** 2 + 0.1j * frequencies / 9.0)[:, None, None]
    force = rng.normal(size=(600, 2)) @ np.array([1, 1j]) / np.sqrt(2)
    residual = through[:, :, 0] * force[:, None]
    levels = np.array([1e4]), np.array([10.0])
    free, held = (fit_noise(frequencies, residual, through, levels, None, each) for each in (None, np.array([1e-4])))
    assert np.exp(free.forces)[0] == pytest.approx(1.0, rel=0.2)
    assert np.exp(held.forces)[0] == pytest.approx(1e-4, rel=0.01)
    assert held.response_level()[0] > 10 * free.response_level()[0]


def noisy_force(one: BandRecording, share: float) -> BandRecording:
    """The recording with white noise on the force as it was measured."""
    noise = np.random.default_rng(7).normal(size=one.force.shape)
    return replace(one, force=one.force + share * one.force.std() * noise)


def test_only_what_forces_excite_is_compared() -> None:
    """Forces of 2 to 22 Hz; the model states no band, and would be compared from 3.3 to 30 Hz."""
    rig = Rig()
    asked = compared_band(rig.model, rig.rate)
    lines, band = compared_lines(noisy_force(steady(rig, "only", 4.0, 5), 0.03), asked, 1.0)
    spacing = rig.rate / PERIOD
    assert asked.high == pytest.approx(30.0)
    assert band.low == asked.low
    assert band.high == pytest.approx(22.0, abs=2 * spacing)
    assert lines.frequencies[-1] <= band.high
    assert "stand out of their noise" in band.sentence
    random = rig.recordings((1.0,))[0]
    assert compared_lines(random, asked, 1.0)[1] is asked


@pytest.mark.long
def test_noise_of_forces_beyond_their_band_asks_for_no_mode(tmp_path: Path) -> None:
    """Before: three modes cancelled the response that noise of the forces beyond a multisine would have caused."""
    control = next(each for each in draw_cases(120, 3502, only="steady") if each.index == 29)
    folder = write_case(control, tmp_path)
    model = read_modal_model(folder / "nominal.json")
    diagnosis = diagnose(model, read_recordings([folder / f"{level}.h5" for level in ("low", "mid", "high")], model))
    assert (diagnosis.verdict, diagnosis.physics) == ("none", ())
    assert 105 < diagnosis.content["compared_band"]["high"] < 115
