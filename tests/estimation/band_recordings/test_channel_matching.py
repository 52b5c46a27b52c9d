"""Channels are found at degrees of freedom, with the sign that turns them into the wanted direction."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from acquisition import Channel, RecordingWriter, StreamDescription
from estimation import channel_at, channels_of, names_at, read_band_recording
from millfrf.core import TIP, InputError

CHANNELS = (
    Channel("fx", "force", "N", "TCP", "-X"),
    Channel("ax", "acceleration", "m/s^2", "TCP", "+X", high_pass_hz=0.5),
    Channel("hx", "velocity", "m/s", "HOUSING", "-X"),
    Channel("speed", "angular_velocity", "rad/s"),
)


@pytest.mark.parametrize(
    ("label", "quantity", "found", "sign"),
    [
        ("TCP:+X", "force", "fx", -1.0),
        ("TCP:-X", "force", "fx", 1.0),
        ("TCP:-X", "acceleration", "ax", -1.0),
        ("HOUSING:-X", "velocity", "hx", 1.0),
    ],
)
def test_signs(label: str, quantity: str, found: str, sign: float) -> None:
    single = channel_at(CHANNELS, label, (quantity,))
    assert single is not None
    assert (single.channel.name, single.sign) == (found, sign)
    assert single.as_requested.degree_of_freedom == label


def test_what_is_not_there() -> None:
    assert channel_at(CHANNELS, "TCP:+Y", ("force",)) is None
    assert channel_at(CHANNELS, "TCP:+X", ("velocity",)) is None


def test_names_of_all_channels_at_places() -> None:
    assert names_at(CHANNELS, ("TCP:-X", "HOUSING:+X"), ("acceleration", "velocity")) == ("ax", "hx")
    assert names_at(CHANNELS, ("speed",), ("angular_velocity",)) == ()


def test_channels_in_memory() -> None:
    made = channels_of("acceleration", TIP[:2], ("a", "b"))
    assert [(each.name, each.unit, each.degree_of_freedom) for each in made] == [
        ("a", "m/s^2", "TCP:+X"),
        ("b", "m/s^2", "TCP:+Y"),
    ]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "cut.h5"
    with RecordingWriter(path, [StreamDescription("main", 100.0, 0.0, CHANNELS)], dtype="float64") as writer:
        writer.append("main", np.random.default_rng(0).normal(size=(500, 4)))
    return path


def test_columns_point_along_the_wanted_directions(file: Path) -> None:
    """Order, signs and the channels of the result, which describe the samples as they are."""
    read = read_band_recording(file, ["TCP:+X"], ["HOUSING:-X", "TCP:-X"], 100.0)
    raw = np.random.default_rng(0).normal(size=(500, 4))
    np.testing.assert_array_equal(read.force[:, 0], -raw[:, 0])
    np.testing.assert_array_equal(read.response, raw[:, [2, 1]] * [1.0, -1.0])
    assert [each.degree_of_freedom for each in (*read.excitations, *read.responses)] == [
        "TCP:+X",
        "HOUSING:-X",
        "TCP:-X",
    ]
    assert (read.name, read.channels, read.orders.tolist()) == ("cut", ("fx", "hx", "ax"), [1, 2])


def test_a_missing_channel_is_named_with_what_is_there(file: Path) -> None:
    with pytest.raises(InputError, match=r"no force or voltage at TCP:\+Y, which is needed; it has fx \(force"):
        read_band_recording(file, ["TCP:+Y"], ["TCP:+X"], 100.0)


def test_values_that_are_not_finite_are_refused(file: Path) -> None:
    with h5py.File(file, "r+") as stored:
        stored.attrs["format_version"] = 1  # as another program writes it: without checksums
        stored["signals/main/samples"][100, 1] = np.nan
    with pytest.raises(InputError, match=r"cut.h5: channel ax holds values that are not finite"):
        read_band_recording(file, ["TCP:+X"], ["TCP:+X"], 100.0)
