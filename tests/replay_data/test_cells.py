"""The simulated cells as sources of recordings: shape, repeatability, content, refusals."""

import math
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import csd

from acquisition import Recording, Source, StreamDescription, record
from millfrf.core import InputError
from millfrf.cutting import MillingProcess
from modal_fit import ModalModel
from replay_data import (
    HammerCell,
    LinearSweep,
    MillingCell,
    Sensor,
    default_structure,
    dynamometer,
    hammer_sensors,
    milling_sensors,
    table_one_model,
)

RPM = math.pi / 30
STRUCTURE = default_structure()
CUTTER = MillingProcess(2, 12.7e-3, math.pi / 2, 119e6, 0.17, 0.33, math.pi / 2, math.pi, 0.15e-3)


def silent(sensors: tuple[Sensor, ...]) -> tuple[Sensor, ...]:
    return tuple(replace(sensor, noise=0.0, high_pass_hz=None) for sensor in sensors)


def milling(duration: float = 0.5, **options: object) -> MillingCell:
    return MillingCell(STRUCTURE, CUTTER, 1e-3, 800 * RPM, duration, **options)  # type: ignore[arg-type]


def test_a_cell_is_a_source_of_consecutive_blocks() -> None:
    cell = milling(0.3, block_length=1000)
    (stream,) = cell.streams
    assert isinstance(stream, StreamDescription)
    assert [channel.degree_of_freedom for channel in stream.channels[2:4]] == ["TCP:+Z", "HOUSING:+X"]
    assert stream.channels[3].high_pass_hz == 0.1
    cell.open()
    blocks = []
    while (block := cell.read()) is not None:
        blocks.append(block)
    cell.close()
    assert [block.first_sample for block in blocks] == [0, 1000, 2000, 3000]
    assert sum(len(block.samples) for block in blocks) == cell.n_samples == 3072
    assert all(block.stream == stream.name and block.samples.shape[1] == 6 for block in blocks)


def test_a_cell_is_recorded_like_any_hardware(tmp_path: Path) -> None:
    """Also bit by bit: 24 bits of a range that is no power of two survive float32 to half a step."""
    cell: Source = milling(0.3, seed=9)
    record(cell, tmp_path / "cut.h5")
    with Recording(tmp_path / "cut.h5") as recording:
        stored = recording.stream().read()
        assert recording.complete
        assert recording.setup == cell.setup
        assert recording.stream().channels == cell.streams[0].channels
    steps = np.array([sensor.resolution for sensor in milling_sensors()])
    assert (np.abs(stored - milling(0.3, seed=9).samples()) <= 0.5 * steps).all()


@pytest.mark.parametrize("material", ["homogeneous", "porous"])
def test_the_seed_alone_decides_the_recording(material: str) -> None:
    first = milling(material=material, seed=5).samples()
    np.testing.assert_array_equal(milling(material=material, seed=5, block_length=333).samples(), first)
    assert np.abs(milling(material=material, seed=6).samples() - first).max() > 0


def test_a_cell_can_be_opened_again() -> None:
    cell = milling(0.2)
    np.testing.assert_array_equal(cell.samples(), cell.samples())


def test_noise_is_the_stated_share_of_each_signal() -> None:
    clean = milling(4.0, sensors=silent(milling_sensors())).samples()
    noisy = milling(4.0, sensors=tuple(replace(s, high_pass_hz=None) for s in milling_sensors(0.02, 0.05))).samples()
    share = (noisy - clean).std(axis=0) / clean.std(axis=0)
    np.testing.assert_allclose(share, [0.02] * 3 + [0.05] * 3, rtol=0.02)


def test_oversampling_changes_the_recording_little() -> None:
    coarse, fine = (milling(2.0, sensors=silent(milling_sensors()), oversampling=n).samples() for n in (2, 8))
    np.testing.assert_array_less(np.abs(coarse - fine)[100:].std(axis=0), 5e-3 * fine.std(axis=0))


def test_the_setup_states_the_cut_but_not_the_structure() -> None:
    cell = MillingCell(STRUCTURE, CUTTER, 2e-3, LinearSweep(450 * RPM, 690 * RPM, 60.0), 60.0, seed=4)
    setup = tomllib.loads(cell.setup)
    assert setup["test"] == {"kind": "simulated milling", "seed": 4, "duration_s": 60.0}
    assert setup["cut"]["first_spindle_speed_rpm"] == pytest.approx(450)
    assert setup["cutting"]["exit_angle_deg"] == pytest.approx(180)
    assert "16.99" not in cell.setup


def forces_at_harmonics(material: str, n_harmonics: int) -> NDArray[np.float64]:
    """Singular values, largest 1, of the force spectra scaled to unit diagonal, at tooth-passing lines."""
    speed = 2 * math.pi * 1024 / 75  # 75 samples a turn at 1024 Hz: segments hold whole turns
    cell = MillingCell(STRUCTURE, CUTTER, 1e-3, speed, 40.0, sample_rate=10240.0, material=material,
                       sensors=silent(dynamometer()))  # fmt: skip
    samples = cell.samples()[20480:]
    segment = 750 * 8
    spectra = np.empty((segment // 2 + 1, 3, 3), dtype=complex)
    for p in range(3):
        for q in range(3):
            _, spectra[:, p, q] = csd(samples[:, q], samples[:, p], 10240.0, nperseg=segment, detrend="constant")
    lines = 16 * np.arange(1, n_harmonics + 1)
    picked = spectra[lines]
    scale = np.sqrt(np.real(np.einsum("kpp->kp", picked)))
    singular = np.linalg.svd(picked / scale[:, :, None] / scale[:, None, :], compute_uv=False)
    return np.asarray(singular / singular[:, :1])


def test_homogeneous_forces_are_one_signal_and_porous_forces_three() -> None:
    """Why one cut suffices in foam, and three engagements are needed in acetal (Mohammadi & Ahmadi, Figs. 5 and 10)."""
    homogeneous = forces_at_harmonics("homogeneous", 4)
    porous = forces_at_harmonics("porous", 4)
    assert homogeneous[:, 1].max() < 1e-6
    assert porous[:, 2].min() > 1e-3


def hammer_frf(structure: ModalModel) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    sensors = silent(hammer_sensors())
    cell = HammerCell(structure, taps=2, spacing=5.0, sensors=sensors, seed=2)
    spectra = np.fft.rfft(cell.samples().reshape(6, -1, 9), axis=1)
    force, motion = spectra[:, :, :3], spectra[:, :, 3:]
    inputs = np.einsum("tkp,tkq->kpq", force, force.conj())
    cross = np.einsum("tkp,tkq->kpq", motion, force.conj())
    frequencies = np.fft.rfftfreq(51200, 1 / 10240.0)
    band = (frequencies > 8) & (frequencies < 150)
    return frequencies[band], cross[band] @ np.linalg.inv(inputs[band])


def test_hammer_taps_give_the_receptance_at_tip_and_housing() -> None:
    """A segment holds one tap and its ring-down: ratio of spectra = FRF, but for exp(-3.04 * 5) that still rings."""
    frequencies, measured = hammer_frf(STRUCTURE)
    truth = STRUCTURE.receptance(frequencies) * -((2 * np.pi * frequencies) ** 2)[:, None, None]
    truth = np.concatenate([truth[:, 3:], truth[:, :3]], axis=1)
    error = np.abs(measured - truth).max(axis=0) / np.abs(truth).max(axis=0)
    assert error.max() < 1e-3


def test_hammer_taps_differ_in_height_and_repeat_by_seed() -> None:
    sensors = silent(hammer_sensors())
    cells = [HammerCell(STRUCTURE, taps=3, spacing=0.5, sensors=sensors, seed=seed) for seed in (1, 1, 2)]
    first, again, other = (cell.samples() for cell in cells)
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 1
    peaks = first[:, :3].reshape(9, -1, 3).max(axis=1)
    assert (peaks > 60).sum() == 9
    np.testing.assert_array_equal((peaks > 60).argmax(axis=1), np.repeat([0, 1, 2], 3))
    assert peaks.max(axis=1).std() > 5


def test_overload_is_clipped_at_full_scale() -> None:
    weak = tuple(replace(sensor, full_scale=5.0) for sensor in dynamometer(0.0))
    samples = milling(0.5, sensors=weak).samples()
    assert np.abs(samples).max() == 5.0
    assert (samples[:, 1] == 5.0).sum() > 50


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"material": "cheese"}, "unknown material 'cheese'; use homogeneous or porous"),
        ({"sample_rate": -1.0}, "sample rate = -1.0 Hz must be positive"),
        ({"oversampling": 0}, "oversampling = 0 must be a whole number"),
        ({"seed": -1}, "seed = -1 must be a whole number"),
        ({"sample_rate": 20.0}, "fewer than 8; raise sample_rate"),
        ({"sensors": (Sensor("a", "acceleration", "ELBOW:+X"),)}, r"has no ELBOW:\+X"),
        ({"sensors": (Sensor("f", "force", "HOUSING:+X"),)}, "forces act at TCP"),
    ],
)
def test_bad_input_is_refused_before_anything_runs(options: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        milling(**options)


def test_table_one_has_no_housing() -> None:
    with pytest.raises(InputError, match=r"has no HOUSING:\+X; it has TCP:\+X"):
        MillingCell(table_one_model(), CUTTER, 1e-3, 80.0, 1.0)


def test_reading_a_closed_cell_is_refused() -> None:
    with pytest.raises(InputError, match="not open"):
        milling().read()
