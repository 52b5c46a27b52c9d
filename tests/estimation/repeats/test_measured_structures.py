"""Noise, distortion and change with the level of structures that other laboratories measured."""

from pathlib import Path

import numpy as np
import pytest

from estimation import (
    BandRecording,
    channels_of,
    distortion,
    find_repeats,
    homogeneity,
    noise_of_periods,
    read_band_recording,
    steady_periods,
)

pytestmark = pytest.mark.shared_data

SENSORS = ["EXC:+Z", "WING:+Z", "PAYLOAD:+Z"]


def wing(folder: Path, level: int) -> BandRecording:
    return read_band_recording(folder / "f16-ground-vibration" / f"level_{level}.h5", ["EXC:+Z"], SENSORS, 400.0)


def test_wing_repeats_every_8192_samples_with_the_published_noise(shared_data: Path) -> None:
    """SOURCE.md: eight periods of 8192 samples; .7-.9 % of the responses and .03-.07 % of the force, in the band."""
    loud = find_repeats(wing(shared_data, 3).force)
    assert loud is not None
    assert loud.period == 8192
    assert [(each.start, each.n_periods) for each in loud.stretches] == [(0, 8)]
    quiet, loud_noise = (
        noise_of_periods(steady_periods([wing(shared_data, level)]).within((2.0, 15.0))) for level in (1, 3)
    )
    assert np.all((loud_noise.response_share > 0.0065) & (loud_noise.response_share < 0.0095))
    assert np.all(quiet.response_share < 0.004)
    assert quiet.force_share[0] == pytest.approx(0.0003, abs=0.0001)
    assert loud_noise.force_share[0] == pytest.approx(0.0007, abs=0.0001)
    assert "drift slowly" in loud_noise.statement


def test_wing_distorts_and_is_not_homogeneous(shared_data: Path) -> None:
    levels = [steady_periods([wing(shared_data, level)]) for level in (1, 3)]
    for each in levels:
        above = distortion(each).classes[0]
        assert above.name == "lines above the band, up to twice its end"
        assert np.all(above.p_values < 1e-100)
        assert np.all(above.level > 5 * above.noise)
    result = homogeneity(*levels)
    assert np.all(result.p_values < 1e-100)
    assert np.all(np.abs(result.largest - 7.3) < 0.1)  # the bolted joint's mode
    assert result.levels == pytest.approx((12.4, 36.8), abs=0.1)


def test_mirror_of_three_inputs_has_noise_and_distortion_apart(shared_data: Path) -> None:
    """Three orthogonal multisines, two realisations, two periods; piezo actuators: hysteresis, whatever the level."""
    shares, stochastic = [], []
    for level in (100, 300):
        u, y = (np.load(shared_data / "fsm-cubespec-mimo" / f"{name}_{level}mV_train.npy") for name in "uy")
        points = ["P1:+X", "P2:+X", "P3:+X"]
        channels = channels_of("voltage", points), channels_of("displacement", points)
        one_after_the_other = [x.transpose(2, 3, 0, 1).reshape(-1, 3) for x in (u, y)]
        whole = BandRecording(str(level), 6400.0, *one_after_the_other, *channels)
        repeated = find_repeats(whole.force)
        assert repeated is not None
        assert [each.start for each in repeated.stretches] == [16384 * k for k in range(6)]
        cut = steady_periods([whole], repeated)
        shares.append(noise_of_periods(cut).response_share)
        result = distortion(cut)
        assert result.stochastic is not None
        stochastic.append(result.stochastic)
    assert np.all((shares[0] > 0.02) & (shares[0] < 0.045))  # SOURCE.md: 3.3 and .8 %
    assert np.all((shares[1] > 0.004) & (shares[1] < 0.009))
    assert np.all(np.abs(np.array(stochastic) - 0.037) < 0.01)
