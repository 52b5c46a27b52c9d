"""Channels that began at different times: sample k stands for the time that the recording states, less its delay."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from nptdms import ChannelObject, TdmsWriter

from acquisition import Recording, convert
from millfrf.core import FileFormatError, InputError

N, TONE = 400, 11.7  # samples; Hz


def write_tdms(path: Path, rate: float, starts: dict[str, float], lengths: dict[str, int] | None = None) -> None:
    """Write channels of one tone, each sampled from its own start on."""
    begin = np.datetime64("2026-03-02T10:00:00", "us")
    with TdmsWriter(path) as writer:
        for name, start in starts.items():
            n = (lengths or {}).get(name, N)
            values = np.sin(2 * np.pi * TONE * (start + np.arange(n) / rate))
            whole = int(np.floor(start * 1e3)) * 1000  # us; the rest is an offset
            properties = {
                "wf_start_time": begin + np.timedelta64(whole, "us"),
                "wf_start_offset": start - whole * 1e-6,
                "wf_increment": 1 / rate,
                "unit_string": "N" if name == "Fz" else "m/s^2",
            }
            writer.write_segment([ChannelObject("taps", name, values, properties=properties)])


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    rate=st.sampled_from([1000.0, 1024.0, 25600.0]),
    late=st.floats(0, 300),
    later=st.floats(0, 300),
    order=st.permutations(["Fz", "acc_z", "acc_x"]),
)
def test_every_sample_keeps_its_time(tmp_path: Path, rate: float, late: float, later: float, order: list[str]) -> None:
    """The starts differ by any number of samples; none is rounded away."""
    starts = dict(zip(order, (0.0, late / rate, later / rate), strict=True))
    write_tdms(tmp_path / "a.tdms", rate, starts)
    (tmp_path / "a.h5").unlink(missing_ok=True)
    convert(tmp_path / "a.tdms", tmp_path / "a.h5")
    with Recording(tmp_path / "a.h5") as recording:
        stream = recording.stream()
        samples = stream.read()
    assert stream.n_samples >= N - 301
    for column, channel in enumerate(stream.channels):
        times = stream.start_time + np.arange(stream.n_samples) / rate - (channel.input_delay_s or 0.0)
        assert times[0] >= starts[channel.name] - 1e-6
        np.testing.assert_allclose(samples[:, column], np.sin(2 * np.pi * TONE * times), atol=2 * np.pi * TONE * 3e-6)


def test_channels_without_common_time_are_refused(tmp_path: Path) -> None:
    write_tdms(tmp_path / "a.tdms", 1000.0, {"Fz": 0.0, "acc_z": 0.4})
    with pytest.raises(FileFormatError, match="no common time"):
        convert(tmp_path / "a.tdms", tmp_path / "a.h5")


def test_a_short_channel_is_cut_only_where_the_mapping_says_so(tmp_path: Path) -> None:
    write_tdms(tmp_path / "a.tdms", 1000.0, {"Fz": 0.0, "acc_z": 0.0}, {"acc_z": N - 37})
    with pytest.raises(InputError, match="acc_z holds 363 of 400 samples"):
        convert(tmp_path / "a.tdms", tmp_path / "a.h5")
    channels = "".join(
        f'[[channels]]\nname = "{name}"\narray = "taps/{name}"\nquantity = "{quantity}"\nunit = "{unit}"\n'
        for name, quantity, unit in (("Fz", "force", "N"), ("acc_z", "acceleration", "m/s^2"))
    )
    (tmp_path / "map.toml").write_text(channels)
    with pytest.raises(InputError, match="common_length = true in the mapping keeps the first 363"):
        convert(tmp_path / "a.tdms", tmp_path / "a.h5", tmp_path / "map.toml")
    (tmp_path / "map.toml").write_text("common_length = true\n" + channels)
    convert(tmp_path / "a.tdms", tmp_path / "a.h5", tmp_path / "map.toml")
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.stream().n_samples == 363


def time_record(values: np.ndarray, node: int, axis: np.ndarray, unit: str, motion: str, *, even: bool) -> str:
    """Data set 58 of a time record, as its definition lays it out."""
    step = axis[1] - axis[0] if even else 0.0
    columns = [values] if even else [axis, values]
    numbers = [f"{x:13.5e}" for x in np.column_stack(columns).reshape(-1)]
    lines = ["    -1", f"{58:6d}", "bench", "NONE", "01-Jan-26 10:00:00", "NONE", "NONE"]
    lines.append(f"{1:5d}{0:10d}{node:5d}{0:10d} {'NONE':<10}{node:10d}{-2:4d} {'NONE':<10}{0:10d}{0:4d}")
    lines.append(f"{2:10d}{len(values):10d}{int(even):10d}{axis[0]:13.5e}{step:13.5e}{0.0:13.5e}")
    for number, name, label in (
        (17, "Time", unit),
        (12, "Acceleration", motion),
        (0, "NONE", "NONE"),
        (0, "NONE", "NONE"),
    ):
        lines.append(f"{number:10d}{0:5d}{0:5d}{0:5d} {name:<20} {label:<20}")
    lines += ["".join(numbers[k : k + 6]) for k in range(0, len(numbers), 6)]
    return "\n".join([*lines, "    -1", ""])


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    unit=st.sampled_from(["s", "ms", "us", "NONE", "Seconds", "revolutions"]),
    motion=st.sampled_from(["g", "m/s^2", "m/s2", "mm/s^2"]),
    start=st.sampled_from([0.0, -0.125, 0.5]),
    later=st.integers(0, 40),
    even=st.booleans(),
)
def test_time_records_have_the_unit_and_the_start_of_their_file(
    tmp_path: Path, unit: str, motion: str, start: float, later: int, even: bool
) -> None:
    scale = {"ms": 1e3, "us": 1e6}.get(unit, 1.0)
    values = np.random.default_rng(2).normal(size=(2, 256)).astype(np.float32).astype(float)
    starts = (start, start + later / 256)
    records = [
        time_record(each, node, (begin + np.arange(256) / 256) * scale, unit, motion, even=even)
        for node, (each, begin) in enumerate(zip(values, starts, strict=True), 1)
    ]
    (tmp_path / "a.uff").write_text("".join(records))
    (tmp_path / "a.h5").unlink(missing_ok=True)
    if unit == "revolutions":
        with pytest.raises(FileFormatError, match="'revolutions', which is no unit of time"):
            convert(tmp_path / "a.uff", tmp_path / "a.h5")
        return
    convert(tmp_path / "a.uff", tmp_path / "a.h5")
    factor = {"g": 9.80665, "mm/s^2": 1e-3}.get(motion, 1.0)
    with Recording(tmp_path / "a.h5") as recording:
        stream = recording.stream()
        samples = stream.read()
    assert [channel.degree_of_freedom for channel in stream.channels] == ["1:-Y", "2:-Y"]
    assert stream.sample_rate == pytest.approx(256, rel=1e-6)
    assert stream.start_time == pytest.approx(starts[1], abs=1e-5)
    assert stream.n_samples == 256 - later
    np.testing.assert_allclose(samples[:, 0], factor * values[0, later:], rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(samples[:, 1], factor * values[1, : 256 - later], rtol=1e-5, atol=1e-6)
    wrong = "m/s^2" if factor != 1 else "g"
    channel = f'[[channels]]\nname = "a"\nquantity = "acceleration"\nunit = "{wrong}"\narray = "1:-Y"\n'
    (tmp_path / "map.toml").write_text(channel)
    with pytest.raises(InputError, match=r"in the mapping, but array 1:-Y of a\.uff is in"):
        convert(tmp_path / "a.uff", tmp_path / "b.h5", tmp_path / "map.toml")


def test_a_rate_is_checked_against_a_channel_of_time_stamps(tmp_path: Path) -> None:
    stamps = np.datetime64("2026-03-02T10:00:00", "us") + np.arange(N) * np.timedelta64(10_000, "us")
    with TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment([ChannelObject("rig", "Time", stamps), ChannelObject("rig", "Fz", np.ones(N))])
    channel = '[[channels]]\nname = "Fz"\nquantity = "force"\nunit = "N"\narray = "rig/Fz"\n'
    (tmp_path / "map.toml").write_text(f"sample_rate = 1000\n{channel}")
    with pytest.raises(InputError, match="sample_rate = 1000 Hz in the mapping, but time rig/Time says 100 Hz"):
        convert(tmp_path / "a.tdms", tmp_path / "a.h5", tmp_path / "map.toml")
