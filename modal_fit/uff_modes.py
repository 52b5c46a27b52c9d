"""Mode shapes in Universal File Format files (data set 55), record by record."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition import UffLines, read_uff_lines
from millfrf.core import Complex, DegreeOfFreedom, FileFormatError, InputError

_GROUPS_KIND, _NODE = 2477, 7
_LONGEST = 40
_GROUPS_IN_LINE = 2


def group_set(sides: Mapping[str, Mapping[str, int]]) -> str:
    """Data set 2477 with one group a degree of freedom, ``right 1 TCP:+X``.

    Parameters
    ----------
    sides
        Node number by degree of freedom, by side.

    Raises
    ------
    InputError
        A name longer than the 40 characters of a group's.
    """
    lines, number = ["    -1", f"{_GROUPS_KIND:6d}"], 0
    for side, labels in sides.items():
        for place, (label, node) in enumerate(labels.items(), 1):
            number += 1
            name = f"{side} {place} {label}"
            if len(name) > _LONGEST:
                raise InputError(
                    f"degree of freedom {label} is too long for the 40 characters of a UFF group; shorten it"
                )
            lines += ["".join(f"{n:10d}" for n in (number, 0, 0, 0, 0, 0, 0, 1)), name]
            lines.append("".join(f"{n:10d}" for n in (_NODE, node, 0, 0)))
    return "\n".join([*lines, "    -1", ""])


def vector_labels(path: Path, side: str) -> dict[str, int]:
    """Node number by degree of freedom of one side (``right`` or ``left``), in their order; empty where none is told.

    Raises
    ------
    FileFormatError
        A damaged group.
    """
    found: dict[str, int] = {}
    for one in read_uff_lines(path, (_GROUPS_KIND,)):
        at = 0
        try:
            while at + 1 < len(one.lines):
                n_entities = int(one.lines[at][70:80])
                words = one.lines[at + 1].split(maxsplit=2)
                if len(words) == len(("side", "place", "label")) and words[0] == side:
                    found[words[2].strip()] = int(one.lines[at + 2][10:20])
                at += 2 + -(-n_entities // _GROUPS_IN_LINE)
        except (ValueError, IndexError) as error:
            raise FileFormatError(f"{path}: data set {one.place} (type 2477) is damaged; export it again") from error
    return found


NORMAL, COMPLEX_FIRST, COMPLEX_SECOND = 2, 3, 7
"""Analysis types that are modes; the others are loads, time steps and responses."""

_MODE_SETS_KIND = 55
_HEADER = 8
_COMPLEX = 5
_WIDTH, _MODE_SETS_IN_LINE = 13, 6
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
    sets = read_uff_lines(path, (_MODE_SETS_KIND,))
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
    n_lines = 1 + -(-n_numbers // _MODE_SETS_IN_LINE)
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


_TURNING = "R"


def poles_of(modes: Sequence[ModeSet]) -> Complex:
    """Poles, rad/s, shape (n_modes,): of a normal mode from frequency and damping ratio, half its hysteretic damping
    where there is no viscous one.
    """
    poles = []
    for mode in modes:
        if mode.analysis == NORMAL:
            omega, viscous, hysteretic = 2 * np.pi * mode.parameters[0], mode.parameters[2], mode.parameters[3]
            zeta = viscous or hysteretic / 2
            poles.append(omega * complex(-zeta, np.sqrt(max(0.0, 1 - zeta**2))))
        else:
            poles.append(complex(mode.parameters[0], mode.parameters[1]))
    return np.array(poles, dtype=complex)


def shapes_of(modes: Sequence[ModeSet]) -> tuple[Complex, tuple[str, ...]]:
    """Vectors (n_modes, n_dof) and their degrees of freedom: all translations and scalars in which a mode moves.

    Nodes stand in the order in which they appear; a node that a set leaves out does not move in that mode.
    """
    nodes = list(dict.fromkeys(int(node) for mode in modes for node in mode.nodes))
    axes = list(dict.fromkeys(axis for mode in modes for axis in mode.axes if not axis.startswith(_TURNING)))
    values = np.zeros((len(modes), len(nodes), len(axes)), dtype=complex)
    places = {node: row for row, node in enumerate(nodes)}
    for mode, shape in zip(modes, values, strict=True):
        rows = [places[int(node)] for node in mode.nodes]
        for column, axis in enumerate(mode.axes):
            if axis in axes:
                shape[rows, axes.index(axis)] = mode.values[:, column]
    moving = np.asarray(values.any(axis=0))
    labels = tuple(
        f"{node}:+{axis}" for row, node in enumerate(nodes) for column, axis in enumerate(axes) if moving[row, column]
    )
    return values[:, moving], labels


def shapes_at(path: Path, modes: Sequence[ModeSet], numbers: Mapping[str, int]) -> Complex:
    """Vectors (n_modes, n_dof) at degrees of freedom whose node numbers are known.

    Raises
    ------
    FileFormatError
        A node or an axis that a mode does not have.
    """
    vectors = np.zeros((len(modes), len(numbers)), dtype=complex)
    for mode, vector in zip(modes, vectors, strict=True):
        rows = {int(node): row for row, node in enumerate(mode.nodes)}
        for column, (label, number) in enumerate(numbers.items()):
            dof = DegreeOfFreedom.parse(label)
            if number not in rows or dof.axis not in mode.axes:
                raise FileFormatError(f"{path}: data set {mode.place} lacks {label}; export the modes again")
            vector[column] = dof.sign * mode.values[rows[number], mode.axes.index(dof.axis)]
    return vectors
