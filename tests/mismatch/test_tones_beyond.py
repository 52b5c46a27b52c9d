"""Tones above the compared band: found where only the responses know them, and nowhere else."""

import numpy as np
import pytest
from concealed_recordings import RATE, forces, linear_acceleration, structure, trial
from numpy.typing import NDArray

from estimation import BandRecording, WindowedSpectrum, windowed_spectrum
from millfrf.mismatch import Hypothesis, LabError, ModelShape
from millfrf.mismatch.faults.tones import NEAR, Tone, above_neighbours, tones_above_band
from millfrf.mismatch.inference.settings import FAULTS
from millfrf.mismatch.records.reading import band_of

TONE = 83.217
LEVELS = (20.0, 40.0, 80.0)
DECAY = 1.7


def recordings(
    seed: int, tones: tuple[float, float, float] = (0.0, 0.0, 0.0), forced: float = 0.0
) -> list[WindowedSpectrum]:
    """Three linear cuts; amplitude of the tone in each, and of the same line in the force."""
    rng = np.random.default_rng(seed)
    result = []
    for level, size in zip(LEVELS, tones, strict=True):
        force = forces(rng, level, 40.0)
        wave = np.sin(2 * np.pi * TONE * np.arange(len(force)) / RATE + rng.uniform(0, 6))[:, None]
        force = force + forced * level * wave
        response = linear_acceleration(structure(), force)
        result.append(prepared(trial(f"{level:g} N", force, response + size * wave * np.array([1.0, 0.4]), rng)))
    return result


def prepared(one: BandRecording) -> WindowedSpectrum:
    return windowed_spectrum(one, band_of(structure(), one.rate), DECAY)


def found_in(lines: list[WindowedSpectrum]) -> list[Tone]:
    shape = ModelShape(structure(), LabError())
    return tones_above_band(Hypothesis(shape, np.zeros(shape.size)), lines, DECAY, 4)


def noise_of(lines: list[WindowedSpectrum]) -> NDArray[np.float64]:
    """About what 2 % noise is, a response, of the middle recording."""
    return np.asarray(0.02 * lines[1].recording.response.std(axis=0))


def test_a_tone_below_the_noise_is_found_with_frequency_and_size() -> None:
    size = float(noise_of(recordings(5))[0])
    lines = recordings(5, (0.7 * size, 0.7 * size, 0.7 * size))
    assert lines[0].frequencies[-1] < TONE - 20
    (tone,) = found_in(lines)
    assert tone.frequency == pytest.approx(TONE, abs=0.002)
    assert tone.amplitudes == pytest.approx([0.7 * size, 0.28 * size], rel=0.2)


def test_a_channel_that_clips_is_not_looked_at() -> None:
    """A limit makes harmonics of what repeats: what its channel alone shows is no tone from elsewhere."""
    lines = recordings(5, (10 * float(noise_of(recordings(5))[0]),) * 3)
    shape = ModelShape(structure(), LabError())
    true = Hypothesis(shape, np.zeros(shape.size))
    first, second = lines[0].recording.channels[-2:]
    assert len(tones_above_band(true, lines, DECAY, 4, clipped=[first])) == 1  # the other one shows it, too
    assert tones_above_band(true, lines, DECAY, 4, clipped=[first, second]) == []


def test_a_line_of_the_cut_is_no_tone() -> None:
    assert found_in(recordings(6, forced=0.02)) == []


def test_a_line_in_one_recording_only_is_no_tone() -> None:
    size = float(noise_of(recordings(7))[0])
    assert found_in(recordings(7, (0.0, 2 * size, 0.0))) == []


@pytest.mark.parametrize("seed", range(10))
def test_noise_has_no_tones(seed: int) -> None:
    assert found_in(recordings(100 + seed)) == []


def test_the_ends_of_a_band_stand_out_no_more_than_its_middle() -> None:
    """White noise, 200 lines a time: a weak last line must not make its neighbours look strong."""
    rng = np.random.default_rng(11)
    highest = [above_neighbours(rng.exponential(size=200), NEAR) for _ in range(1000)]
    assert max(float(each.max()) for each in highest) < FAULTS.contrast / 2
