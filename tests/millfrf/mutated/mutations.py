"""Ways in which a file gets damaged or is written by a hand that errs; each is told by one number."""

import re

import numpy as np

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
    kinds = (_cut, _flip, _overwrite, _leave_out, _early, _repeat)
    if text:
        kinds = (_exchange, _exchange, _exchange_two, _drop_line, *kinds)
    return kinds[number % len(kinds)](whole, generator)


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
    one = tokens[int(generator.integers(0, len(tokens)))]
    return whole[: one.start()] + _WORDS[int(generator.integers(0, len(_WORDS)))] + whole[one.end() :]


def _exchange_two(whole: bytes, generator: np.random.Generator) -> bytes:
    return _exchange(_exchange(whole, generator), generator)


def _drop_line(whole: bytes, generator: np.random.Generator) -> bytes:
    lines = whole.splitlines(keepends=True)
    del lines[int(generator.integers(0, len(lines)))]
    return b"".join(lines)
