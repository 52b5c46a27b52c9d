"""A tone from elsewhere sounds in every recording alike; a line that follows the forces is none."""

from dataclasses import replace

import numpy as np
import pytest
from one_mode_rig import Rig

from estimation import windowed_spectrum
from millfrf.mismatch import AcceptedCause, Hypothesis, LabError, ModelShape, fit
from millfrf.mismatch.faults.clipping_repair import with_final_tones
from millfrf.mismatch.inference.settings import FAULTS
from millfrf.mismatch.records.reading import band_of

LEVELS, FREQUENCY = (1.0, 3.0, 9.0), 17.3


def told(sizes: tuple[float, ...]) -> list[AcceptedCause]:
    """What becomes of a tone that was accepted, where the recordings hold it with these amplitudes."""
    rig, lines = Rig(), []
    for each, size in zip(rig.recordings(LEVELS[: len(sizes)]), sizes, strict=True):
        wave = size * np.sin(2 * np.pi * FREQUENCY * np.arange(len(each.force)) / rig.rate)
        shown = replace(each, response=each.response + wave[:, None])
        lines.append(windowed_spectrum(shown, band_of(rig.model, rig.rate), 1.0))
    shape = ModelShape(rig.model, LabError())
    fitted = fit(lines, Hypothesis(shape, np.zeros(shape.size)), iterations=4)
    accepted = AcceptedCause("unmeasured_excitation", {}, {"frequency_hz": FREQUENCY}, {}, 900.0)
    return with_final_tones(fitted, lines, [accepted], 1.0, FAULTS)


def test_a_tone_that_sounds_alike_in_all_recordings_is_told_as_the_final_fit_leaves_it() -> None:
    (tone,) = told((0.05, 0.05, 0.05))
    assert tone.parameters["amplitude_answer"] == pytest.approx(0.05, rel=0.1)
    assert tone.standard_errors["amplitude_answer"] < 0.02


@pytest.mark.parametrize("sizes", [(0.05, 0.06, 0.04), (0.05, 0.06), (0.05,)])
def test_a_tone_may_be_louder_in_one_recording(sizes: tuple[float, ...]) -> None:
    """Two recordings know an amplitude badly, which does not make the tone one that follows the forces."""
    assert len(told(sizes)) == 1


def test_a_line_that_grows_with_the_forces_is_no_tone() -> None:
    """Before: a harmonic of sliding elements at a constant speed was told as a tone beside their hysteresis."""
    assert told((0.02, 0.06, 0.18)) == []
