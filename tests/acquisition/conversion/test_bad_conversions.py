"""What cannot be converted is refused in one clear line, and nothing is written."""

import pickle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition import Channel, Recording, RecordingWriter, StreamDescription, convert
from acquisition.conversion.mapping import load_mapping
from millfrf.core import InputError

GOOD = """
sample_rate = 100.0
[[channels]]
name = "fx"
array = "force"
quantity = "force"
unit = "N"
[[channels]]
name = "ax"
array = "acc"
quantity = "acceleration"
unit = "m/s^2"
"""


def refuse(folder: Path, source: Path, mapping: str | None, output: str = "out.h5") -> str:
    """The message of the refusal; nothing new may be left in the folder."""
    if mapping is not None:
        (folder / "map.toml").write_text(mapping)
    before = sorted(folder.iterdir())
    with pytest.raises(InputError) as caught:
        convert(source, folder / output, None if mapping is None else folder / "map.toml")
    assert sorted(folder.iterdir()) == before
    message = str(caught.value)
    assert "\n" not in message
    return message


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('unit = "N"', 'unit = "bananas"'), "channels[1]: unit 'bananas' is not a unit of force"),
        (('unit = "N"', 'unit = "mm"'), "unit 'mm' is not a unit of force"),
        (('quantity = "force"', 'quantity = "farce"'), "unknown quantity 'farce'"),
        (('name = "ax"', 'name = "fx"'), "channel fx appears twice"),
        (('name = "ax"', 'nmae = "ax"'), "channels[2]"),
        (("sample_rate = 100.0", "sample_rate = -1"), "sample_rate must be above 0, not -1"),
        (("sample_rate = 100.0", ""), "give either sample_rate (Hz) or time"),
        (
            ("sample_rate = 100.0", "sample_rate = 100.0\nsamplerate = 3"),
            "samplerate is not a known key; did you mean sample_rate",
        ),
        (("sample_rate = 100.0", "sample_rate = "), "is not TOML"),
        (('unit = "N"', 'unit = "N"\nsensitivity = 0'), "sensitivity 0 would divide by zero"),
        (('unit = "N"', 'unit = "N"\nnode = "TCP"\ndirection = "+Q"'), "TCP:+Q"),
        (("sample_rate = 100.0", 'sample_rate = 100.0\naxes = ["sample", "trial"]'), "axis trial is neither in join"),
        (('array = "acc"', 'array = "accel"'), "no array 'accel'; it has force, acc"),
        (('array = "acc"', 'array = "acc"\ncolumn = 3'), "column = 3 does not pick one of the 1 columns"),
        (('array = "acc"', 'array = "acc"\ncolumn = "ax"'), "no headings"),
    ],
)
def test_mapping_mistakes_are_named(tmp_path: Path, change: tuple[str, str], said: str) -> None:
    np.savez(tmp_path / "in.npz", force=np.ones(9), acc=np.ones(9))
    assert said in refuse(tmp_path, tmp_path / "in.npz", GOOD.replace(*change, 1))


def test_a_unit_that_the_name_of_an_array_contradicts_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "in.npz", force=np.ones(9), acc_g=np.ones(9))
    mapping = GOOD.replace('array = "acc"', 'array = "acc_g"')
    assert "acceleration in m/s^2 in the mapping, but array acc_g of in.npz is in g" in refuse(
        tmp_path, tmp_path / "in.npz", mapping
    )
    (tmp_path / "sure.toml").write_text(mapping + "sensitivity = 1.0\n")  # it says that the name is wrong
    convert(tmp_path / "in.npz", tmp_path / "sure.h5", tmp_path / "sure.toml")
    with Recording(tmp_path / "sure.h5") as recording:
        np.testing.assert_array_equal(recording.stream().read(channels=["ax"]), 1.0)


@pytest.mark.parametrize(
    ("acc", "said"),
    [
        (np.array([1.0, np.nan, 1.0]), "channel ax holds nan at sample 1"),
        (np.array([1.0, 1.0, -np.inf]), "channel ax holds -inf at sample 2"),
        (np.ones(4), "array force of in.npz: 1 x 3 samples, array acc of in.npz: 1 x 4 samples"),
        (np.ones(3) * 1j, "array acc is complex"),
        (np.array(["a", "b", "c"]), "not numbers"),
        (np.ones((3, 2)), "channel ax: column = None does not pick one of the 2 columns"),
        (np.ones((3, 1, 1)), "has 3 dimensions; name them in axes"),
        (np.array([{}, {}, {}]), "pickled"),
    ],
)
def test_unusable_arrays_are_named(tmp_path: Path, acc: np.ndarray, said: str) -> None:
    np.savez(tmp_path / "in.npz", force=np.ones(3), acc=acc)
    assert said in refuse(tmp_path, tmp_path / "in.npz", GOOD)


class _Trap:
    """Leaves a mark where it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return (Path.touch, (self.path,))  # type: ignore[return-value]


@pytest.mark.parametrize("suffix", [".npy", ".npz", ".mat"])
def test_nothing_is_unpickled(tmp_path: Path, suffix: str) -> None:
    source, mark = tmp_path / f"in{suffix}", tmp_path / "mark"
    source.write_bytes(pickle.dumps(_Trap(mark)))
    refuse(tmp_path, source, GOOD)
    np.save(tmp_path / "object.npy", np.array([_Trap(mark)]), allow_pickle=True)
    assert "pickled" in refuse(tmp_path, tmp_path / "object.npy", GOOD)
    assert not mark.exists()


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (["a,b", "1,2", "3"], "line 3 has 1 column, the rows around it have 2"),
        (["a,b", "1,2", "3,x"], "line 3, column 2: 'x' is not a number"),
        (["a,b", "1,2", "3,"], "line 3 has 1 column, the rows around it have 2"),
        (["a,b"], "no rows of numbers"),
        ([""], "no rows of numbers"),
        (["a,b", "1,2", "3,nan"], "holds nan at sample 1"),
    ],
)
def test_csv_mistakes_are_named(tmp_path: Path, lines: list[str], said: str) -> None:
    (tmp_path / "in.csv").write_text("\n".join(lines))
    mapping = 'sample_rate = 1.0\n[[channels]]\nname = "b"\ncolumn = "b"\nquantity = "force"\nunit = "N"\n'
    assert said in refuse(tmp_path, tmp_path / "in.csv", mapping)


def test_files_that_are_missing_or_of_no_known_kind(tmp_path: Path) -> None:
    np.save(tmp_path / "u.npy", np.ones(3))
    (tmp_path / "in.doc").write_text("x")
    further = 'sample_rate = 1.0\n[arrays.y]\nfile = {}\n[[channels]]\nname = "y"\narray = "y"\nquantity = "force"\n'
    further += 'unit = "N"\n'
    assert "no file" in refuse(tmp_path, tmp_path / "none.npy", GOOD)
    assert "give a mapping file" in refuse(tmp_path, tmp_path / "u.npy", None)
    assert "suffix '.doc'" in refuse(tmp_path, tmp_path / "in.doc", GOOD)
    assert "suffix '.xyz'; use .h5" in refuse(tmp_path, tmp_path / "u.npy", GOOD, "out.xyz")
    assert "y.npy" in refuse(tmp_path, tmp_path / "u.npy", further.format('"y.npy"'))
    assert "holds no 'v_'" in refuse(tmp_path, tmp_path / "u.npy", further.format('{ replace = "v_", by = "y_" }'))


def test_the_input_is_never_overwritten(tmp_path: Path) -> None:
    described = StreamDescription("main", 1.0, 0.0, (Channel("f", "force", "N"),))
    with RecordingWriter(tmp_path / "a.h5", [described]) as writer:
        writer.append("main", np.ones((3, 1)))
    assert "is the input itself" in refuse(tmp_path, tmp_path / "a.h5", None, "a.h5")


def test_one_bad_experiment_leaves_no_file_of_the_others(tmp_path: Path) -> None:
    array = np.ones((5, 3))
    array[2, 2] = np.nan
    np.save(tmp_path / "u.npy", array)
    mapping = 'sample_rate = 1.0\naxes = ["sample", "experiment"]\nsplit = "experiment"\n'
    mapping += '[[channels]]\nname = "u"\nquantity = "voltage"\nunit = "V"\n'
    assert "channel u holds nan at sample 2" in refuse(tmp_path, tmp_path / "u.npy", mapping)


@pytest.mark.long
@pytest.mark.parametrize("suffix", [".h5", ".npz", ".mat", ".csv"])
@settings(max_examples=60)
@given(data=st.data())
def test_damaged_files_give_an_error_or_a_recording(
    tmp_path_factory: pytest.TempPathFactory, suffix: str, data: st.DataObject
) -> None:
    """Cut short or with one byte changed: never anything but a recording or a one-line refusal."""
    folder = tmp_path_factory.mktemp("d")
    described = StreamDescription("main", 1.0, 0.0, (Channel("f", "force", "N"),))
    with RecordingWriter(folder / "a.h5", [described], setup="x = 1", recorded_at="2026-01-01") as writer:
        writer.append("main", np.linspace(0, 1, 50)[:, None])
    source = folder / f"b{suffix}"
    convert(folder / "a.h5", source)
    content = bytearray(source.read_bytes())
    position = data.draw(st.integers(0, len(content) - 1))
    if suffix == ".mat" or data.draw(st.booleans()):  # changed bytes in MAT files crash scipy's own reader
        content = content[:position]
    else:
        content[position] ^= data.draw(st.integers(1, 255))
    source.write_bytes(content)
    try:
        convert(source, folder / "c.h5")
    except InputError as error:
        assert "\n" not in str(error)  # noqa: PT017
        assert not (folder / "c.h5").exists()
    else:
        with Recording(folder / "c.h5") as recording:
            assert recording.streams


@settings(max_examples=40)
@given(text=st.text(max_size=60))
def test_any_text_as_mapping_is_refused_in_one_line(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    path = tmp_path_factory.mktemp("m") / "map.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_mapping(path)
    assert "\n" not in str(caught.value)
