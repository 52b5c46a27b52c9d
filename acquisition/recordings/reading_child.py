"""The program that reads a file for `guarded_reading` in a process of its own; it imports nothing of this package.

    python reading_child.py JOB FILE FOLDER

JOB ``mat`` or ``arrays``: FOLDER gets one NPY file an array and ``index.json``. JOB ``rehearsal``: a recording's
structure and texts are read, nothing is written. Exit code 3: one line on standard error says what is wrong.
"""

import importlib.util
import json
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np

REFUSED = 3
_SPARE_BYTES = 256_000_000
_EXPANSION = 16
_CPU_SECONDS = 5.0
_BYTES_A_SECOND = 20e6
_LARGEST_RATIO = 1100.0
"""No compression that HDF5 files use shrinks by more (deflate: 1032)."""
_LONGEST_CELL = 4096
"""Texts in a list of names or units."""


def limit(size: int) -> None:
    """Bound memory and time by the file's size (bytes), where the system can."""
    try:
        import resource
    except ImportError:  # Windows: the parent's clock must do
        return
    pages = int(Path("/proc/self/statm").read_text().split()[0]) if Path("/proc/self/statm").exists() else 0
    used = pages * resource.getpagesize() if pages else 1_000_000_000
    memory, seconds = used + _SPARE_BYTES + _EXPANSION * size, int(_CPU_SECONDS + size / _BYTES_A_SECOND)
    for kind, most in ((resource.RLIMIT_AS, memory), (resource.RLIMIT_CPU, seconds), (resource.RLIMIT_CORE, 0)):
        hard = resource.getrlimit(kind)[1]
        resource.setrlimit(kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def rehearse(path: Path, folder: Path) -> None:
    """Everything a reader of the recording will ask the library for, except the samples between first and last."""
    del folder
    try:
        file = _opened(path)
    except (OSError, ValueError):  # it does not open: the parent says so better
        return
    with file:
        dict(file.attrs)
        file.visititems(_look_at)


def _opened(path: Path) -> Any:
    """The file, or what a killed writer left of it, as the package opens it."""
    try:
        return h5py.File(path, "r")
    except OSError:
        described = importlib.util.spec_from_file_location("unclosed", Path(__file__).with_name("unclosed_file.py"))
        if described is None or described.loader is None:
            raise
        unclosed = importlib.util.module_from_spec(described)
        described.loader.exec_module(unclosed)
        return h5py.File(unclosed.UnclosedFile(path), "r")


def _look_at(name: str, item: Any) -> None:
    dict(item.attrs)
    if not isinstance(item, h5py.Dataset):
        return
    stored = item.id.get_storage_size()
    if item.dtype.hasobject:
        item[()]
    elif item.size and item.nbytes > _LARGEST_RATIO * stored + 1_000_000:
        raise ValueError(f"/{name} announces {item.nbytes} bytes but stores {stored}")
    elif item.ndim and item.size:
        item[0], item[-1]


def read_arrays(path: Path, folder: Path) -> None:
    """Every dataset, by its path with dots; MATLAB's own (version 7.3) have their axes turned round by the reader."""
    fields: dict[str, Any] = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and not name.startswith("#"):
            _look_at(name, item)
            fields[name.replace("/", ".")] = _cell_of_references(item) or _of_dataset(item)

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    _hand_over(fields, folder)


def _of_dataset(item: Any) -> Any:
    value = _as_complex(np.asarray(item[()]))
    if item.attrs.get("MATLAB_class") != b"char" or value.dtype.kind not in "iu":
        return value
    if item.attrs.get("MATLAB_empty"):
        return ""
    if value.ndim == 2 and min(value.shape) > 1:
        return ["".join(map(chr, row)).strip() for row in value.T.astype(int)]
    return "".join(map(chr, value.reshape(-1).astype(int)))


def _cell_of_references(item: Any) -> list[Any]:
    """Members of a MATLAB cell (version 7.3 keeps references to them); empty where it is none, or too long."""
    if item.attrs.get("MATLAB_class") != b"cell" or not 0 < item.size <= _LONGEST_CELL:
        return []
    members = [item.file[reference] for reference in item[()].reshape(-1)]
    for member in members:
        _look_at(member.name, member)
    return [_of_dataset(one) if isinstance(one, h5py.Dataset) else None for one in members]


def _as_complex(value: Any) -> Any:
    """MATLAB keeps complex numbers as pairs of fields."""
    return value["real"] + 1j * value["imag"] if value.dtype.names == ("real", "imag") else value


def read_mat(path: Path, folder: Path) -> None:
    """Every variable of a MAT file up to version 7; structures become ``structure.field``."""
    from scipy.io import loadmat

    limit(path.stat().st_size)  # scipy's own size is no matter of the file's
    fields: dict[str, Any] = {}
    for name, value in loadmat(path, squeeze_me=False, struct_as_record=True).items():
        if not name.startswith("__"):
            flatten(name, value, fields)
    _hand_over(fields, folder)


def flatten(name: str, value: Any, into: dict[str, Any]) -> None:
    """MATLAB structures become ``structure.field``."""
    if isinstance(value, np.ndarray) and value.dtype.names and value.size == 1:
        for field in value.dtype.names:
            flatten(f"{name}.{field}", value.reshape(-1)[0][field], into)
    else:
        into[name] = value


def _hand_over(fields: dict[str, Any], folder: Path) -> None:
    index = []
    for number, (name, value) in enumerate(fields.items()):
        entry: dict[str, Any] = {"name": name}
        if isinstance(value, str):
            entry["text"] = value
        elif texts := _texts(value):
            entry["texts"] = texts
        elif isinstance(value, np.ndarray) and not value.dtype.hasobject and not value.dtype.names:
            entry["file"] = f"{number}.npy"
            np.save(folder / entry["file"], value, allow_pickle=False)
        index.append(entry)
    (folder / "index.json").write_text(json.dumps(index), encoding="utf-8")


def _texts(value: Any) -> list[str]:
    """Texts of a cell or a string array that holds nothing else; empty where it does."""
    cell = isinstance(value, np.ndarray) and value.dtype.hasobject and not value.dtype.names
    members = list(value.reshape(-1)) if cell and value.size <= _LONGEST_CELL else value
    if not isinstance(members, list):
        return []
    texts = [_text(one) for one in members]
    return [one for one in texts if one is not None] if None not in texts else []


def _text(member: Any) -> str | None:
    """A text, the empty one of MATLAB (an array without entries) included; None where it is something else."""
    if isinstance(member, bytes):
        return member.decode("utf-8", "replace")
    if isinstance(member, np.ndarray) and (member.dtype.kind == "U" or member.size == 0) and member.size <= 1:
        return str(member.reshape(-1)[0]).strip() if member.size else ""
    return member.strip() if isinstance(member, str) else None


JOBS = {"rehearsal": rehearse, "arrays": read_arrays, "mat": read_mat}


def attempt(job: str, path: Path, folder: Path) -> str:
    """Do a job under limits of memory and time; returns what is wrong with the file, or an empty text."""
    limit(path.stat().st_size)
    try:
        JOBS[job](path, folder)
    except MemoryError:
        return "it asks for far more memory than its size"
    except Exception as error:  # damaged files make the libraries raise nearly anything
        return " ".join(str(error).split()) or type(error).__name__
    return ""


def main() -> int:
    """Do the job that the command line names; returns the exit code."""
    wrong = attempt(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3]))
    if wrong:
        print(wrong, file=sys.stderr)
    return REFUSED if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
