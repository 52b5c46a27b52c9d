"""Location: the band, the channel, the time, the order and the growth of a residual that was put there."""

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from estimation import BandRecording
from millfrf.mismatch import StructureDiagnosis
from millfrf.mismatch.inference.settings import LocationSettings
from millfrf.mismatch.location.location import located
from millfrf.mismatch.location.maps import SpindleSpeed
from millfrf.mismatch.location.residual_view import holm, noise_spread, residual_view
from modal_fit import ModalModel

RATE, NOISE = 128.0, 0.02
LEVELS = (1.0, 2.0, 4.0)

MakeTrial = Callable[[ModalModel, str, float, int], BandRecording]
MakeDiagnosis = Callable[[ModalModel, list[BandRecording]], StructureDiagnosis]


def locate(diagnosis: StructureDiagnosis, speeds: dict[str, SpindleSpeed] | None = None) -> dict[str, Any]:
    return located(residual_view(diagnosis.details, diagnosis.verdict == "unexplained"), speeds or {})


def with_residual(trial: BandRecording, channel: int, extra: np.ndarray) -> BandRecording:
    response = trial.response.copy()
    response[:, channel] += extra
    return replace(trial, response=response)


@pytest.fixture(scope="module")
def quiet(small_model: ModalModel, trial_of: MakeTrial) -> list[BandRecording]:
    return [trial_of(small_model, f"level{k}", level, k) for k, level in enumerate(LEVELS)]


def band_noise(trial: BandRecording, seed: int, low: float = 9.0, high: float = 11.0) -> np.ndarray:
    white = np.random.default_rng(seed).normal(size=len(trial.force))
    shaped = sosfilt(butter(4, (low, high), "bandpass", fs=RATE, output="sos"), white)
    return np.asarray(shaped / np.std(shaped))


def grown(quiet: list[BandRecording], exponent: float) -> list[BandRecording]:
    sizes = [NOISE * (trial.level / quiet[0].level) ** exponent for trial in quiet]
    return [
        with_residual(trial, 1, size * band_noise(trial, 50 + k))
        for k, (trial, size) in enumerate(zip(quiet, sizes, strict=True))
    ]


@pytest.mark.parametrize("exponent", [0.0, 1.0, 3.0])
def test_band_channel_and_growth(
    small_model: ModalModel, quiet: list[BandRecording], hand_made: MakeDiagnosis, exponent: float
) -> None:
    result = locate(hand_made(small_model, grown(quiet, exponent)))
    first = result["frequency_bands"][0]
    assert first["share"] > 0.7
    assert first["low_hz"] < 10 < first["high_hz"]
    assert first["low_hz"] > 6
    assert first["high_hz"] < 16
    assert [row["channel"] for row in result["channels"] if row["significant"]] == ["ay"]
    growth = result["growth"]["residual"]
    assert growth["exponent"] == pytest.approx(exponent, abs=max(3 * growth["exponent_standard_error"], 0.05))
    assert growth["exponent_standard_error"] < 0.3
    json.dumps(result, allow_nan=False)


def test_thresholds_of_the_settings_decide(
    small_model: ModalModel, quiet: list[BandRecording], hand_made: MakeDiagnosis
) -> None:
    details = hand_made(small_model, grown(quiet, 1.0)).details

    def with_these(unexplained: bool = False, **changed: float) -> dict[str, Any]:
        return located(residual_view(details, unexplained, settings=LocationSettings(**changed)), {})

    usual, never = with_these(), with_these(family_wise=0.0)
    assert (usual["family_wise_level"], never["family_wise_level"]) == (0.01, 0.0)
    assert usual["cells"]
    assert never["cells"] == never["frequency_bands"] == never["times"] == []
    assert not any(row["significant"] for row in [*never["channels"], *never["levels"]])
    assert usual["growth"]["residual"]["exponent"] is not None
    for changed in ({"seen": 1e9}, {"levels_apart": 10.0}):
        assert with_these(**changed)["growth"]["residual"]["exponent"] is None
    assert with_these(least_spread=0.3)["noise_level_spread"] == 0.3
    assert with_these(unexplained=True, quiet_spread=0.7)["noise_level_spread"] == 0.7
    assert len(with_these(unexplained=True, quiet_level=1e6)["cells"]) == 0


def test_nothing_is_located_in_noise(
    small_model: ModalModel, quiet: list[BandRecording], hand_made: MakeDiagnosis
) -> None:
    result = locate(hand_made(small_model, quiet))
    assert result["frequency_bands"] == []
    assert result["times"] == []
    assert result["cells"] == []
    assert not any(row["significant"] for row in result["channels"] + result["levels"])
    assert "note" in result["growth"]


def test_time_of_a_burst(small_model: ModalModel, quiet: list[BandRecording], hand_made: MakeDiagnosis) -> None:
    time = np.arange(len(quiet[0].force)) / RATE
    burst = 4 * NOISE * band_noise(quiet[0], 7) * ((time > 20) & (time < 26))
    result = locate(hand_made(small_model, [with_residual(quiet[0], 0, burst), *quiet[1:]]))
    [stretch] = result["times"]
    assert stretch["recording"] == "level0"
    assert 17 < stretch["start_s"] < 21
    assert 25 < stretch["end_s"] < 29


def test_order_of_the_spindle(small_model: ModalModel, quiet: list[BandRecording], hand_made: MakeDiagnosis) -> None:
    time = np.arange(len(quiet[0].force)) / RATE
    runout = 2 * NOISE * np.sin(2 * np.pi * 3 * 4.0 * time)
    diagnosis = hand_made(small_model, [with_residual(trial, 0, runout) for trial in quiet])
    speeds = {trial.name: SpindleSpeed(np.zeros(1), np.array([240.0])) for trial in quiet}
    assert {row["order"] for row in locate(diagnosis, speeds)["spindle_orders"]} == {3}
    assert locate(diagnosis)["spindle_orders_note"]


def test_what_is_left_does_not_hide_itself() -> None:
    """Cells hold far less than the inferred noise, or far more: with so wide a scatter none would stand out."""
    ratio = np.exp(2 * np.random.default_rng(4).normal(size=200))
    noise = noise_spread(ratio, np.full(len(ratio), 20.0))
    assert noise.spread == 0.5
    assert noise.chance(100.0, 20.0) < 1e-4
    assert noise.chance(2.0, 20.0) > 0.01
    plain = np.random.default_rng(3).chisquare(40, size=400) / 40
    assert noise_spread(plain, np.full(400, 20.0)).spread < 0.1


def test_holm_is_monotone_and_no_smaller() -> None:
    chances = np.random.default_rng(0).uniform(size=50)
    adjusted = holm(chances)
    assert (adjusted >= chances).all()
    assert (np.diff(adjusted[np.argsort(chances)]) >= 0).all()


def test_noise_is_not_believed_where_something_stayed_unexplained(
    small_model: ModalModel, quiet: list[BandRecording], hand_made: MakeDiagnosis
) -> None:
    honest = hand_made(small_model, grown(quiet, 1.0))
    noises = tuple(replace(each, responses=each.responses + np.log(100.0)) for each in honest.details.final.noises)
    final = replace(honest.details.final, noises=noises)
    fooled = replace(honest, details=replace(honest.details, final=final))
    assert locate(fooled)["frequency_bands"] == []
    first = locate(replace(fooled, verdict="unexplained"))["frequency_bands"][0]
    assert first["low_hz"] < 10 < first["high_hz"]


def test_a_speed_whose_device_was_lost_is_unknown_there() -> None:
    time = np.r_[np.arange(0.0, 10.0, 0.1), np.arange(14.0, 20.0, 0.1)]
    speed = SpindleSpeed(time, np.where(time < 10, 6000.0, 9000.0))
    assert speed.hertz(2.0, 4.0) == (100.0, 0.0)
    assert speed.hertz(15.0, 16.0) == (150.0, 0.0)
    for start, stop in ((9.5, 10.5), (11.0, 12.0), (13.0, 15.0)):
        assert np.isnan(speed.hertz(start, stop)).all()
    assert SpindleSpeed(np.array([0.0, 5.0]), np.array([6000.0, 6000.0])).hertz(1.0, 2.0) == (100.0, 0.0)
