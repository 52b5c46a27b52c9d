"""FRFs of simulated hammer tests against the truth: every quantity, damping, noise, drift, damaged taps."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pole_fit import correlation, fitted_poles
from simulated_taps import QUANTITY, Bench, Hits, Structure, error_at_resonances, frf_of, plate, test_of, write_taps

from estimation import begins_with_recording, choose_segments, found_taps, response_decay, screened

TIMES = (0.6, 2.1, 3.6, 5.1)
RESPONSES = ("P1:+Z", "P2:+Z", "P3:+Z")


@pytest.mark.parametrize("quantity", ["acceleration", "velocity", "displacement"])
def test_the_frf_is_right_at_resonances(tmp_path: Path, quantity: str) -> None:
    """Noise of 1e-4 of each channel's largest value; a double hit and a clipped tap are left out."""
    structure = plate()
    hits = Hits((*TIMES, 6.6, 8.1), again={1: (0.02, 0.25)}, spread=0.4)
    path = write_taps(tmp_path / "a.h5", structure, hits, RESPONSES, Bench(seconds=9.7, quantity=quantity, noise=1e-4))
    merged, [result], settings = frf_of([path])
    frf = merged.frf
    assert frf.quantity == QUANTITY[quantity]
    assert [each.reason.partition(":")[0] for each in result.taps] == ["", "double hit", "", "", "", ""]
    assert [round(result.time(each), 2) for each in result.taps] == [0.6, 2.1, 3.6, 5.1, 6.6, 8.1]
    assert settings.time_constant is None
    np.testing.assert_array_equal(frf.averages, [[5]] * 3)
    assert error_at_resonances(structure, merged) < 0.01
    assert frf.band is not None
    assert frf.band[0] < 2
    # a half sine of 2 ms: |F(f)| / F(0) = cos(pi f w) / (1 - (2 f w)^2) = 0.1 at 655 Hz
    assert frf.band[1] == pytest.approx(655, rel=0.02)


def test_displacement_with_offset_and_drift_has_the_static_flexibility(tmp_path: Path) -> None:
    """An offset of half of the largest response, a drift by as much: H(0) is the sum of phi^2 / w^2."""
    structure = plate(damping=(0.05, 0.04, 0.03, 0.02))
    bench = Bench(seconds=6.8, quantity="displacement", noise=1e-4, offset=0.5, drift=0.5)
    path = write_taps(tmp_path / "a.h5", structure, Hits(TIMES), RESPONSES, bench)
    merged, [result], _ = frf_of([path])
    assert len(result.used) == 4
    assert merged.frf.frequencies[0] == 0
    assert merged.frf.valid[0]
    truth = [structure.frf(np.zeros(1, complex), p, "P1:+Z").real[0] for p in RESPONSES]
    np.testing.assert_allclose(merged.frf.values[0, :, 0].real, truth, rtol=0.02)
    assert error_at_resonances(structure, merged) < 0.01


def test_the_force_offset_is_taken_off(tmp_path: Path) -> None:
    structure = plate()
    path = write_taps(tmp_path / "a.h5", structure, Hits(TIMES), RESPONSES, Bench(seconds=6.8, noise=1e-4, zero=15.0))
    merged, _, _ = frf_of([path])
    assert error_at_resonances(structure, merged) < 0.01


LIGHT = plate(damping=(0.004, 0.003, 0.002, 0.002))


def light_taps(folder: Path, **how: object) -> list[Path]:
    """Recordings as a triggered analyser makes them: one tap each, ended while the structure still rings."""
    bench = Bench(seconds=0.9, quantity="acceleration", noise=1e-4)
    return [
        write_taps(folder / f"{k}.h5", LIGHT, Hits((0.05,)), RESPONSES, replace(bench, seed=k, **how))  # type: ignore[arg-type]
        for k in range(4)
    ]


def test_a_response_that_is_cut_off_gets_an_exponential_window_and_stays_right(tmp_path: Path) -> None:
    merged, _, settings = frf_of(light_taps(tmp_path))
    truth_left = np.exp(LIGHT.poles.real.max() * settings.duration)
    assert truth_left > 0.2  # a quarter of the first mode is left
    assert settings.time_constant is not None
    assert truth_left * np.exp(-settings.duration / settings.time_constant) < 0.003
    assert merged.frf.exponential_time_constant == settings.time_constant
    np.testing.assert_array_equal(merged.frf.averages, [[4]] * 3)
    assert error_at_resonances(LIGHT, merged) < 0.01


def test_without_that_window_the_same_taps_give_a_wrong_frf(tmp_path: Path) -> None:
    merged, _, _ = frf_of(light_taps(tmp_path), exponential=0.0)
    assert merged.frf.exponential_time_constant is None
    assert error_at_resonances(LIGHT, merged) > 0.1


def noisy_tests(folder: Path, structure: Structure, seed: int, light: bool) -> list[Path]:
    """Six taps in one recording with time to die out, or one in each of six that end while the structure rings."""
    bench = Bench(rate=5120.0, seconds=0.7 if light else 7.0, noise=2e-3, force_noise=1e-5)
    times = (0.05,) if light else (0.1, 1.25, 2.4, 3.55, 4.7, 5.85)
    return [
        write_taps(
            folder / f"{seed}_{k}.h5",
            structure,
            Hits(times, spread=0.3),
            RESPONSES[:2],
            replace(bench, seed=6 * seed + k),
        )
        for k in range(6 if light else 1)
    ]


@pytest.mark.long
@pytest.mark.parametrize("light", [False, True])
def test_dampings_lie_within_their_bars(tmp_path: Path, light: bool) -> None:
    """Poles of 12 noisy tests by an independent fit with the FRF's own variances: two standard errors hold 95 %."""
    structure, off = LIGHT if light else plate(), []
    for seed in range(12):
        merged, _, settings = frf_of(noisy_tests(tmp_path, structure, seed, light))
        frf, variance = merged.frf, merged.frf.entry_variance()
        assert (settings.time_constant is not None) == light
        assert variance is not None
        inside = (frf.frequencies > 20) & (frf.frequencies < 600) & frf.valid
        smooth = np.stack([np.convolve(v, np.ones(9) / 9, "same") for v in variance[:, :, 0].T], axis=1)
        between = correlation(int(inside.sum()), settings.time_constant, frf.frequencies[1])
        poles, covariance = fitted_poles(
            frf.laplace[inside], frf.values[inside, :, 0], np.sqrt(smooth[inside]), structure.poles, 2, between
        )
        error = poles - structure.poles
        off += list(np.abs(np.concatenate([error.real, error.imag])) / np.sqrt(np.diag(covariance)))
        assert np.abs(error.real / structure.poles.real).max() < 0.05
    share = float(np.mean(np.array(off) < 2))
    assert share > 0.88, share  # 96 numbers: 95 % less three standard deviations


def test_variances_of_entries_are_those_of_the_errors(tmp_path: Path) -> None:
    structure, ratios = plate(), []
    for seed in range(6):
        hits = Hits((0.6, 1.6, 2.6, 3.6, 4.6, 5.6, 6.6, 7.6))
        path = write_taps(
            tmp_path / f"{seed}.h5", structure, hits, RESPONSES, Bench(rate=2560.0, seconds=8.8, noise=3e-3, seed=seed)
        )
        frf = frf_of([path])[0].frf
        variance = frf.entry_variance()
        assert variance is not None
        inside = (frf.frequencies > 20) & (frf.frequencies < 600)
        for row, response in enumerate(RESPONSES):
            error = frf.values[inside, row, 0] - structure.frf(frf.laplace[inside], response, "P1:+Z", 2)
            ratios.append(np.mean(np.abs(error) ** 2) / np.mean(variance[inside, row, 0]))
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.15)


def test_a_single_tap_is_right_and_has_no_coherence(tmp_path: Path) -> None:
    structure = plate()
    path = write_taps(tmp_path / "a.h5", structure, Hits((0.1,)), RESPONSES, Bench(seconds=2.1, noise=1e-4))
    frf = frf_of([path])[0].frf
    assert frf.coherence is None
    assert frf.entry_variance() is None
    np.testing.assert_array_equal(frf.averages, [[1]] * 3)
    assert error_at_resonances(structure, frf_of([path])[0]) < 0.01


def test_taps_that_begin_with_their_recordings_count(tmp_path: Path) -> None:
    """As files cut at the trigger; a recording that begins within the contact has lost its impulse."""
    structure, bench = plate(), Bench(seconds=1.5, noise=1e-5)
    paths = [
        write_taps(tmp_path / f"{k}.h5", structure, Hits((0.0,)), RESPONSES, replace(bench, seed=k)) for k in range(3)
    ]
    merged, detected, settings = frf_of(paths)
    assert all(begins_with_recording(test.taps[0], settings) for test in detected)
    np.testing.assert_array_equal(merged.frf.averages, [[3]] * 3)
    assert error_at_resonances(structure, merged) < 0.01
    late = write_taps(tmp_path / "late.h5", structure, Hits((-0.0008,)), RESPONSES, bench)
    result = found_taps(test_of(late))
    assert "begins within the contact" in screened(result, choose_segments([result])).taps[0].reason


@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize("which", ["force", "response"])
def test_clipped_taps_are_left_out(tmp_path: Path, which: str, stated: bool) -> None:
    """Where the file tells its full scale, and where only flat tops tell it."""
    structure = plate()
    scale = (205.0, None) if which == "force" else (None, 195.0)
    bench = Bench(seconds=9.7, noise=1e-4, full_scale=scale, stated=stated, quantity="acceleration")
    path = write_taps(tmp_path / "a.h5", structure, Hits((*TIMES, 6.6, 8.1), spread=0.6), RESPONSES, bench)
    merged, [result], _ = frf_of([path])
    reasons = [each.reason for each in result.taps]
    peaks = np.array([abs(each.tap.peak) for each in result.taps])
    damaged = np.array(["overload" in reason for reason in reasons])
    assert 0 < damaged.sum() < 6
    assert all(f"the {which} on" in reason for reason in reasons if reason)
    assert peaks[damaged].min() > peaks[~damaged].max()
    assert error_at_resonances(structure, merged) < 0.01


def test_a_weak_second_hit_long_after_the_contact_is_found(tmp_path: Path) -> None:
    """4 % after 0.4 s: left in, the force window would cut it off and the FRF would be wrong by up to as much."""
    structure = plate()
    path = write_taps(
        tmp_path / "a.h5", structure, Hits(TIMES, again={2: (0.4, 0.04)}), RESPONSES, Bench(seconds=6.8, noise=1e-4)
    )
    merged, [result], _ = frf_of([path])
    assert [each.reason.partition(" once")[0] for each in result.taps] == ["", "", "double hit: 4.0 %", ""]
    assert error_at_resonances(structure, merged) < 0.01


def test_the_force_window_lowers_the_noise_of_the_frf(tmp_path: Path) -> None:
    structure = plate()
    path = write_taps(tmp_path / "a.h5", structure, Hits(TIMES), RESPONSES, Bench(seconds=6.8, noise=5e-3))
    errors = []
    for window in (None, 0.0):
        frf = frf_of([path], force_window=window)[0].frf  # type: ignore[arg-type]
        inside = (frf.frequencies > 20) & (frf.frequencies < 600)
        truth = structure.frf(frf.laplace[inside], "P1:+Z", "P1:+Z", 2)
        errors.append(float(np.linalg.norm(frf.values[inside, 0, 0] - truth)))
    assert errors[0] < 0.8 * errors[1]


def test_a_response_that_still_rings_at_the_next_tap_is_reported(tmp_path: Path) -> None:
    path = write_taps(tmp_path / "a.h5", LIGHT, Hits((0.1, 1.1, 2.1, 3.1)), RESPONSES, Bench(seconds=4.2, noise=1e-4))
    judged = [found_taps(test_of(path))]
    settings = choose_segments(judged)
    judged = [screened(each, settings) for each in judged]
    truth = np.exp(LIGHT.poles.real[0] * 1.0)
    assert response_decay(judged, settings).before == pytest.approx(truth, rel=0.4)


@pytest.mark.parametrize("first", [1.0, 0.05])
def test_hum_is_not_taken_for_a_response_that_rings(tmp_path: Path, first: float) -> None:
    """With a quiet time before the first tap, and without: the hum does not follow the taps, nor does it fall."""
    structure = plate()
    times = [first + t for t in (0.0, 1.007, 2.016, 3.021, 4.033, 5.038)]
    bench = Bench(seconds=times[-1] + 1.0, noise=1e-4, hum=3e-3)
    path = write_taps(tmp_path / "a.h5", structure, Hits(times), RESPONSES, bench)
    merged, _, settings = frf_of([path])
    assert settings.time_constant is None
    assert error_at_resonances(structure, merged) < 0.01
    assert merged.frf.coherence is not None
    hum = int(np.argmin(np.abs(merged.frf.frequencies - 50)))
    assert merged.frf.coherence[hum].min() < 0.9 < np.median(merged.frf.coherence[20:500])
