"""Whether a file is whole, by its suffix: read to its end."""

import json
import tomllib
from pathlib import Path

import h5py
import numpy as np
from scipy.io import loadmat


def read_whole(path: Path) -> None:
    """Read a file to its end; raise whatever its reader says where it is not whole."""
    suffix = path.suffix
    assert path.stat().st_size, f"{path} is empty"
    if suffix == ".h5":
        _read_hdf5(path)
    elif suffix == ".npz":
        with np.load(path) as archive:
            assert all(archive[name] is not None for name in archive.files)
    elif suffix == ".mat":
        loadmat(path)
    elif suffix == ".json":
        json.loads(path.read_text(encoding="utf-8"))
    elif suffix == ".toml":
        tomllib.loads(path.read_text(encoding="utf-8"))
    else:
        _ends_in_order(path)


def _ends_in_order(path: Path) -> None:
    data = path.read_bytes()
    if path.suffix == ".csv":
        rows = [line for line in data.decode().splitlines() if not line.startswith("#")]
        assert data.endswith(b"\n")
        assert len({row.count(",") for row in rows}) == 1
    elif path.suffix == ".html":
        assert data.rstrip().endswith(b"</html>")
    elif path.suffix == ".png":
        assert data[:8] == b"\x89PNG\r\n\x1a\n"
        assert data.endswith(b"IEND\xaeB`\x82")
    elif path.suffix in (".uff", ".unv"):
        assert data.count(b"    -1") % 2 == 0
        assert data.rstrip().endswith(b"-1")
    else:
        raise AssertionError(f"no way to tell whether {path} is whole")


def _read_hdf5(path: Path) -> None:
    with h5py.File(path, "r") as file:
        complete = file.attrs.get("complete")
        assert complete is None or complete or "recovered" in str(file.attrs["ending"])

        def read(name: str, item: object) -> None:
            del name
            if isinstance(item, h5py.Dataset):
                item[()]

        file.visititems(read)
