"""Headers of NPY, NPZ, WAV, MAT and UFF files that announce more, or less, than the file holds."""

import io
import struct
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat, wavfile

from acquisition.conversion.read_arrays import open_arrays
from millfrf.core import FileFormatError

VALUES = np.random.default_rng(0).standard_normal(200)
HELD = 8 * len(VALUES)
SHAPES = ("(4000000000,)", "(10, 400000000)", "(-1,)", "(2,)")


def _npy(shape: str, descr: str = "<f8") -> bytes:
    header = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}".encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + VALUES.tobytes()


def _npz(path: Path, content: bytes) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("x.npy", content)


def _refused(path: Path) -> str:
    """Message of the refusal of a file, which takes no memory."""
    tracemalloc.start()
    try:
        with pytest.raises(FileFormatError) as refusal:
            open_arrays(path)
        assert tracemalloc.get_traced_memory()[1] < 20_000_000
    finally:
        tracemalloc.stop()
    return str(refusal.value)


@pytest.mark.parametrize("suffix", [".npy", ".npz"])
@pytest.mark.parametrize("shape", SHAPES)
def test_a_numpy_array_of_another_size_than_it_announces(suffix: str, shape: str, tmp_path: Path) -> None:
    """Before: 29.8 GiB were allocated, or the first two samples of 200 were all."""
    path = tmp_path / f"a{suffix}"
    _npz(path, _npy(shape)) if suffix == ".npz" else path.write_bytes(_npy(shape))
    announced = 8 * int(np.prod([int(n) for n in shape.strip("()").split(",") if n]))
    assert _refused(
        path
    ) == f"{path}: array {'x' if suffix == '.npz' else 'a'} announces {announced} bytes and holds " + (
        f"{HELD}; it is damaged or cut short, save it again"
    )


def test_a_numpy_text_that_announces_too_much(tmp_path: Path) -> None:
    _npz(tmp_path / "a.npz", _npy("(1,)", "<U500000000"))
    assert "array x announces 2000000000 bytes and holds 1600" in _refused(tmp_path / "a.npz")


def test_arrays_of_all_sizes_are_read(tmp_path: Path) -> None:
    arrays = {"x": VALUES, "none": np.zeros((0, 3)), "number": np.array(2.5), "text": np.array(["a", "bc"])}
    np.savez_compressed(tmp_path / "a.npz", **arrays)
    fields = open_arrays(tmp_path / "a.npz").fields
    assert {name: value.tolist() for name, value in fields.items()} == {n: v.tolist() for n, v in arrays.items()}
    np.save(tmp_path / "b.npy", VALUES.reshape(2, 100).T)
    np.testing.assert_array_equal(open_arrays(tmp_path / "b.npy").fields["b"], VALUES.reshape(2, 100).T)


def _wav(path: Path) -> bytearray:
    wavfile.write(path, 100, (1000 * VALUES).astype(np.int16))
    return bytearray(path.read_bytes())


@pytest.mark.parametrize("announced", [0, 100, 398, 402, 4_000_000_000, 0xFFFFFFFF])
def test_a_wav_file_whose_data_are_of_another_size_than_announced(announced: int, tmp_path: Path) -> None:
    """Before: 3.73 GiB were allocated, or 50 of 200 samples were all."""
    path = tmp_path / "a.wav"
    content = _wav(path)
    struct.pack_into("<I", content, content.index(b"data") + 4, announced)
    path.write_bytes(content)
    assert _refused(path).endswith("it is damaged or cut short, record or export it again")


def test_a_large_wav_file_that_announces_too_much(tmp_path: Path) -> None:
    """Before: 931 GiB were allocated."""
    form = struct.pack("<IHHIIHH", 16, 1, 1, 100, 200, 2, 16)
    sizes = struct.pack("<IQQQI", 28, 10**12, 10**12, 10**12, 0)
    path = tmp_path / "a.wav"
    path.write_bytes(b"RF64\xff\xff\xff\xffWAVEds64" + sizes + b"fmt " + form + b"data\xff\xff\xff\xff" + bytes(400))
    assert "announces 1000000000000 bytes of data and holds 400" in _refused(path)


def test_other_chunks_of_a_wav_file_are_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "a.wav"
    content = _wav(path)
    at = content.index(b"data")
    note = b"LIST" + struct.pack("<I", 5) + b"hello\0"
    for chunks in (content[:at] + note + content[at:], content + note, content + b"\0"):
        path.write_bytes(chunks)
        assert open_arrays(path).fields["wav"].shape == (200, 1)


@pytest.mark.parametrize("dimensions", [(2**30, 2), (0, 2**30), (200, 1)])
def test_a_mat_array_of_other_dimensions_than_its_values(dimensions: tuple[int, int], tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    savemat(path, {"x": VALUES.reshape(100, 2)})
    path.write_bytes(path.read_bytes().replace(struct.pack("<ii", 100, 2), struct.pack("<ii", *dimensions)))
    if dimensions == (200, 1):
        assert open_arrays(path).fields["x"].shape == dimensions
    else:
        assert "is damaged" in _refused(path)


def test_a_compressed_mat_array_that_expands_too_far(tmp_path: Path) -> None:
    content = io.BytesIO()
    savemat(content, {"x": np.zeros(100_000_000, dtype="u1")}, do_compression=True)
    (tmp_path / "a.mat").write_bytes(content.getvalue())
    with pytest.raises(FileFormatError, match="expands too far"):
        open_arrays(tmp_path / "a.mat")


def test_a_uff_function_that_announces_too_many_points(tmp_path: Path) -> None:
    pyuff = pytest.importorskip("pyuff")
    path = tmp_path / "a.uff"
    record = pyuff.prepare_58(
        func_type=1, rsp_node=1, rsp_dir=3, ref_node=0, ref_dir=0, binary=0, abscissa_spacing=1, abscissa_inc=0.01,
        abscissa_min=0.0, num_pts=200, ordinate_spec_data_type=8, orddenom_spec_data_type=0, ord_data_type=4,
        x=0.01 * np.arange(200), data=VALUES, id1="a", rsp_ent_name="a", ref_ent_name="a", abscissa_axis_units_lab="s",
    )  # fmt: skip
    pyuff.UFF(str(path)).write_sets(record, "overwrite")
    path.write_text(path.read_text().replace(f"{4:10d}{200:10d}", f"{4:10d}{2_000_000_000:10d}"))
    assert "announces 2000000000 points and holds 200" in _refused(path)
