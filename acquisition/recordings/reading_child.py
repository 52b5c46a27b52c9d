"""Program that reads a file for `guarded_reading` in a separate process; it imports nothing of this package.

    python reading_child.py JOB FILE FOLDER

JOB ``mat`` or ``arrays`` writes one NPY file per array and ``index.json`` into FOLDER. JOB ``check`` reads the
structure and the texts of a recording and writes nothing. Exit code 3: one line on standard error says what is wrong.
"""

import importlib.util
import json
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np

REFUSED = 3  # exit code
LONGEST_CELL = 4096  # texts in a list of names or units; a longer one is not read
LARGEST_RATIO = 1100.0  # announced over stored bytes, at most: no compression of HDF5 shrinks more (deflate: 1032)


def set_limits(size: int) -> None:
    """Bound memory and processor time by the file's size (bytes), if the system can."""
    try:
        import resource
    except ImportError:  # Windows: only the time limit of the parent applies
        return
    statm = Path("/proc/self/statm")
    pages = int(statm.read_text().split()[0]) if statm.exists() else 0
    used = pages * resource.getpagesize() if pages else 1_000_000_000
    memory = used + 256_000_000 + 16 * size  # arrays of a compressed file take several times its size
    seconds = int(5.0 + size / 20e6)
    for kind, limit in ((resource.RLIMIT_AS, memory), (resource.RLIMIT_CPU, seconds), (resource.RLIMIT_CORE, 0)):
        hard = resource.getrlimit(kind)[1]
        resource.setrlimit(kind, (limit if hard == resource.RLIM_INFINITY else min(limit, hard), hard))


def check_recording(path: Path, folder: Path) -> None:
    """Read everything that a reader of the recording requests, except the rows between the first and the last."""
    del folder
    try:
        file = _open(path)
    except (OSError, ValueError):  # the parent has a better message for a file that does not open
        return
    with file:
        dict(file.attrs)
        file.visititems(_read_ends)


def _open(path: Path) -> Any:
    """Open the file, or what a killed writer left of it, as the package does."""
    try:
        return h5py.File(path, "r")
    except OSError:
        spec = importlib.util.spec_from_file_location("unclosed", Path(__file__).with_name("unclosed_file.py"))
        if spec is None or spec.loader is None:
            raise
        unclosed = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(unclosed)
        return h5py.File(unclosed.UnclosedFile(path), "r")


def _read_ends(name: str, item: Any) -> None:
    """Read the attributes of an item, and of a dataset its first and last row; refuse a size that cannot be true."""
    dict(item.attrs)
    if not isinstance(item, h5py.Dataset):
        return
    stored = item.id.get_storage_size()
    if item.dtype.hasobject:
        item[()]
    elif item.size and item.nbytes > LARGEST_RATIO * stored + 1_000_000:
        raise ValueError(f"/{name} announces {item.nbytes} bytes but stores {stored}")
    elif item.ndim and item.size:
        item[0], item[-1]


def read_arrays(path: Path, folder: Path) -> None:
    """Read every dataset of an HDF5 file, named by its path with dots; MATLAB's version 7.3 is HDF5 too."""
    fields: dict[str, Any] = {}

    def visit(name: str, item: Any) -> None:
        place = name.replace("/", ".")
        within_object = any(place.startswith(f"{key}.") for key, value in fields.items() if isinstance(value, _Object))
        if name.startswith("#") or within_object:
            return
        if "MATLAB_object_decode" in item.attrs:
            fields[place] = _Object(bytes(item.attrs.get("MATLAB_class", b"")).decode("utf-8", "replace"))
        elif isinstance(item, h5py.Dataset):
            _read_ends(name, item)
            fields[place] = _cell_members(item) or _dataset_value(item)

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    _write_fields(fields, folder)


def _dataset_value(item: Any) -> Any:
    value = np.asarray(item[()])
    if value.dtype.names == ("real", "imag"):  # MATLAB's complex numbers
        value = value["real"] + 1j * value["imag"]
    if item.attrs.get("MATLAB_class") != b"char" or value.dtype.kind not in "iu":
        return value
    if item.attrs.get("MATLAB_empty"):
        return ""
    if value.ndim == 2 and min(value.shape) > 1:
        return ["".join(map(chr, row)).strip() for row in value.T.astype(int)]
    return "".join(map(chr, value.reshape(-1).astype(int)))


def _cell_members(item: Any) -> list[Any]:
    """Return the members of a MATLAB cell, which version 7.3 stores as references.

    The list is empty if the item is no cell, or too long.
    """
    if item.attrs.get("MATLAB_class") != b"cell" or not 0 < item.size <= LONGEST_CELL:
        return []
    members = [item.file[reference] for reference in item[()].reshape(-1)]
    for member in members:
        _read_ends(member.name, member)
    return [_dataset_value(member) if isinstance(member, h5py.Dataset) else None for member in members]


def read_mat(path: Path, folder: Path) -> None:
    """Read every variable of a MAT file up to version 7; structures become ``structure.field``.

    Members of an array of structures are counted as in MATLAB, ``Y(2).Data``. The name of a file's only structure is
    left out before them: dSPACE gives it the name of the file, and one mapping serves all files.
    """
    from scipy.io import loadmat  # here, because the other jobs do not need it

    set_limits(path.stat().st_size)  # again: the memory of scipy itself does not count
    variables = loadmat(path, squeeze_me=False, struct_as_record=True)
    names = [name for name in variables if not name.startswith("__")]
    fields: dict[str, Any] = {}
    for name in names:
        _flatten(name, variables[name], fields)
    if len(names) == 1 and any(")." in name for name in fields) and all(n.startswith(f"{names[0]}.") for n in fields):
        fields = {name.partition(".")[2]: value for name, value in fields.items()}
    _write_fields(fields, folder)


class _Object(str):
    """Class of an object of MATLAB, such as ``table``, whose content only MATLAB reads."""


def _flatten(name: str, value: Any, fields: dict[str, Any]) -> None:
    scipy_class = type(value).__name__  # no import, because the other jobs do not need scipy
    if scipy_class == "MatlabOpaque":  # its own name is in it; scipy keeps the last of several only
        variable, _, kind = (bytes(value[0][key]).decode("utf-8", "replace") for key in ("s0", "s1", "s2"))
        fields[variable or name] = _Object(kind)
        return
    if scipy_class == "MatlabFunction":
        fields[name] = _Object("function_handle")
        return
    if not (isinstance(value, np.ndarray) and value.dtype.names and 0 < value.size <= LONGEST_CELL):
        fields[name] = value
        return
    for number, member in enumerate(value.reshape(-1, order="F"), start=1):
        place = name if value.size == 1 else f"{name}({number})"
        for field in value.dtype.names:
            _flatten(f"{place}.{field}", member[field], fields)


def _write_fields(fields: dict[str, Any], folder: Path) -> None:
    index = []
    for number, (name, value) in enumerate(fields.items()):
        entry: dict[str, Any] = {"name": name}
        if isinstance(value, _Object):
            entry["object"] = str(value)
        elif isinstance(value, str):
            entry["text"] = value
        elif texts := _texts(value):
            entry["texts"] = texts
        elif isinstance(value, np.ndarray) and not value.dtype.hasobject and not value.dtype.names:
            entry["file"] = f"{number}.npy"
            np.save(folder / entry["file"], value, allow_pickle=False)
        index.append(entry)
    (folder / "index.json").write_text(json.dumps(index), encoding="utf-8")


def _texts(value: Any) -> list[str]:
    """Return the texts of a cell or string array that holds nothing else; otherwise an empty list."""
    is_cell = isinstance(value, np.ndarray) and value.dtype.hasobject and not value.dtype.names
    members = list(value.reshape(-1)) if is_cell and value.size <= LONGEST_CELL else value
    if not isinstance(members, list):
        return []
    texts = [_text(member) for member in members]
    return [text for text in texts if text is not None] if None not in texts else []


def _text(member: Any) -> str | None:
    """Return a text, also MATLAB's empty text (an array without entries); None for anything else."""
    if isinstance(member, bytes):
        return member.decode("utf-8", "replace")
    if isinstance(member, np.ndarray) and (member.dtype.kind == "U" or member.size == 0) and member.size <= 1:
        return str(member.reshape(-1)[0]).strip() if member.size else ""
    return member.strip() if isinstance(member, str) else None


JOBS = {"check": check_recording, "arrays": read_arrays, "mat": read_mat}


def attempt(job: str, path: Path, folder: Path) -> str:
    """Do a job under limits of memory and time; return what is wrong with the file, or an empty text."""
    set_limits(path.stat().st_size)
    try:
        JOBS[job](path, folder)
    except MemoryError:
        return "it needs far more memory than its size"
    except Exception as error:  # damaged files make the libraries raise nearly anything
        return " ".join(str(error).split()) or type(error).__name__
    return ""


if __name__ == "__main__":
    mistake = attempt(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3]))
    if mistake:
        print(mistake, file=sys.stderr)
    sys.exit(REFUSED if mistake else 0)
