"""HDF5 files: sizes that must be backed by bytes, and the hash of the content of results."""

import hashlib
import math
from typing import Any

import h5py
import numpy as np

from .content_hashes import HASH, state_of_hash
from .errors import FileFormatError

LARGEST_RATIO = 1100  # announced over stored bytes, at most: no compression of HDF5 shrinks more (deflate: 1032)
_SLACK = 1_000_000  # bytes that a table may announce before a running writer has stored them


def require_backed(file: h5py.File, path: object, *, checked_elsewhere: str = "") -> None:
    """Refuse a file with a table that announces more values than it has bytes for, before anything is allocated.

    Parameters
    ----------
    file
        Open file.
    path
        Its name, for the message.
    checked_elsewhere
        Name of tables that the caller checks itself.

    Raises
    ------
    FileFormatError
        A damaged or forged size.
    """
    size = file.id.get_filesize()

    def check(name: str, item: object) -> None:
        if not isinstance(item, h5py.Dataset) or name.rpartition("/")[2] == checked_elsewhere:
            return
        stored = min(item.id.get_storage_size(), size)
        if item.id.get_create_plist().get_nfilters():
            stored *= LARGEST_RATIO
        chunk = math.prod(item.chunks or (0,)) * item.dtype.itemsize
        announced = item.size * item.dtype.itemsize
        if announced > stored + max(_SLACK, min(2 * chunk, 64 * _SLACK)):
            raise FileFormatError(
                f"{path} is damaged: /{name} announces {announced} bytes but stores {stored}; take a copy of it"
            )

    file.visititems(check)


def hdf5_digest(file: h5py.File) -> str:
    """Return the SHA-256 of all names, attributes and datasets of a file, without its hash."""
    digest = hashlib.sha256()
    _add_attributes(digest, file)
    names: list[str] = []
    file.visit(names.append)
    for name in sorted(names):
        digest.update(name.encode("utf-8", "surrogateescape") + b"\0")
        item = file[name]
        _add_attributes(digest, item)
        if isinstance(item, h5py.Dataset):
            _add_array(digest, item[()])
    return digest.hexdigest()


def hdf5_state(file: h5py.File) -> str:
    """Return the state of the content hash of a file, see :func:`millfrf.core.content_hashes.state_of_hash`."""
    stated = file.attrs.get(HASH)
    return state_of_hash(file.attrs.get("format"), stated, "" if stated is None else hdf5_digest(file))


def _add_attributes(digest: "hashlib._Hash", item: Any) -> None:
    for name, value in sorted(item.attrs.items()):
        if name != HASH:
            digest.update(name.encode("utf-8", "surrogateescape") + b"\0")
            _add_array(digest, value)


def _add_array(digest: "hashlib._Hash", value: Any) -> None:
    array = np.asarray(value)
    if array.dtype.kind in "OSU":  # text: as it reads, however it is stored
        digest.update(repr(array.tolist()).encode("utf-8", "surrogateescape") + b"\0")
    else:
        digest.update(f"{array.dtype.str}{array.shape}".encode() + np.ascontiguousarray(array).tobytes())
