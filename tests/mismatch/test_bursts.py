"""Blows and dropouts that no force shows: what is left comes in bursts, and the verdict is not ``none``."""

from dataclasses import replace

import numpy as np
import pytest
from one_mode_rig import Rig

from estimation import BandRecording, windowed_spectrum
from millfrf.mismatch import Hypothesis, LabError, ModelShape, diagnose
from millfrf.mismatch.structure.structured_residual import Bursts, bursts_left

RIG = Rig()
BAND = (2.0, 25.0)


def struck(level: float, seed: int, strength: float) -> BandRecording:
    """A recording in which something strikes the rig once in three seconds, for 30 ms; the force does not show it."""
    force = RIG.forces(level, 60.0, seed)
    blows, rng = np.zeros(len(force)), np.random.default_rng(300 + seed)
    for start in np.arange(3.0, 57.0, 3.0) + rng.uniform(0, 1, 18):
        first = int(start * RIG.rate)
        blows[first : first + 4] += strength * level * rng.uniform(0.5, 1.5)
    return replace(RIG.recording(f"level_{seed}", force + blows, seed=seed), force=force[:, None])


def held(recording: BandRecording) -> BandRecording:
    """The recording with a response that stands still for 0.2 s, twice."""
    response = recording.response.copy()
    for second in (20, 41):
        first = int(second * recording.rate)
        response[first : first + int(0.2 * recording.rate)] = response[first]
    return replace(recording, response=response)


def left(*recordings: BandRecording) -> tuple[Bursts, ...]:
    """Bursts that the true linear model leaves."""
    shape = ModelShape(RIG.model, LabError())
    lines = [windowed_spectrum(each, BAND, 3.0) for each in recordings]
    return bursts_left(Hypothesis(shape, np.zeros(shape.size)), lines)


@pytest.mark.parametrize("seed", range(8))
def test_noise_does_not_burst(seed: int) -> None:
    assert not left(RIG.recording("quiet", RIG.forces(20.0, 60.0, seed), noise=0.03, seed=seed))


def test_modes_beyond_the_band_do_not_burst_at_the_ends() -> None:
    """Before: the sharp ends of a strong motion beyond the band leaked into it, and passed for blows."""
    quiet = RIG.recording("quiet", RIG.forces(20.0, 60.0, 5), noise=0.001, seed=5)
    time = np.arange(len(quiet.response)) / quiet.rate
    beyond = 3.0 * quiet.response.std() * np.cos(2 * np.pi * 31.0 * time)
    assert not left(replace(quiet, response=quiet.response + beyond[:, None]))


def test_blows_burst_where_they_fall() -> None:
    quiet, loud = struck(20.0, 1, 0.0), replace(struck(20.0, 2, 3.0), name="loud")
    (result,) = left(quiet, loud)
    assert result.name == "loud"
    assert result.share > 0.3
    assert "comes in bursts" in result.sentence


def test_a_dropout_bursts_at_its_time() -> None:
    (result,) = left(held(RIG.recording("dropped", RIG.forces(20.0, 60.0, 4), seed=4)))
    assert min(abs(result.at - second) for second in (20.1, 41.1)) < 0.4


@pytest.mark.long
def test_blows_are_not_called_none() -> None:
    """Before: ``none``, as blows come whether the cut is strong or not, and passed for noise."""
    model = RIG.model
    quiet = diagnose(model, [struck(level, k, 0.0) for k, level in enumerate((10.0, 20.0, 40.0))])
    loud = diagnose(model, [struck(level, k, 3.0) for k, level in enumerate((10.0, 20.0, 40.0))])
    assert (quiet.verdict, loud.verdict) == ("none", "unexplained")
    assert not loud.physics
    assert not any("bursts" in each for each in quiet.doubts)
    assert any("bursts" in each for each in loud.doubts)
