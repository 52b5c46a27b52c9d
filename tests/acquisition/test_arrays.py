"""`Recording.from_arrays`: a recording of arrays in memory, the same as the file that it is saved to."""

import gc
import pickle
from pathlib import Path

import numpy as np
import pandas
import pint
import pytest

from acquisition import Channel, Recording
from millfrf.core import InputError

RATE = 1000.0
FORCE = np.sin(60 * np.arange(2000) / RATE)
MOTION = np.cos(60 * np.arange(2000) / RATE)
PLACES = {"fx": "kN TCP:+X", "ax": "g HOUSING:-Y"}


def _recording() -> Recording:
    return Recording.from_arrays({"fx": FORCE, "ax": MOTION}, RATE, PLACES, title="a cut", setup="[tool]\nteeth = 2\n")


def test_channels_are_described_in_two_words_and_stored_in_si_units() -> None:
    stream = _recording().stream()
    assert stream.channels == (
        Channel("fx", "force", "N", "TCP", "+X"),
        Channel("ax", "acceleration", "m/s^2", "HOUSING", "-Y"),
    )
    assert stream.sample_rate == RATE
    np.testing.assert_allclose(stream.read(), np.stack([1000 * FORCE, 9.80665 * MOTION], axis=1))


def test_columns_mappings_and_quantities_give_one_recording() -> None:
    units = pint.UnitRegistry()
    of_mapping = _recording().stream()  # a stream keeps the file of its recording
    of_columns = Recording.from_arrays(np.stack([FORCE, MOTION], axis=1), RATE, PLACES).stream()
    described = of_mapping.channels
    of_channels = Recording.from_arrays(of_mapping.read(), RATE, described).stream()
    quantities = {"fx": FORCE * units.kN, "ax": MOTION * units.standard_gravity}
    with_units = Recording.from_arrays(quantities, 1 * units.kHz, {"fx": "TCP:+X", "ax": "HOUSING:-Y"}).stream()
    of_table = Recording.from_arrays(pandas.DataFrame({"ax": MOTION, "fx": FORCE}), RATE, PLACES).stream()
    for other in (of_columns, of_channels, with_units, of_table):
        assert other.channels == described
        assert other.sample_rate == RATE
        np.testing.assert_allclose(other.read(), of_mapping.read())


def test_single_precision_is_kept() -> None:
    narrow = {"fx": FORCE.astype(np.float32), "ax": MOTION.astype(np.float32)}
    recording = Recording.from_arrays(narrow, RATE, {"fx": "N TCP:+X", "ax": "m/s^2 TCP:+X"})
    assert recording.stream().dtype == np.float32
    assert _recording().stream().dtype == np.float64


def test_a_saved_recording_is_the_same(tmp_path: Path) -> None:
    made = _recording()
    made.save(tmp_path / "cut.h5")
    with Recording(tmp_path / "cut.h5") as read:
        assert (read.title, read.setup, read.complete) == ("a cut", "[tool]\nteeth = 2\n", True)
        assert read.stream().channels == made.stream().channels
        np.testing.assert_array_equal(read.stream().read(), made.stream().read())
    with pytest.raises(InputError, match=r"cut\.csv: this command writes \.h5"):
        made.save(tmp_path / "cut.csv")


def test_a_pickle_carries_the_samples_and_nothing_stays_on_the_disk() -> None:
    made = _recording()
    kept, folder, samples = pickle.dumps(made), made.path.parent, made.stream().read()
    assert folder.is_dir()
    del made
    gc.collect()
    assert not folder.exists()
    np.testing.assert_array_equal(pickle.loads(kept).stream().read(), samples)


def test_its_name_is_that_of_its_file_in_messages() -> None:
    recording = Recording.from_arrays({"fx": FORCE}, RATE, {"fx": "N TCP:+X"}, name="slot_1")
    assert repr(recording).startswith("Recording: slot_1.h5, 1 stream")


def test_a_path_is_checked_and_a_closed_recording_says_so() -> None:
    with pytest.raises(InputError, match="path 3: give the name of a file"):
        Recording(3)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="path None: give the name of a file"):
        _recording().save(None)  # type: ignore[arg-type]
    with _recording() as recording:
        stream = recording.stream()
    with pytest.raises(InputError, match=r"recording\.h5: the recording was closed; open it again$"):
        stream.read()


BAD = {
    "a vector": ((FORCE, RATE, PLACES), r"signals of shape \(2000,\): give \(n_samples, n_channels\)"),
    "transposed": ((np.stack([FORCE, MOTION]), RATE, PLACES), r"shape \(2, 2000\) for 2 channels.*signals\.T"),
    "another length": (({"fx": FORCE, "ax": MOTION[:-1]}, RATE, PLACES), "fx has 2000 samples, ax has 1999"),
    "no description": (({"fx": FORCE, "ay": MOTION}, RATE, PLACES), "no description of ay; describe fx, ay"),
    "of nothing": (({"fx": FORCE}, RATE, PLACES), "no signal ax; there are fx"),
    "no unit": (({"fx": FORCE}, RATE, {"fx": "TCP:+X"}), "channel fx: 'TCP:.X' has no unit; write unit and place"),
    "an unknown unit": (({"fx": FORCE}, RATE, {"fx": "furlong^3 TCP:+X"}), "fx: furlong.3 is no unit of"),
    "no place": (({"fx": FORCE}, RATE, {"fx": "N TCP"}), "fx: .*TCP"),
    "a direction": (({"fx": FORCE}, RATE, {"fx": "N TCP:X"}), "degree of freedom TCP:X is not understood"),
    "no text": (({"fx": FORCE}, RATE, {"fx": 3}), "channels: fx 3: give unit and place"),
    "a number as name": (({3: FORCE}, RATE, {3: "N TCP:+X"}), "channels: 3: give the name of a channel as a text"),
    "no rate": (({"fx": FORCE}, 0.0, {"fx": "N TCP:+X"}), "sample rate 0.0 Hz must be positive"),
    "a rate of text": (({"fx": FORCE}, "fast", {"fx": "N TCP:+X"}), "rate 'fast': give a number, in Hz"),
    "a rate of metres": (({"fx": FORCE}, 3 * pint.UnitRegistry().m, {"fx": "N TCP:+X"}), "rate 3 meter: .* Hz"),
    "texts": (({"fx": ["a", "b"]}, RATE, {"fx": "N TCP:+X"}), "signal fx: give real numbers"),
    "complex": (({"fx": 1j * FORCE}, RATE, {"fx": "N TCP:+X"}), "signal fx: give real numbers"),
    "gaps": (({"fx": np.array([1.0, np.nan])}, RATE, {"fx": "N TCP:+X"}), "channel fx holds NaN or infinity"),
    "no samples": (({"fx": FORCE[:0]}, RATE, {"fx": "N TCP:+X"}), "the signals hold no sample"),
    "nothing": ((None, RATE, PLACES), "signals None: give an array"),
    "no channels": ((np.stack([FORCE, MOTION], axis=1), RATE, None), "channels None: give a mapping"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_recording_is_refused_in_one_line(name: str) -> None:
    given, message = BAD[name]
    with pytest.raises(InputError, match=message) as refused:
        Recording.from_arrays(*given)  # type: ignore[arg-type]
    assert "\n" not in str(refused.value)
