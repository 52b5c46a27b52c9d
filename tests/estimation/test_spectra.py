"""Spectra and FRFs against scipy, analytic filters and invariants."""

import tracemalloc
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from acquisition import Channel, Recording, RecordingWriter, StreamDescription
from estimation import (
    CrossSpectra,
    Frf,
    SpectralAccumulator,
    SpectralSettings,
    correct_high_pass,
    count_segments,
    cross_spectra,
    h1,
    h1_side_by_side,
    input_coherence,
    input_independence,
    join_parts,
    read_frf,
    settings_for,
    sum_tests,
    to_receptance,
    write_frf,
)
from estimation.spectra.coherence_functions import multiple_coherence
from millfrf.core import FileFormatError, InputError, accepting_edited

FORCES = tuple(Channel(f"f{a}", "force", "N", "TCP", f"+{a.upper()}") for a in "xy")
MOTIONS = tuple(Channel(f"a{a}", "acceleration", "m/s^2", "TCP", f"+{a.upper()}") for a in "xy")
RATE = 500.0


def accumulate(
    force: np.ndarray, motion: np.ndarray, settings: SpectralSettings, cuts: list[int] | None = None
) -> CrossSpectra:
    accumulator = SpectralAccumulator(FORCES, MOTIONS, RATE, settings)
    for part in zip(np.split(force, cuts or []), np.split(motion, cuts or []), strict=True):
        accumulator.add(*part)
    return accumulator.result()


@pytest.mark.parametrize("window", ["hann", "hamming", "boxcar"])
@pytest.mark.parametrize("detrend", ["constant", "linear", "none"])
@pytest.mark.parametrize("length", [128, 127])
def test_spectra_equal_scipy(window: str, detrend: str, length: int) -> None:
    rng = np.random.default_rng(3)
    force, motion = rng.standard_normal((2, 1000, 2)) + 2.0
    result = accumulate(force, motion, SpectralSettings(length, 0.5, window, detrend))
    for p in range(2):
        for q in range(2):
            trend = False if detrend == "none" else detrend
            # scipy's csd conjugates its first argument
            _, expected = signal.csd(
                force[:, q],
                motion[:, p],
                RATE,
                window,
                length,
                round(0.5 * length),
                detrend=trend,
            )
            np.testing.assert_allclose(result.cross_spectra[:, p, q], expected, rtol=1e-9, atol=1e-14)


@given(cuts=st.lists(st.integers(0, 1500), max_size=6), overlap=st.sampled_from([0.0, 0.5, 0.75]))
def test_any_division_into_blocks_gives_the_same_spectra(cuts: list[int], overlap: float) -> None:
    force, motion = np.random.default_rng(1).standard_normal((2, 1500, 2))
    settings = SpectralSettings(64, overlap, "hann")
    whole = accumulate(force, motion, settings)
    parts = accumulate(force, motion, settings, sorted(cuts))
    assert parts.n_segments == whole.n_segments
    np.testing.assert_allclose(parts.cross_spectra, whole.cross_spectra, rtol=1e-12, atol=1e-18)


def test_more_segments_than_a_batch_and_results_in_between() -> None:
    """Spectra of 39 segments, asked for once or again and again, against products of numpy's transforms."""
    force, motion = np.random.default_rng(9).standard_normal((2, 1280, 2))
    settings = SpectralSettings(64, 0.5, "boxcar", "none")
    lines = np.array([np.fft.rfft(np.hstack([force, motion])[k : k + 64], axis=0) for k in range(0, 1217, 32)])
    expected = np.einsum("skp,skq->kpq", lines, lines.conj()) * 2 / (RATE * 64 * len(lines))
    again = SpectralAccumulator(FORCES, MOTIONS, RATE, settings)
    for part in np.split(np.arange(1280), [64, 70, 300, 900]):
        again.add(force[part], motion[part])
        asked = again.result()
    assert asked.n_segments == len(lines) == 39
    for result in (asked, again.finish(), accumulate(force, motion, settings)):
        np.testing.assert_allclose(result.cross_spectra[1:-1], expected[1:-1, 2:, :2], rtol=1e-12, atol=1e-18)
        np.testing.assert_allclose(result.output_spectra[1:-1], expected[1:-1, 2:, 2:], rtol=1e-12, atol=1e-18)


def test_memory_is_bounded_whatever_the_length_of_the_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sums, a batch of transformed segments and the waiting samples: far less than a copy of the samples.

    How many threads hold their arrays at the moment of the peak depends on the load of the machine: one thread here.
    """
    monkeypatch.setattr("estimation.spectra.welch._WORKERS", 1)
    settings = SpectralSettings(2048, 0.5, "hann")
    peaks = []
    for n in (100_000, 400_000):
        force, motion = np.random.default_rng(1).standard_normal((2, n, 2))
        tracemalloc.start()
        try:
            accumulator = SpectralAccumulator(FORCES, MOTIONS, RATE, settings)
            accumulator.add(force, motion)
            accumulator.finish()
            peaks.append(tracemalloc.get_traced_memory()[1])
        finally:
            tracemalloc.stop()
    assert peaks[1] < 1.02 * peaks[0]
    assert peaks[1] < 0.5 * (force.nbytes + motion.nbytes)


def test_two_half_records_summed_equal_the_whole() -> None:
    force, motion = np.random.default_rng(1).standard_normal((2, 1024, 2))
    settings = SpectralSettings(128, 0.0, "boxcar")
    halves = [accumulate(force[part], motion[part], settings) for part in (slice(0, 512), slice(512, None))]
    np.testing.assert_allclose(
        sum_tests(halves).input_spectra, accumulate(force, motion, settings).input_spectra, rtol=1e-12
    )


def test_power_of_a_sine_and_of_white_noise() -> None:
    time = np.arange(50_000) / RATE
    sine = np.column_stack([3 * np.sin(2 * np.pi * 50 * time), np.zeros_like(time)])
    noise = np.random.default_rng(0).standard_normal((50_000, 2)) * 2
    result = accumulate(sine, noise, settings_for(RATE, 1.0, window="hann"))
    resolution = result.frequencies[1]
    assert np.real(result.input_spectra[:, 0, 0]).sum() * resolution == pytest.approx(4.5, rel=1e-6)
    assert np.real(result.output_spectra[:, 0, 0]).sum() * resolution == pytest.approx(4.0, rel=0.03)


def two_by_two(
    n: int, noise: float, seed: int, force: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Force, motion and the true 2 x 2 impulse responses (short, so that leakage is nil at this segment length)."""
    rng = np.random.default_rng(seed)
    taps = np.array([[[1.0, -0.4, 0.1], [0.3, 0.2, 0.0]], [[-0.5, 0.1, 0.05], [0.8, 0.3, -0.2]]])
    f = rng.standard_normal((n, 2)) if force is None else force
    x = np.stack([sum(np.convolve(f[:, q], taps[p, q])[:n] for q in range(2)) for p in range(2)], axis=1)
    return f, x + noise * x.std() * rng.standard_normal(x.shape), taps


def test_h1_recovers_a_non_reciprocal_matrix_in_the_right_orientation() -> None:
    force, motion, taps = two_by_two(200_000, 0.0, 5)
    frf = h1(accumulate(force, motion, SpectralSettings(512, 0.5, "hann")))
    truth = np.moveaxis(np.fft.rfft(taps, 512, axis=2), 2, 0)
    assert frf.values.shape == truth.shape
    np.testing.assert_allclose(frf.values, truth, atol=0.01)
    assert abs(frf.values[20, 0, 1] - truth[20, 1, 0]) > 0.3  # a transposed matrix would pass neither
    assert (frf.quantity, frf.unit) == ("accelerance", "m/s^2/N")


def test_multiple_coherence_and_covariance_follow_the_noise() -> None:
    """Gamma^2 = 1 - S_nn / S_pp; the covariance's mean square error ratio is 1."""
    settings = SpectralSettings(128, 0.5, "hann")
    ratios = []
    for seed in range(40):
        force, motion, taps = two_by_two(4000, 0.5, seed)
        spectra = accumulate(force, motion, settings)
        frf = h1(spectra)
        truth = np.moveaxis(np.fft.rfft(taps, 128, axis=2), 2, 0)
        assert frf.covariance is not None
        ratios.append((np.abs(frf.values - truth) ** 2)[2:-2] / frf.covariance.variance()[2:-2])
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.06)
    force, motion, taps = two_by_two(400_000, 0.5, 1)
    coherence = multiple_coherence(accumulate(force, motion, settings))
    truth = np.moveaxis(np.fft.rfft(taps, 128, axis=2), 2, 0)
    power = np.sum(np.abs(truth) ** 2, axis=2)
    noise = 0.25 * np.mean(np.sum(taps**2, axis=(1, 2)))
    np.testing.assert_allclose(coherence[2:-2], (power / (power + noise))[2:-2], atol=0.03)


def periodic_tests(seed: int) -> list[CrossSpectra]:
    """Two tests whose forces are fully dependent, in different ways."""
    tests = []
    for mix in ([1.0, 0.7], [0.4, -1.0]):
        drive = np.random.default_rng(seed).standard_normal(20_000)
        force, motion, _ = two_by_two(20_000, 0.0, seed, np.outer(drive, mix))
        tests.append(accumulate(force, motion, SpectralSettings(256, 0.5, "hann")))
    return tests


def test_dependent_inputs_are_reported_and_independent_after_stacking() -> None:
    tests = periodic_tests(2)
    np.testing.assert_allclose(input_coherence(tests[0])[5:, 0, 1], 1.0, atol=1e-9)
    single = input_independence(tests[0])
    assert single.rank.max() == 1
    assert "not independent" in single.warnings[0]
    with pytest.raises(InputError, match="at least 2 tests with different immersions"):
        h1(tests[0])
    both = sum_tests(tests)
    assert input_independence(both).independent.all()
    truth = np.moveaxis(np.fft.rfft(two_by_two(10, 0.0, 2)[2], 256, axis=2), 2, 0)
    for frf in (h1(both), h1_side_by_side(tests)):
        np.testing.assert_allclose(frf.values[3:-3], truth[3:-3], atol=0.05)


def test_a_line_without_independent_inputs_is_flagged_and_zero() -> None:
    rng = np.random.default_rng(0)
    common = signal.sosfilt(signal.butter(6, 50, fs=RATE, output="sos"), rng.standard_normal(40_000))
    own = signal.sosfilt(
        signal.butter(12, 120, "high", fs=RATE, output="sos"), rng.standard_normal((40_000, 2)), axis=0
    )
    force, motion, _ = two_by_two(40_000, 0.01, 0, common[:, None] * [1.0, 0.5] + own)
    frf = h1(accumulate(force, motion, SpectralSettings(250, 0.5, "hann")))
    # detrending takes the common part off the lowest lines
    low, high = (frf.frequencies > 5) & (frf.frequencies < 40), frf.frequencies > 150
    assert not frf.valid[low].any()
    assert frf.valid[high].all()
    assert not frf.values[~frf.valid].any()


@given(rotation=st.floats(0, 2 * np.pi), gain=st.floats(1e-3, 1e3))
def test_h1_turns_with_the_force_axes(rotation: float, gain: float) -> None:
    """H for forces B f is H B^-1: no axis or unit is special."""
    force, motion, _ = two_by_two(3000, 0.2, 8)
    mix = gain * np.array([[np.cos(rotation), -np.sin(rotation)], [np.sin(rotation), np.cos(rotation)]])
    settings = SpectralSettings(64, 0.5, "hann")
    plain, turned = (h1(accumulate(f, motion, settings)).values for f in (force, force @ mix.T))
    np.testing.assert_allclose(turned @ mix, plain, rtol=1e-8, atol=1e-10)


def test_receptance_and_the_sensor_high_pass() -> None:
    f = np.linspace(0, 50, 101)
    s = 2j * np.pi * f
    truth = 1 / (s**2 + 4 * s + (2 * np.pi * 17) ** 2)
    corner = 0.5
    passed = np.divide(s, s + 2 * np.pi * corner) * s**2 * truth
    frf = Frf(f, passed[:, None, None], ("TCP:+X",), ("TCP:+X",), "accelerance", "m/s^2/N", np.ones(101, dtype=bool))
    result = to_receptance(correct_high_pass(frf, [corner]))
    assert (result.quantity, result.unit) == ("receptance", "m/N")
    assert not result.valid[0]
    np.testing.assert_allclose(result.values[1:, 0, 0], truth[1:], rtol=1e-12)


def test_the_high_pass_of_a_force_is_taken_out_of_its_column() -> None:
    """Forces that two amplifiers of different corners pass: H1 of what is recorded, corrected, is H1 of the forces."""
    rng = np.random.default_rng(3)
    n, corners = 60_000, (2.0, 0.5)
    s = 2j * np.pi * np.fft.rfftfreq(n, 1 / RATE)
    force = rng.standard_normal((n, 2))
    motion = np.fft.irfft(np.fft.rfft(force @ [1.0, -0.7]) / (s**2 + 8 * s + (2 * np.pi * 10) ** 2), n)
    passes = [np.divide(s, s + 2 * np.pi * corner) for corner in corners]
    recorded = np.stack([np.fft.irfft(np.fft.rfft(force[:, k]) * passes[k], n) for k in range(2)], axis=1)
    settings = SpectralSettings(2000, 0.5, "hann")
    measured = np.stack([motion, 2 * motion], axis=1) + 1e-6 * rng.standard_normal((n, 2))
    truth, frf = (h1(accumulate(f, measured, settings)) for f in (force, recorded))
    result = correct_high_pass(frf, [None, None], corners)
    band = (frf.frequencies > 1) & (frf.frequencies < 30)
    scale = np.abs(truth.values[band]).max()
    assert np.abs(result.values - truth.values)[band].max() < 0.01 * scale
    assert np.abs(frf.values - truth.values)[band].max() > 0.1 * scale
    assert result.covariance is not None
    assert frf.covariance is not None
    ratio = result.covariance.variance()[band] / frf.covariance.variance()[band]
    expected = np.abs([passes[k][:: n // 2000][: len(frf.frequencies)][band] for k in range(2)]) ** 2
    np.testing.assert_allclose(ratio[:, 0, :], expected.T, rtol=1e-9)


def test_frf_files_round_trip_and_refuse_what_they_are_not(tmp_path: Path) -> None:
    force, motion, _ = two_by_two(4000, 0.3, 1)
    frf = h1(accumulate(force, motion, SpectralSettings(64, 0.5, "hann")))
    write_frf(tmp_path / "a.h5", frf)
    again = read_frf(tmp_path / "a.h5")
    np.testing.assert_array_equal(again.values, frf.values)
    assert again.covariance is not None
    np.testing.assert_array_equal(again.covariance.variance(), frf.covariance.variance())  # type: ignore[union-attr]
    (tmp_path / "b.h5").write_bytes(b"nothing")
    with pytest.raises(FileFormatError, match="not an HDF5 file"):
        read_frf(tmp_path / "b.h5")
    stream = StreamDescription("main", RATE, 0.0, (*FORCES, *MOTIONS))
    with RecordingWriter(tmp_path / "r.h5", [stream]) as writer:
        writer.append("main", np.hstack([force, motion]))
    with pytest.raises(FileFormatError, match=r"'millfrf.recording'"):
        read_frf(tmp_path / "r.h5")
    with h5py.File(tmp_path / "a.h5", "a") as file:
        file.attrs["quantity"] = "recepta"
    with pytest.raises(FileFormatError, match="was edited after it was written"):
        read_frf(tmp_path / "a.h5")
    with accepting_edited(), pytest.raises(FileFormatError, match="quantity 'recepta' is not known"):
        read_frf(tmp_path / "a.h5")
    image = (tmp_path / "a.h5").read_bytes()
    # the signature of a table of names: HDF5 finds the damage when it looks a name up
    (tmp_path / "b.h5").write_bytes(image.replace(b"SNOD", b"SNOX"))
    with pytest.raises(FileFormatError, match="missing or damaged"):
        read_frf(tmp_path / "b.h5")
    with Recording(tmp_path / "r.h5") as recording:
        from_file = cross_spectra(recording, SpectralSettings(64, 0.5, "hann"))
        np.testing.assert_allclose(h1(from_file).values, frf.values, rtol=1e-4, atol=1e-5)
        with pytest.raises(InputError, match="no channel qx"):
            cross_spectra(recording, SpectralSettings(64), excitations=["qx"])
        with pytest.raises(InputError, match="shorter than one segment"):
            cross_spectra(recording, SpectralSettings(10_000))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (SpectralSettings(4), "too short"),
        (SpectralSettings(64, 1.0), "overlap 1"),
        (SpectralSettings(64, 0.5, "flat"), "unknown window 'flat'"),
        (SpectralSettings(64, 0.5, "hann", "cubic"), "unknown detrend 'cubic'"),
    ],
)
def test_unusable_settings_are_refused(settings: SpectralSettings, message: str) -> None:
    with pytest.raises(InputError, match=message):
        SpectralAccumulator(FORCES, MOTIONS, RATE, settings)


def test_tests_that_differ_are_not_stacked() -> None:
    force, motion, _ = two_by_two(1000, 0.0, 1)
    single = accumulate(force, motion, SpectralSettings(64))
    other = SpectralAccumulator(FORCES, MOTIONS, 2 * RATE, SpectralSettings(64))
    other.add(force, motion)
    with pytest.raises(InputError, match="1000 Hz, test 1 at 500 Hz"):
        sum_tests([single, other.result()])


@pytest.mark.parametrize("overlap", [0.0, 0.5, 0.75])
def test_parts_of_a_recording_add_up_to_the_whole(tmp_path: Path, overlap: float) -> None:
    """The spectra of consecutive segments, joined, are those of all segments to rounding."""
    channels = (
        Channel("fx", "force", "N", "TCP", "+X"),
        Channel("ax", "acceleration", "m/s^2", "TCP", "+X", input_delay_s=1e-3),
    )
    path = tmp_path / "long.h5"
    with RecordingWriter(path, [StreamDescription("main", 500.0, 0.0, channels)], block_length=1000) as writer:
        writer.append("main", np.random.default_rng(7).standard_normal((50_000, 2)))
    settings = SpectralSettings(400, overlap, "hann")
    with Recording(path) as recording:
        whole = cross_spectra(recording, settings)
        count = count_segments(50_000, settings)
        edges = [0, 1, 37, 90, count]
        parts = [cross_spectra(recording, settings, segments=part) for part in pairwise(edges)]
        with pytest.raises(InputError, match=f"segments 3 to {count + 1} are requested, it has {count}"):
            cross_spectra(recording, settings, segments=(3, count + 1))
    joined = join_parts(parts)
    assert joined.n_segments == whole.n_segments == count
    assert joined.n_tests == 1
    assert joined.effective_averages == whole.effective_averages
    for name in ("input_spectra", "cross_spectra", "output_spectra"):
        theirs, ours = getattr(whole, name), getattr(joined, name)
        assert np.abs(ours - theirs).max() < 1e-14 * np.abs(theirs).max()
