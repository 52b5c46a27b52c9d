"""Tests that hit or measured different points become one matrix; missing, repeated and different entries are found."""

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from simulated_taps import Bench, Hits, Structure, error_at_resonances, frf_of, plate, test_of, write_taps

from acquisition import Channel, Recording, RecordingWriter, StreamDescription
from estimation import choose_segments, found_taps, merge_taps, tap_sums
from millfrf.core import InputError

TIMES = (0.6, 2.1, 3.6)
QUICK = Bench(rate=2560.0, seconds=5.2, noise=1e-4)


def tapped(folder: Path, structure: Structure, at: str, responses: tuple[str, ...], seed: int = 0) -> Path:
    name = f"{at}_{len(responses)}_{seed}.h5".replace(":", "")
    return write_taps(folder / name, structure, Hits(TIMES, at=at), responses, replace(QUICK, seed=seed))


def test_a_roving_hammer_gives_columns(tmp_path: Path) -> None:
    structure = plate()
    places = ("P1:+Z", "P2:+Z", "P3:+Z", "P4:+Z")
    merged, _, _ = frf_of([tapped(tmp_path, structure, place, places[:2], k) for k, place in enumerate(places)])
    assert merged.frf.excitations == places
    assert merged.frf.responses == places[:2]
    assert error_at_resonances(structure, merged) < 0.01
    reciprocal = merged.frf.values[:, 0, 1] - merged.frf.values[:, 1, 0]
    assert np.abs(reciprocal).max() < 0.02 * np.abs(merged.frf.values).max()


def test_a_roving_sensor_gives_rows(tmp_path: Path) -> None:
    structure = plate()
    paths = [
        tapped(tmp_path, structure, "P1:+Z", ("P1:+Z", "P2:+Z"), 1),
        tapped(tmp_path, structure, "P1:+Z", ("P3:+Z",), 2),
        tapped(tmp_path, structure, "P1:+Z", ("P4:+Z",), 3),
    ]
    merged, _, _ = frf_of(paths)
    assert merged.frf.responses == ("P1:+Z", "P2:+Z", "P3:+Z", "P4:+Z")
    np.testing.assert_array_equal(merged.frf.averages, [[3]] * 4)
    assert error_at_resonances(structure, merged) < 0.01


def test_a_point_hit_in_two_files_is_averaged(tmp_path: Path) -> None:
    """The sums of both: as if all taps were in one file; the sensor that is in one file only has its taps alone."""
    structure = plate()
    first = tapped(tmp_path, structure, "P1:+Z", ("P1:+Z", "P2:+Z"), 1)
    second = tapped(tmp_path, structure, "P1:+Z", ("P1:+Z",), 2)
    merged, result, settings = frf_of([first, second])
    np.testing.assert_array_equal(merged.frf.averages, [[6], [3]])
    sums = [tap_sums(each, settings) for each in result]
    cross, power = (sum(getattr(each, name)[:, 0, 0] for each in sums) for name in ("cross", "input_power"))
    lines = merged.frf.valid
    n = len(lines)
    np.testing.assert_allclose(merged.frf.values[lines, 0, 0], (cross[:n] / power[:n])[lines], rtol=1e-12)
    alone = merge_taps(sums[:1]).frf
    np.testing.assert_allclose(merged.frf.values[:50, 1], alone.values[:50, 1], rtol=1e-12)
    output = sum(each.output_power[:, 0] for each in sums)
    ordinary = np.abs(cross) ** 2 / np.real(power * output)
    assert merged.frf.coherence is not None
    np.testing.assert_allclose(merged.frf.coherence[lines, 0, 0], ordinary[:n][lines], rtol=1e-9)


def test_a_hit_against_the_axis_turns_the_sign(tmp_path: Path) -> None:
    """One file calls the place P1:+Z, the other P1:-Z, where force and motion count positive the other way."""
    structure = plate()
    structure = Structure(
        structure.frequencies,
        structure.damping,
        structure.shapes | {"P1:-Z": -structure.shapes["P1:+Z"], "P2:-Z": -structure.shapes["P2:+Z"]},
    )
    paths = [
        tapped(tmp_path, structure, "P1:+Z", ("P1:+Z", "P2:+Z"), 1),
        tapped(tmp_path, structure, "P1:-Z", ("P1:+Z", "P2:-Z"), 2),
    ]
    merged, _, _ = frf_of(paths)
    assert merged.frf.excitations == ("P1:+Z",)
    assert merged.frf.responses == ("P1:+Z", "P2:+Z")
    np.testing.assert_array_equal(merged.frf.averages, [[6], [6]])
    assert error_at_resonances(structure, merged) < 0.01
    assert merged.disagreements[0].share < 1e-3


def robot() -> Structure:
    """Three directions at one point and at a second one: six shapes that have nothing in common."""
    shapes = np.random.default_rng(4).uniform(0.2, 0.9, (3, 6)) * np.sign(
        np.random.default_rng(5).uniform(-1, 1, (3, 6))
    )
    labels = [f"{node}:+{axis}" for node in ("TCP", "HOUSING") for axis in "XYZ"]
    return Structure(
        np.array([70.0, 130.0, 260.0]), np.array([0.03, 0.02, 0.02]), dict(zip(labels, shapes.T, strict=True))
    )


SIX = ("TCP:+X", "TCP:+Y", "TCP:+Z", "HOUSING:+X", "HOUSING:+Y", "HOUSING:+Z")


def test_three_files_tapped_in_x_y_z_give_three_columns(tmp_path: Path) -> None:
    structure = robot()
    merged, _, _ = frf_of([tapped(tmp_path, structure, f"TCP:+{axis}", SIX, k) for k, axis in enumerate("XYZ")])
    assert merged.frf.excitations == SIX[:3]
    assert merged.frf.values.shape[1:] == (6, 3)
    assert error_at_resonances(structure, merged) < 0.01


def test_oblique_hits_on_a_force_plate_are_separated(tmp_path: Path) -> None:
    """A fifth of each force goes along the next axis, and the plate measures it: one H1 of three inputs.

    Read one input at a time, the columns would be off by a fifth of their neighbours.
    """
    structure, turn = robot(), {"TCP:+X": "TCP:+Y", "TCP:+Y": "TCP:+Z", "TCP:+Z": "TCP:+X"}
    paths = [
        write_taps(
            tmp_path / f"{k}.h5",
            structure,
            Hits(TIMES, at=place, aside=(turn[place], 0.2)),
            SIX,
            replace(QUICK, seed=k),
            forces=SIX[:3],
        )
        for k, place in enumerate(turn)
    ]
    merged, result, settings = frf_of(paths)
    assert merged.frf.excitations == SIX[:3]
    assert error_at_resonances(structure, merged) < 0.01
    np.testing.assert_array_equal(merged.frf.averages, [[3, 3, 3]] * 6)
    alone = [tap_sums(each, settings) for each in result]  # the strongest axis of each file only
    assert [len(sums.excitations) for sums in alone] == [1, 1, 1]
    assert error_at_resonances(structure, merge_taps(alone)) > 0.05


def test_all_three_directions_in_one_recording(tmp_path: Path) -> None:
    structure = robot()
    path = write_taps(
        tmp_path / "a.h5",
        structure,
        Hits((0.6, 1.6, 2.6, 3.6, 4.6, 5.6), at=("TCP:+X", "TCP:+X", "TCP:+Y", "TCP:+Y", "TCP:+Z", "TCP:+Z")),
        SIX,
        Bench(rate=2560.0, seconds=6.8, noise=1e-4),
        forces=SIX[:3],
    )
    merged, [result], _ = frf_of([path])
    assert [each.tap.channel for each in result.taps] == [0, 0, 1, 1, 2, 2]
    np.testing.assert_array_equal(merged.frf.averages, [[2, 2, 2]] * 6)
    assert merged.frf.coherence is not None
    assert error_at_resonances(structure, merged) < 0.01


def test_entries_that_no_tap_gives_are_listed(tmp_path: Path) -> None:
    """The second sensor position was hit at one of three points only."""
    structure = plate()
    paths = [tapped(tmp_path, structure, place, ("P1:+Z",), k) for k, place in enumerate(("P1:+Z", "P2:+Z", "P3:+Z"))]
    paths.append(tapped(tmp_path, structure, "P1:+Z", ("P4:+Z",), 9))
    with pytest.raises(InputError, match=r"P4:\+Z / P2:\+Z, P4:\+Z / P3:\+Z .*2 of 6 entries are missing"):
        frf_of(paths)


def test_the_sensor_that_stood_elsewhere_is_seen(tmp_path: Path) -> None:
    """One of three files has its sensor at another point than its label states."""
    structure = plate()
    moved = Structure(structure.frequencies, structure.damping, structure.shapes | {"P2:+Z": structure.shapes["P4:+Z"]})
    paths = [
        tapped(tmp_path, each, "P1:+Z", ("P1:+Z", "P2:+Z"), k) for k, each in enumerate((structure, structure, moved))
    ]
    worst = frf_of(paths)[0].disagreements[0]
    assert (worst.test, worst.response) == (paths[2].name, "P2:+Z")
    assert worst.share > 0.2


def test_delays_and_high_passes_of_channels_are_taken_out(tmp_path: Path) -> None:
    """One response comes 2 ms late, as its channel states; one passes a first-order high-pass of 5 Hz."""
    structure = plate()
    plain = write_taps(tmp_path / "a.h5", structure, Hits(TIMES), ("P1:+Z", "P2:+Z"), replace(QUICK, noise=0.0))
    with Recording(plain) as recording:
        stream = recording.stream()
        samples, channels = stream.read(), list(stream.channels)
    late = round(2e-3 * QUICK.rate)
    samples[late:, 1] = samples[:-late, 1].copy()
    channels[1] = replace(channels[1], input_delay_s=late / QUICK.rate)
    samples[:, 2] = high_passed(samples[:, 2], 5.0, QUICK.rate)
    channels[2] = replace(channels[2], high_pass_hz=5.0)
    path = rewritten(tmp_path / "b.h5", samples, channels)
    merged, _, _ = frf_of([path])
    assert not merged.frf.valid[0]
    assert error_at_resonances(structure, merged) < 0.01


def high_passed(signal: np.ndarray, corner: float, rate: float) -> np.ndarray:
    """Through ``s / (s + 2 pi corner)``, exactly for the band of the samples, over a record that ends in rest."""
    padded = np.concatenate([signal, np.zeros(4 * len(signal))])
    s = 2j * np.pi * np.fft.rfftfreq(len(padded), 1 / rate)
    return np.asarray(np.fft.irfft(np.fft.rfft(padded) * s / (s + 2 * np.pi * corner), len(padded))[: len(signal)])


def rewritten(path: Path, samples: np.ndarray, channels: list[Channel]) -> Path:
    description = StreamDescription("main", QUICK.rate, 0.0, tuple(channels))
    with RecordingWriter(path, [description], dtype="float64") as writer:
        writer.append("main", samples)
    return path


def test_rates_that_differ_are_refused(tmp_path: Path) -> None:
    structure = plate()
    single = write_taps(tmp_path / "a.h5", structure, Hits(TIMES), ("P1:+Z",), QUICK)
    other = write_taps(tmp_path / "b.h5", structure, Hits(TIMES), ("P1:+Z",), replace(QUICK, rate=5120.0))
    with pytest.raises(InputError, match="2560 and 5120 Hz"):
        frf_of([single, other])


def test_taps_closer_than_the_segment_are_left_out_with_the_gap(tmp_path: Path) -> None:
    path = write_taps(tmp_path / "a.h5", plate(), Hits((0.6, 1.6, 2.6, 4.8)), ("P1:+Z",), replace(QUICK, seconds=7.0))
    _, [result], _ = frf_of([path], segment=2.0)
    assert [bool(each.reason) for each in result.taps] == [True, True, False, False]
    assert result.taps[0].reason == "the next hit follows after 1 s, within the segment of 2 s"


def test_windows_that_cut_into_contacts_are_refused(tmp_path: Path) -> None:
    path = write_taps(tmp_path / "a.h5", plate(), Hits(TIMES), ("P1:+Z",), QUICK)
    result = [found_taps(test_of(path))]
    for how, said in (
        ({"pre_trigger": 1e-4}, "pre-trigger of 0.* cuts into"),
        ({"force_window": 1e-3}, "force window of 1.* cuts into"),
        ({"segment": -1.0}, "must be positive"),
        ({"segment": 0.01}, "hold no response"),
    ):
        with pytest.raises(InputError, match=said):
            choose_segments(result, **how)  # type: ignore[arg-type]


def test_missing_samples_are_a_reason(tmp_path: Path) -> None:
    path = write_taps(tmp_path / "a.h5", plate(), Hits(TIMES), ("P1:+Z",), QUICK)
    with h5py.File(path, "r+") as file:
        file.attrs["format_version"] = 1  # as another program writes it: without checksums
        file["signals/main/samples"][int(2.2 * QUICK.rate), 1] = np.nan
    _, [result], _ = frf_of([path])
    assert [each.reason for each in result.taps] == ["", "missing samples: a1 is not finite", ""]
