"""Ways in which a file gets damaged or is written by a hand that errs; each is told by one number."""

import io
import json
import re
from collections.abc import Callable, Iterator
from typing import Any

import h5py
import numpy as np

from millfrf.core.content_hashes import HASH, digest_of
from millfrf.core.hdf5_files import hdf5_digest

_WORDS = (
    b"nan", b"inf", b"-1", b"0", b"1e308", b"1e-308", b"99999999999999999999", b'""', b"null", b"true", b"[]", b"{}",
    b'"\\u0000"', b"[[[[[[[[", b"-0.0", b"1970-01-01", b"'''", b"\xff\xfe", b"\n\n", b"1,5",
)  # fmt: skip
_TOKEN = re.compile(rb'-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?|"[^"\n]*"|\b[A-Za-z_]+\b|[\[\]{},=:#]')


def mutated(whole: bytes, number: int, *, text: bool) -> bytes:
    """One of the mutations of a file.

    Parameters
    ----------
    whole
        Content of the good file.
    number
        Number of the mutation; the same number gives the same file.
    text
        Whether words are exchanged too, and not bytes alone.
    """
    generator = np.random.default_rng([len(whole), number])
    kinds: tuple[Callable[[bytes, np.random.Generator], bytes], ...]
    kinds = (_cut, _flip, _overwrite, _leave_out, _early, _repeat, _swap)
    if text:
        kinds = (_exchange, _exchange, _exchange_two, _drop_line, *kinds)
    if whole.lstrip()[:1] == b"{":
        kinds = (_other_json, _other_json, _other_json, *kinds)
    if whole.startswith(b"\x89HDF"):
        kinds = (_other_table, _other_table, _other_attribute, *kinds)
    try:
        return kinds[number % len(kinds)](whole, generator)
    except (OSError, RuntimeError):  # the HDF5 of a killed writer cannot be changed in its own terms
        return _flip(whole, generator)


def _at(whole: bytes, generator: np.random.Generator) -> int:
    return int(generator.integers(0, len(whole)))


def _cut(whole: bytes, generator: np.random.Generator) -> bytes:
    return whole[: _at(whole, generator)]


def _flip(whole: bytes, generator: np.random.Generator) -> bytes:
    changed = bytearray(whole)
    changed[_at(whole, generator)] ^= 1 << int(generator.integers(0, 8))
    return bytes(changed)


def _overwrite(whole: bytes, generator: np.random.Generator) -> bytes:
    at = _at(whole, generator)
    return whole[:at] + generator.bytes(8) + whole[at + 8 :]


def _leave_out(whole: bytes, generator: np.random.Generator) -> bytes:
    at = _at(whole, generator)
    return whole[:at] + whole[at + int(generator.integers(1, 200)) :]


def _early(whole: bytes, generator: np.random.Generator) -> bytes:
    """Headers are where it hurts."""
    at = _at(whole[:2000], generator)
    value = (b"\xff" * 8, bytes(8), b"\x7f" + b"\xff" * 7, generator.bytes(4))[int(generator.integers(0, 4))]
    return whole[:at] + value + whole[at + len(value) :]


def _repeat(whole: bytes, generator: np.random.Generator) -> bytes:
    at = _at(whole, generator)
    return whole[:at] + whole[at : at + 300] * 2 + whole[at + 300 :]


def _exchange(whole: bytes, generator: np.random.Generator) -> bytes:
    tokens = list(_TOKEN.finditer(whole[:20_000]))
    if not tokens:
        return _flip(whole, generator)
    single = tokens[int(generator.integers(0, len(tokens)))]
    return whole[: single.start()] + _WORDS[int(generator.integers(0, len(_WORDS)))] + whole[single.end() :]


def _exchange_two(whole: bytes, generator: np.random.Generator) -> bytes:
    return _exchange(_exchange(whole, generator), generator)


def _drop_line(whole: bytes, generator: np.random.Generator) -> bytes:
    lines = whole.splitlines(keepends=True)
    del lines[int(generator.integers(0, len(lines)))]
    return b"".join(lines)


def _swap(whole: bytes, generator: np.random.Generator) -> bytes:
    first, second = sorted(_at(whole, generator) for _ in range(2))
    size = min(int(generator.integers(1, 4000)), second - first)
    a, b = whole[first : first + size], whole[second : second + size]
    return whole[:first] + b + whole[first + size : second] + a + whole[second + size :]


_VALUES: tuple[Any, ...] = (
    *(float("nan"), float("inf"), -1.0, 0.0, 1e308, -1e308, 1e-308, 10**30, -(10**400), 3, True, None, "", "text"),
    *([], {}, [[]], [1.0, [2.0]], {"name": 1}, [None], "\x00", "9" * 5000, [[1e308, 1e308]], -(10**9), 10**9),
)


def _other_json(whole: bytes, generator: np.random.Generator) -> bytes:
    """A document of valid JSON and with its own hash, in which one or two values are others, or not there."""
    content = json.loads(whole)
    for _ in range(int(generator.integers(1, 3))):
        places = list(_places(content))
        if not places:
            break
        holder, key = places[int(generator.integers(0, len(places)))]
        value = _VALUES[int(generator.integers(0, len(_VALUES)))]
        if generator.integers(0, 4) == 0:
            del holder[key]
        elif isinstance(holder, list) and generator.integers(0, 3) == 0:
            holder.insert(key, value)
        else:
            holder[key] = value
    if HASH in content:
        content[HASH] = digest_of(content)
    return json.dumps(content).encode()


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Every place in a document: what holds it, and its key; long lists count as often as ten of their entries."""
    entries = list(value.items()) if isinstance(value, dict) else list(enumerate(value))[:10]
    for key, entry in entries:
        yield value, key
        if isinstance(entry, dict | list):
            yield from _places(entry)


def _other_hdf5(whole: bytes, change: Callable[[h5py.File], None]) -> bytes:
    memory = io.BytesIO(whole)
    with h5py.File(memory, "r+") as file:
        change(file)
        if HASH in file.attrs:
            file.attrs[HASH] = hdf5_digest(file) if _is_small(file) else ""
    return memory.getvalue()


def _is_small(file: h5py.File) -> bool:
    sizes: list[int] = []
    file.visititems(lambda name, item: sizes.append(item.nbytes if isinstance(item, h5py.Dataset) else 0))
    return sum(sizes) < 100_000_000


def _other_table(whole: bytes, generator: np.random.Generator) -> bytes:
    """A file of valid HDF5 in which a table is longer than what it stores, of another kind, or not there."""

    def change(file: h5py.File) -> None:
        names: list[str] = []
        file.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
        if not names:
            return
        table = file[names[int(generator.integers(0, len(names)))]]
        kind = int(generator.integers(0, 6))
        if kind == 0 and table.maxshape[:1] == (None,):
            table.resize(10 ** int(generator.integers(3, 12)), axis=0)
            return
        if kind == 1 and table.size and table.dtype.kind in "fc":
            value = (np.nan, np.inf, 1e308, -1.0, 0.0)[int(generator.integers(0, 5))]
            table[tuple(int(generator.integers(0, n)) for n in table.shape)] = value
            return
        values = table[()] if table.ndim and table.nbytes < 10_000_000 else np.zeros(1)
        name = table.name
        del file[name]
        others = (np.asarray(values)[:-1], np.zeros((0, 3)), np.array(1.0), np.array([b"text"]), None)
        other = others[int(generator.integers(0, len(others)))]
        if other is not None:
            file[name] = other

    return _other_hdf5(whole, change)


def _other_attribute(whole: bytes, generator: np.random.Generator) -> bytes:
    """A file of valid HDF5 in which an attribute is another, or not there."""
    values = (np.nan, -1.0, 1e308, 0, "", "text", "[]", "{}", "[1, null]", np.zeros((2, 2)), b"\xff", 10**18)

    def change(file: h5py.File) -> None:
        places = [(file, name) for name in file.attrs]
        file.visititems(lambda _, item: places.extend((item, name) for name in item.attrs))
        item, name = places[int(generator.integers(0, len(places)))]
        del item.attrs[name]
        if generator.integers(0, 4):
            item.attrs[name] = values[int(generator.integers(0, len(values)))]

    return _other_hdf5(whole, change)
