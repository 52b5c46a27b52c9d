"""Conversion: round trips without a mapping, arrays of other programs with one."""

import csv
import json
import math
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from acquisition import Channel, EventAxis, Events, Recording, RecordingWriter, StreamDescription, convert
from millfrf.core import FileFormatError, InputError
from millfrf.core.runtime import notices_to

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
FORCE = Channel("fx", "force", "N", "TCP", "+X", full_scale=500.0, sensor="9255B, s/n 12", extra={"gain": 2})
SPEED = Channel("spindle, measured", "angular_velocity", "rad/s")
ACCELERATION = Channel("ax", "acceleration", "m/s^2", "HOUSING", "-X", high_pass_hz=0.5)
EVENTS = {"temperature": EventAxis(), "mark": EventAxis(texts=True)}
SETUP = '[tool]\nname = "Fräser Ø 12,7"\nteeth = 2\n'


def write_recording(path: Path, samples: np.ndarray, dtype: str = "float64", streams: int = 1) -> None:
    """Streams of 1000 Hz, 500 Hz ... with events and clock pairs."""
    channels = (FORCE, SPEED, ACCELERATION)[: samples.shape[1]]
    described = [StreamDescription(f"clock{k}", 1000.0 / (k + 1), 0.25 * k, channels) for k in range(streams)]
    texts = {"title": "Schnitt Nr. 1", "setup": SETUP, "recorded_at": "2026-01-02T03:04:05+00:00"}
    with RecordingWriter(path, described, dtype=dtype, event_axes=EVENTS, **texts) as writer:
        for k, stream in enumerate(described):
            writer.append(stream.name, samples * (k + 1))
            writer.append_clock_pair(stream.name, len(samples), 77.125)
        writer.append_event("temperature", np.array([0.1, 0.2]), np.array([293.15, 294.0]))
        writer.append_events(Events("mark", np.array([0.3, 0.4]), np.array([1.0, 2.0]), None, ("Eintritt, ü", "")))


def assert_same_recording(first: Path, second: Path) -> None:
    with Recording(first) as a, Recording(second) as b:
        assert (a.title, a.setup, a.recorded_at, a.complete) == (b.title, b.setup, b.recorded_at, b.complete)
        assert list(a.streams) == list(b.streams)
        for name, stream in a.streams.items():
            assert stream.description == b.stream(name).description
            assert [c.to_json() for c in stream.channels] == [c.to_json() for c in b.stream(name).channels]
            assert stream.dtype == b.stream(name).dtype
            np.testing.assert_array_equal(stream.read(), b.stream(name).read())
            np.testing.assert_array_equal(a.clock_pairs(name), b.clock_pairs(name))
        for name, series in a.events.items():
            np.testing.assert_array_equal(series.read(), b.events[name].read())
            assert series.read_texts() == b.events[name].read_texts()
            assert series.axis.texts == b.events[name].axis.texts
        assert list(a.events) == list(b.events)


@pytest.mark.long
@pytest.mark.parametrize("suffix", [".npz", ".mat", ".csv", ".h5"])
@settings(max_examples=25)
@given(
    rows=st.lists(
        st.lists(st.floats(-(2.0**99), 2.0**99, width=32), min_size=3, max_size=3).map(tuple), min_size=1, max_size=12
    ),
    dtype=st.sampled_from(["float32", "float64"]),
)
def test_a_recording_comes_back_from_every_format(
    tmp_path_factory: pytest.TempPathFactory, suffix: str, rows: list[tuple[float, ...]], dtype: str
) -> None:
    folder = tmp_path_factory.mktemp("c")
    samples = np.array(rows) * (math.pi if dtype == "float64" else 1.0)
    write_recording(folder / "a.h5", samples, dtype)
    assert convert(folder / "a.h5", folder / f"b{suffix}") == [folder / f"b{suffix}"]
    convert(folder / f"b{suffix}", folder / "c.h5")
    assert_same_recording(folder / "a.h5", folder / "c.h5")


@pytest.mark.parametrize("suffix", [".npz", ".mat"])
def test_several_clocks_come_back(tmp_path: Path, suffix: str) -> None:
    write_recording(tmp_path / "a.h5", np.random.default_rng(0).standard_normal((9, 2)), streams=3)
    convert(tmp_path / "a.h5", tmp_path / f"b{suffix}")
    convert(tmp_path / f"b{suffix}", tmp_path / "c.h5")
    assert_same_recording(tmp_path / "a.h5", tmp_path / "c.h5")
    with pytest.raises(InputError, match="one sample clock, this recording has clock0, clock1, clock2"):
        convert(tmp_path / "a.h5", tmp_path / "b.csv")
    assert not (tmp_path / "b.csv").exists()


@pytest.mark.parametrize("suffix", [".npz", ".mat", ".csv"])
def test_missing_samples_come_back(tmp_path: Path, suffix: str) -> None:
    rows = "".join(f"{k / 1000:.3f},{k % 7}\n" for k in range(200) if not 50 <= k < 60)
    (tmp_path / "a.csv").write_text(f"t (s),Fz (N)\n{rows}")
    convert(tmp_path / "a.csv", tmp_path / "a.h5")
    convert(tmp_path / "a.h5", tmp_path / f"b{suffix}")
    convert(tmp_path / f"b{suffix}", tmp_path / "c.h5")
    assert_same_recording(tmp_path / "a.h5", tmp_path / "c.h5")
    with Recording(tmp_path / "c.h5") as recording:
        assert np.isnan(recording.stream().read()[:, 0]).nonzero()[0].tolist() == list(range(50, 60))


def test_a_csv_begins_with_its_headings_and_is_described_beside_it(tmp_path: Path) -> None:
    said: list[str] = []
    data = np.random.default_rng(0).standard_normal((9, 2))
    write_recording(tmp_path / "a.h5", data)
    convert(tmp_path / "a.h5", tmp_path / "b.csv", provenance='{"sources": [{"file": "a.h5"}]}')
    with (tmp_path / "b.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    np.testing.assert_array_equal([float(row["spindle, measured [rad/s]"]) for row in rows], data[:, 1])
    assert [float(row["time [s]"]) for row in rows] == [k / 1000 for k in range(9)]
    side = json.loads((tmp_path / "b.csv-metadata.json").read_text())
    assert [column.get("schema:unitText") for column in side["tableSchema"]["columns"]] == ["s", "N", "rad/s"]
    assert side["dc:source"] == ["a.h5"]
    with (tmp_path / "b.csv").open("a") as file:
        file.write("0.009,1,2\n")
    with notices_to(said.append):
        convert(tmp_path / "b.csv", tmp_path / "c.h5")
    assert any("b.csv was changed after it was written" in line for line in said)


def test_a_csv_of_earlier_versions_is_read_by_the_lines_above_it(tmp_path: Path) -> None:
    write_recording(tmp_path / "a.h5", np.random.default_rng(1).standard_normal((9, 2)))
    convert(tmp_path / "a.h5", tmp_path / "b.csv")
    side = tmp_path / "b.csv-metadata.json"
    described = json.loads(side.read_text())["notes"][0]["recording"]
    side.unlink()
    lines = "".join(f"# {key}: {json.dumps(value)}\n" for key, value in described.items())
    (tmp_path / "b.csv").write_text(lines + (tmp_path / "b.csv").read_text())
    convert(tmp_path / "b.csv", tmp_path / "c.h5")
    assert_same_recording(tmp_path / "a.h5", tmp_path / "c.h5")


def test_progress_counts_samples(tmp_path: Path) -> None:
    write_recording(tmp_path / "a.h5", np.zeros((70000, 1)))
    seen: list[int] = []
    convert(tmp_path / "a.h5", tmp_path / "b.h5", progress=seen.append)
    assert seen == sorted(seen)
    assert len(seen) > 1
    assert seen[-1] == 70000


MAPPING = """
sample_rate = 100.0
[[channels]]
name = "fx"
array = "force"
quantity = "force"
unit = "kN"
node = "TCP"
direction = "+X"
full_scale = 2.0
[[channels]]
name = "ax"
array = "acc"
quantity = "acceleration"
unit = "g"
sensitivity = 0.1
offset = 0.5
"""


@pytest.mark.parametrize("kind", ["npz", "mat", "mat 7.3", "row vectors"])
def test_units_and_sensitivities_are_converted_from_any_container(tmp_path: Path, kind: str) -> None:
    force, acc = np.arange(5.0), 0.5 + 0.1 * np.arange(5.0)
    source = tmp_path / ("in.npz" if kind == "npz" else "in.mat")
    if kind == "npz":
        np.savez(source, force=force, acc=acc, other=np.zeros((2, 2)))
    elif kind == "mat 7.3":
        with h5py.File(source, "w", userblock_size=512) as file:
            file["force"], file["acc"] = force[np.newaxis], acc[np.newaxis]
    else:
        savemat(source, {"force": force, "acc": acc}, oned_as="row" if kind == "row vectors" else "column")
    (tmp_path / "map.toml").write_text(MAPPING)
    convert(source, tmp_path / "out.h5", tmp_path / "map.toml")
    with Recording(tmp_path / "out.h5") as recording:
        stream = recording.stream()
        np.testing.assert_allclose(stream.read(), np.arange(5.0)[:, None] * [1000.0, 9.80665], rtol=1e-12, atol=1e-12)
        assert (stream.sample_rate, [c.unit for c in stream.channels]) == (100.0, ["N", "m/s^2"])
        assert stream.channels[0].full_scale == 2000.0


def test_matlab_structures_are_reached_by_dots(tmp_path: Path) -> None:
    savemat(tmp_path / "in.mat", {"test": {"force": np.arange(4.0), "info": {"acc": 0.5 + np.zeros(4)}}})
    text = MAPPING.replace('"force"\nquantity', '"test.force"\nquantity').replace('"acc"', '"test.info.acc"')
    (tmp_path / "map.toml").write_text(text)
    convert(tmp_path / "in.mat", tmp_path / "out.h5", tmp_path / "map.toml")
    with Recording(tmp_path / "out.h5") as recording:
        np.testing.assert_array_equal(recording.stream().read(channels=["fx"])[:, 0], 1000 * np.arange(4.0))


CSV_MAPPING = """
time = "Zeit"
time_unit = "ms"
[csv]
delimiter = ";"
decimal = ","
skip_lines = 2
encoding = "cp1252"
[[channels]]
name = "y"
column = "Weg µm"
quantity = "displacement"
unit = "um"
[[channels]]
name = "f"
column = 2
quantity = "force"
unit = "N"
"""


def test_a_csv_of_another_program(tmp_path: Path) -> None:
    lines = ["Messung", "", "Zeit;Kraft;Weg µm", "5,0;1,5;-2", "5,5;2,5;3", "6,0;-1e1;4"]
    (tmp_path / "in.csv").write_text("\n".join(lines), encoding="cp1252")
    (tmp_path / "map.toml").write_text(CSV_MAPPING, encoding="utf-8")
    convert(tmp_path / "in.csv", tmp_path / "out.h5", tmp_path / "map.toml")
    with Recording(tmp_path / "out.h5") as recording:
        stream = recording.stream()
        assert (stream.sample_rate, stream.start_time) == (2000.0, 0.005)
        np.testing.assert_allclose(stream.read(), [[-2e-6, 1.5], [3e-6, 2.5], [4e-6, -10.0]], rtol=1e-14)
    (tmp_path / "in.csv").write_text("\n".join([*lines, "6,75;1;1"]), encoding="cp1252")
    with pytest.raises(FileFormatError, match=r"time Zeit is not evenly spaced: 0\.00075 s after row 3"):
        convert(tmp_path / "in.csv", tmp_path / "again.h5", tmp_path / "map.toml")


def test_axes_are_joined_in_time_and_split_into_files(tmp_path: Path) -> None:
    """Every element of a (channel, period, experiment, sample) array is found where it belongs."""
    array = np.arange(2 * 3 * 4 * 5.0).reshape(2, 3, 4, 5)
    np.save(tmp_path / "u.npy", array)
    (tmp_path / "map.toml").write_text(
        """
sample_rate = 10.0
axes = ["channel", "period", "experiment", "sample"]
join = ["period"]
split = "experiment"
[[channels]]
name = "second"
column = 2
quantity = "voltage"
unit = "mV"
"""
    )
    written = convert(tmp_path / "u.npy", tmp_path / "r.h5", tmp_path / "map.toml")
    assert [path.name for path in written] == ["r-1.h5", "r-2.h5", "r-3.h5", "r-4.h5"]
    for experiment, path in enumerate(written):
        with Recording(path) as recording:
            expected = np.concatenate([array[1, period, experiment] for period in range(3)]) * 1e-3
            np.testing.assert_allclose(recording.stream().read()[:, 0], expected, rtol=1e-15)


@pytest.mark.shared_data
@pytest.mark.parametrize("amplitude", [100, 200, 300])
def test_the_mirror_rig_is_converted_by_one_mapping(shared_data: Path, tmp_path: Path, amplitude: int) -> None:
    folder = shared_data / "fsm-cubespec-mimo"
    source = folder / f"u_{amplitude}mV_train.npy"
    written = convert(source, tmp_path / "rec.h5", EXAMPLES / "fsm_mapping.toml")
    assert [path.name for path in written] == [f"rec-{k}.h5" for k in range(1, 7)]
    inputs, outputs = np.load(source), np.load(folder / f"y_{amplitude}mV_train.npy")
    for experiment, path in enumerate(written):
        with Recording(path) as recording:
            stream = recording.stream()
            assert (stream.sample_rate, stream.n_samples) == (6400.0, 2 * 8192)
            assert [c.name for c in stream.channels_of("voltage")] == ["ux", "uy", "uz"]
            assert [c.degree_of_freedom for c in stream.channels_of("displacement")] == [
                f"MIRROR:+{axis}" for axis in "XYZ"
            ]
            samples = stream.read()
            np.testing.assert_array_equal(samples[8192:, :3], inputs[:, :, experiment, 1])
            np.testing.assert_array_equal(samples[:8192, 3:], outputs[:, :, experiment, 0])
            assert samples[:, :3].std() == pytest.approx(amplitude * 0.99e-3, rel=0.01)  # rms of SOURCE.md


@pytest.mark.shared_data
def test_a_matlab_file_with_row_vectors(shared_data: Path, tmp_path: Path) -> None:
    """Silverbox: variables V1 and V2 are (1, 131072)."""
    channels = "".join(
        f'[[channels]]\nname = "{name}"\narray = "{name}"\nquantity = "voltage"\nunit = "V"\n' for name in ("V1", "V2")
    )
    (tmp_path / "map.toml").write_text(f"sample_rate = 610.35\n{channels}")
    convert(shared_data / "silverbox" / "SNLS80mV.mat", tmp_path / "s.h5", tmp_path / "map.toml")
    with Recording(tmp_path / "s.h5") as recording:
        assert recording.stream().n_samples == 131072


TABLE_MAPPING = """
sample_rate = 50.0
[[channels]]
name = "f"
column = "Fx"
quantity = "force"
unit = "kN"
[[channels]]
name = "a"
column = "ax"
quantity = "acceleration"
unit = "g"
"""


def test_a_row_of_units_below_the_headings_is_no_row_of_numbers(tmp_path: Path) -> None:
    (tmp_path / "in.csv").write_text("Fx,ax\nkN,g\n0.5,1\n0.25,-1\n")
    (tmp_path / "map.toml").write_text(TABLE_MAPPING)
    convert(tmp_path / "in.csv", tmp_path / "out.h5", tmp_path / "map.toml")
    with Recording(tmp_path / "out.h5") as recording:
        np.testing.assert_allclose(recording.stream().read(), [[500.0, 9.80665], [250.0, -9.80665]])


@pytest.mark.parametrize("second", ["kN,1", "kN", "0.5,bad"])
def test_a_row_that_is_partly_numbers_is_not_taken_for_units(tmp_path: Path, second: str) -> None:
    (tmp_path / "in.csv").write_text(f"Fx,ax\n{second}\n0.25,-1\n")
    (tmp_path / "map.toml").write_text(TABLE_MAPPING)
    with pytest.raises(FileFormatError, match="line 2"):
        convert(tmp_path / "in.csv", tmp_path / "out.h5", tmp_path / "map.toml")


def test_the_sample_rate_may_stand_in_the_file(tmp_path: Path) -> None:
    mapping = MAPPING.replace("sample_rate = 100.0", 'sample_rate = "Fs"')
    (tmp_path / "map.toml").write_text(mapping)
    fields = {"force": np.arange(5.0), "acc": np.arange(5.0)}
    savemat(tmp_path / "in.mat", {**fields, "Fs": 2048})
    convert(tmp_path / "in.mat", tmp_path / "out.h5", tmp_path / "map.toml")
    with Recording(tmp_path / "out.h5") as recording:
        assert recording.stream().sample_rate == 2048.0
    for stored, said in ((np.ones(3), "holds 3 numbers"), (-1.0, "holds -1"), (np.nan, "holds nan")):
        savemat(tmp_path / "in.mat", {**fields, "Fs": stored})
        with pytest.raises(FileFormatError, match=said):
            convert(tmp_path / "in.mat", tmp_path / "again.h5", tmp_path / "map.toml")
    savemat(tmp_path / "in.mat", fields)
    with pytest.raises(FileFormatError, match=r"sample_rate = 'Fs': in.mat has no such array \(force, acc\)"):
        convert(tmp_path / "in.mat", tmp_path / "again.h5", tmp_path / "map.toml")
