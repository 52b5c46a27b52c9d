"""Data sets 55 of a UFF file, record by record.

pyuff reads three or six real values a node, or three complex ones. It misreads scalars and refuses six complex values,
which take two lines a node. The records are therefore read here, by the format's own description
(https://www.ceas3.uc.edu/sdrluff, data set 55).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition import UffLines, read_uff_lines
from foundation import FileFormatError

NORMAL, COMPLEX_FIRST, COMPLEX_SECOND = 2, 3, 7
"""Analysis types that are modes; the others are loads, time steps and responses."""

_KIND = 55
_HEADER = 8
_COMPLEX = 5
_WIDTH, _IN_LINE = 13, 6
_AXES = {1: ("S",), 3: ("X", "Y", "Z"), 6: ("X", "Y", "Z", "RX", "RY", "RZ")}
_LEAST = 2


@dataclass(frozen=True)
class ModeSet:
    """One mode shape as the file holds it.

    Parameters
    ----------
    place
        Place of the data set in the file, counted from 1.
    texts
        The five identification lines.
    analysis
        Code of the analysis. 2: normal mode; 3, 7: complex mode of first or second order.
    motion
        Code of the motion. 8: displacement; 11: velocity; 12: acceleration; other numbers: not said.
    parameters : (n_parameters,)
        Numbers of the mode. Normal: frequency (Hz), modal mass, viscous damping ratio, hysteretic damping. Complex:
        real and imaginary part of the eigenvalue (rad/s), of modal A and of modal B. Zeros where the file holds fewer.
    nodes : (n_nodes,), int
        Numbers of the nodes that move.
    values : (n_nodes, n_axes), complex
        Motion of each node along each axis.
    axes
        Names of the axes: ``X, Y, Z``, with rotations behind them, or ``S``.
    """

    place: int
    texts: tuple[str, ...]
    analysis: int
    motion: int
    parameters: NDArray[np.float64]
    nodes: NDArray[np.int64]
    values: NDArray[np.complex128]
    axes: tuple[str, ...]


def read_mode_sets(path: Path) -> tuple[ModeSet, ...]:
    """All modes of a file, in its order.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        A damaged file, no mode inside, or values of another kind than scalars, translations and rotations.
    """
    sets = read_uff_lines(path, (_KIND,))
    modes, others = [], set()
    for one in sets:
        try:
            kinds = [int(one.lines[5][k : k + 10]) for k in range(0, 60, 10)]
            if kinds[1] in (NORMAL, COMPLEX_FIRST, COMPLEX_SECOND):
                modes.append(_mode(one, kinds))
            else:
                others.add(kinds[1])
        except (ValueError, IndexError) as error:
            raise FileFormatError(
                f"{path}: data set {one.place} (type 55) is damaged ({' '.join(str(error).split())}); export it again"
            ) from error
    if not modes:
        what = f"analysis types {', '.join(map(str, sorted(others)))}" if others else "no data set 55"
        raise FileFormatError(f"{path} holds no modes but {what}; export normal modes (2) or complex ones (3)")
    return tuple(modes)


def _mode(one: UffLines, kinds: Sequence[int]) -> ModeSet:
    _, analysis, _, motion, data_type, n_values = kinds
    if n_values not in _AXES:
        raise ValueError(f"{n_values} values a node are no translations or rotations")
    parameters = np.zeros(6)
    given = _numbers(one.lines[7])[:6]
    if len(given) < _LEAST:
        raise ValueError("its parameters are missing")
    parameters[: len(given)] = given
    nodes, values = _at_nodes(one.lines[_HEADER:], n_values, data_type == _COMPLEX)
    texts = tuple(line.strip() for line in one.lines[:5])
    return ModeSet(one.place, texts, analysis, motion, parameters, nodes, values, _AXES[n_values])


def _at_nodes(
    lines: Sequence[str], n_values: int, is_complex: bool
) -> tuple[NDArray[np.int64], NDArray[np.complex128]]:
    """Node numbers and their values; a node's values take as many lines of six as they need."""
    n_numbers = n_values * (2 if is_complex else 1)
    n_lines = 1 + -(-n_numbers // _IN_LINE)
    if len(lines) % n_lines:
        raise ValueError(f"{len(lines)} lines of nodes and values do not come in groups of {n_lines}")
    nodes, rows = [], []
    for start in range(0, len(lines), n_lines):
        nodes.append(int(lines[start].split()[0]))
        found = [number for line in lines[start + 1 : start + n_lines] for number in _numbers(line)]
        if len(found) != n_numbers or not np.isfinite(found).all():
            raise ValueError(f"node {nodes[-1]} has {len(found)} values, {n_numbers} finite ones are announced")
        rows.append(found)
    numbers = np.array(rows, dtype=float).reshape(len(nodes), n_numbers)
    values = numbers[:, ::2] + 1j * numbers[:, 1::2] if is_complex else numbers + 0j
    return np.array(nodes, dtype=np.int64), np.asarray(values, dtype=complex)


def _numbers(line: str) -> list[float]:
    """Fields of 13 characters, as Fortran wrote them without blanks in between."""
    text = line.rstrip().replace("D", "E").replace("d", "e")
    return [float(text[k : k + _WIDTH]) for k in range(0, len(text), _WIDTH)]
