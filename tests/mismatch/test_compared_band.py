"""A model is compared in the band in which it holds; what the recordings state of their own chain is believed."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from concealed_recordings import RATE, forces, linear_acceleration, structure, trial
from scipy.signal import bilinear, lfilter

from acquisition import Channel, RecordingWriter, StreamDescription
from estimation import BandRecording
from millfrf.core import InputError
from millfrf.mismatch import LabError, ModelShape, diagnose, read_recording, write_diagnosis
from millfrf.mismatch.records.bands import compared_band
from modal_fit import ModalModel, Residuals

BAND = (5.0, 24.0)


def with_high_mode() -> ModalModel:
    """The structure with a third mode at 52 Hz, stronger than the others in acceleration."""
    low, omega = structure(), 2 * np.pi * 52.0
    pole, shape = omega * (-0.02 + 1j * np.sqrt(1 - 0.02**2)), np.array([0.9, 0.6])
    return replace(
        low,
        poles=np.append(low.poles, pole),
        right=np.vstack([low.right, shape / (2j * pole.imag * 20.0)]),
        left=np.vstack([low.left, shape + 0j]),
    )


def fitted_to_band() -> ModalModel:
    """What a fit to 5 to 24 Hz gives: two modes, and the flexibility and curvature that the third leaves there."""
    whole, low = with_high_mode(), structure()
    third = replace(whole, poles=whole.poles[2:], right=whole.right[2:], left=whole.left[2:])
    residue = np.einsum("rp,rq->rpq", third.right, third.left)
    return replace(low, residuals=Residuals(np.zeros((2, 2)), np.zeros((2, 2)), third.poles, residue), band=BAND)


def recorded(truth: ModalModel) -> list[BandRecording]:
    rng = np.random.default_rng(11)
    made = []
    for name, level in (("low", 20.0), ("high", 60.0)):
        force = forces(rng, level, 24.0)
        made.append(trial(name, force, linear_acceleration(truth, force), rng))
    return made


@pytest.fixture(scope="module")
def shaken() -> list[BandRecording]:
    return recorded(with_high_mode())


def test_a_model_is_compared_in_its_band(shaken: list[BandRecording], tmp_path: Path) -> None:
    """A textbook residual instead of the third mode: outside the band it is wrong, inside nothing is missing."""
    model, at = fitted_to_band(), np.array([12.0])
    upper = (with_high_mode().receptance(at) - structure().receptance(at))[0].real
    textbook = replace(model, residuals=Residuals(upper, np.zeros((2, 2))))
    diagnosis = diagnose(textbook, shaken)
    assert diagnosis.verdict == "none", [cause.name for cause in diagnosis.physics]
    assert diagnosis.improvement.after < 1.2 * diagnosis.improvement.noise_floor
    assert all(
        BAND[0] <= each.frequencies[0] and each.frequencies[-1] <= BAND[1] for each in diagnosis.details.recordings
    )
    assert diagnosis.details.band is not None
    assert diagnosis.details.band.edges == BAND
    assert "model holds" in diagnosis.details.band.sentence
    assert diagnosis.doubts == ()
    write_diagnosis(tmp_path / "diagnosis.json", replace(diagnosis, located={}))
    content = json.loads((tmp_path / "diagnosis.json").read_text())
    assert (content["compared_band"]["low"], content["compared_band"]["high"]) == BAND


def test_derivative_by_what_lies_outside_the_band() -> None:
    """Against central differences of the receptance that the model then has."""
    shape, frequencies = ModelShape(fitted_to_band(), LabError()), np.linspace(5, 24, 13)
    rng = np.random.default_rng(2)
    u, force = rng.normal(size=shape.size), rng.normal(size=(13, 2)) + 1j * rng.normal(size=(13, 2))
    slopes = shape.jacobian(u, frequencies, force)
    assert shape.size == shape.modal_size + 12
    for k in range(shape.modal_size, shape.size):
        aside = 1e-3 * np.eye(shape.size)[k]
        change = shape.model(u + aside).receptance(frequencies) - shape.model(u - aside).receptance(frequencies)
        numeric = np.einsum("kpq,kq->kp", change, force) / 2e-3
        np.testing.assert_allclose(slopes[:, :, k], numeric, atol=1e-6 * np.abs(numeric).max())


def test_a_model_without_a_band_is_doubted_where_it_knows_nothing(shaken: list[BandRecording]) -> None:
    diagnosis = diagnose(replace(fitted_to_band(), band=None, residuals=None), shaken)
    assert diagnosis.verdict != "none"
    assert any("above the highest mode" in doubt and "band" in doubt for doubt in diagnosis.doubts)


def test_a_model_that_knows_all_is_not_doubted(model: ModalModel, linear_trials: list[BandRecording]) -> None:
    assert diagnose(model, linear_trials).doubts == ()


def test_edges_of_the_band() -> None:
    model = structure()
    assert compared_band(model, RATE).edges == pytest.approx((3.0, 42.0), rel=1e-9)
    assert compared_band(replace(model, band=(8.0, 20.0)), RATE).edges == (8.0, 20.0)
    assert compared_band(replace(model, band=(8.0, 200.0)), RATE).edges == pytest.approx((8.0, 0.42 * RATE))
    with pytest.raises(InputError, match="too slowly"):
        compared_band(replace(model, band=(120.0, 200.0)), RATE)


def test_a_stated_high_pass_is_no_mismatch(tmp_path: Path) -> None:
    """Sensors and a force cell whose corners the file states: what they take away is not missing physics."""
    model, rng = structure(), np.random.default_rng(4)
    force = forces(rng, 40.0, 24.0)
    shown = [_passed(force, 0.3), _passed(linear_acceleration(model, force), 0.5)]
    channels = [Channel(f"f{a}", "force", "N", "TCP", f"+{a}", high_pass_hz=0.3) for a in "XY"]
    channels += [Channel(f"a{a}", "acceleration", "m/s^2", "TCP", f"+{a}", high_pass_hz=0.5) for a in "XY"]
    with RecordingWriter(tmp_path / "cut.h5", [StreamDescription("main", RATE, 0.0, tuple(channels))]) as writer:
        writer.append("main", np.hstack(shown))
    read = read_recording(tmp_path / "cut.h5", model)
    n = 2 * len(force)
    axis = np.fft.rfftfreq(n, 1 / RATE)
    spectrum = np.einsum("kpq,kq->kp", model.receptance(axis), np.fft.rfft(read.force, n=n, axis=0))
    predicted = np.fft.irfft(read.kinematic(axis) * spectrum, n=n, axis=0)[: len(force)]
    late = slice(int(6 * RATE), -int(RATE))
    assert np.std((predicted - read.response)[late]) < 2e-3 * np.std(read.response[late])


def _passed(signal: np.ndarray, corner: float) -> np.ndarray:
    """A first-order high-pass by its recursion (bilinear), from rest."""
    b, a = bilinear([1.0, 0.0], [1.0, 2 * np.pi * corner], RATE)
    return np.asarray(lfilter(b, a, signal, axis=0))
