"""Mode shapes in Universal File Format files (data set 55), record by record."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition import UffLines, read_uff_lines
from millfrf.core import Complex, DegreeOfFreedom, FileFormatError, Index, InputError, Real

_GROUPS_KIND, _NODE = 2477, 7  # data set of groups; code of a node among their entities
NORMAL, COMPLEX_FIRST, COMPLEX_SECOND = 2, 3, 7  # analysis types that are modes; others are loads, times, responses
_AXES = {1: ("S",), 3: ("X", "Y", "Z"), 6: ("X", "Y", "Z", "RX", "RY", "RZ")}  # by the number of values a node


def group_set(sides: Mapping[str, Mapping[str, int]]) -> str:
    """Write data set 2477 with one group per degree of freedom, such as ``right 1 TCP:+X``.

    ``sides`` maps ``right`` and ``left`` to the node number of each degree of freedom.

    Raises
    ------
    InputError
        A name longer than 40 characters, which a group cannot hold.
    """
    lines, number = ["    -1", f"{_GROUPS_KIND:6d}"], 0
    for side, labels in sides.items():
        for place, (label, node) in enumerate(labels.items(), 1):
            number += 1
            name = f"{side} {place} {label}"
            if len(name) > 40:
                raise InputError(
                    f"degree of freedom {label} is too long for the 40 characters of a UFF group; shorten it"
                )
            lines += ["".join(f"{n:10d}" for n in (number, 0, 0, 0, 0, 0, 0, 1)), name]
            lines.append("".join(f"{n:10d}" for n in (_NODE, node, 0, 0)))
    return "\n".join([*lines, "    -1", ""])


def vector_labels(path: Path, side: str) -> dict[str, int]:
    """Read the node number of each degree of freedom of a side (``right`` or ``left``); empty without such groups.

    Raises
    ------
    FileFormatError
        A damaged group.
    """
    labels: dict[str, int] = {}
    for data_set in read_uff_lines(path, (_GROUPS_KIND,)):
        lines, start = data_set.lines, 0
        try:
            while start + 1 < len(lines):
                n_entities = int(lines[start][70:80])
                words = lines[start + 1].split(maxsplit=2)  # side, place and label
                if len(words) == 3 and words[0] == side:
                    labels[words[2].strip()] = int(lines[start + 2][10:20])
                start += 2 + -(-n_entities // 2)  # two entities a line
        except (ValueError, IndexError) as error:
            raise FileFormatError(
                f"{path}: data set {data_set.place} (type 2477) is damaged; export it again"
            ) from error
    return labels


@dataclass(frozen=True)
class ModeSet:
    """One mode shape as the file holds it."""

    place: int  # of the data set in the file, from 1
    texts: tuple[str, ...]  # the five identification lines
    analysis: int  # 2: normal mode; 3, 7: complex mode of first or second order
    motion: int  # 8: displacement; 11: velocity; 12: acceleration; other numbers: not stated
    # Normal: frequency (Hz), modal mass, viscous damping ratio, hysteretic damping. Complex: real and imaginary part of
    # the eigenvalue (rad/s), of modal A and of modal B. Zeros where the file holds fewer.
    parameters: Real
    nodes: Index  # (n_nodes,): numbers of the nodes that move
    values: Complex  # (n_nodes, n_axes): motion of each node along each axis
    axes: tuple[str, ...]  # X, Y, Z, followed by rotations, or S


def read_mode_sets(path: Path) -> tuple[ModeSet, ...]:
    """Read all modes of a file, in its order.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        A damaged file, no mode in it, or values of another kind than scalars, translations and rotations.
    """
    modes, other_types = [], set()
    for data_set in read_uff_lines(path, (55,)):
        try:
            kinds = [int(data_set.lines[5][k : k + 10]) for k in range(0, 60, 10)]
            if kinds[1] in (NORMAL, COMPLEX_FIRST, COMPLEX_SECOND):
                modes.append(_mode(data_set, kinds))
            else:
                other_types.add(kinds[1])
        except (ValueError, IndexError) as error:
            reason = " ".join(str(error).split())
            raise FileFormatError(
                f"{path}: data set {data_set.place} (type 55) is damaged ({reason}); export it again"
            ) from error
    if not modes:
        what = f"analysis types {', '.join(map(str, sorted(other_types)))}" if other_types else "no data set 55"
        raise FileFormatError(f"{path} holds no modes but {what}; export normal modes (2) or complex ones (3)")
    return tuple(modes)


def _mode(data_set: UffLines, kinds: Sequence[int]) -> ModeSet:
    _, analysis, _, motion, data_type, n_values = kinds
    if n_values not in _AXES:
        raise ValueError(f"{n_values} values a node are no translations or rotations")
    parameters = np.zeros(6)
    numbers = _numbers(data_set.lines[7])[:6]
    if len(numbers) < 2:
        raise ValueError("its parameters are missing")
    parameters[: len(numbers)] = numbers
    nodes, values = _at_nodes(data_set.lines[8:], n_values, is_complex=data_type == 5)
    texts = tuple(line.strip() for line in data_set.lines[:5])
    return ModeSet(data_set.place, texts, analysis, motion, parameters, nodes, values, _AXES[n_values])


def _at_nodes(lines: Sequence[str], n_values: int, *, is_complex: bool) -> tuple[Index, Complex]:
    """Read the node numbers and the values at each node, six numbers a line."""
    n_numbers = n_values * (2 if is_complex else 1)
    n_lines = 1 + -(-n_numbers // 6)
    if len(lines) % n_lines:
        raise ValueError(f"{len(lines)} lines of nodes and values do not come in groups of {n_lines}")
    nodes, rows = [], []
    for start in range(0, len(lines), n_lines):
        nodes.append(int(lines[start].split()[0]))
        row = [number for line in lines[start + 1 : start + n_lines] for number in _numbers(line)]
        if len(row) != n_numbers or not np.isfinite(row).all():
            raise ValueError(f"node {nodes[-1]} has {len(row)} values, {n_numbers} finite ones are announced")
        rows.append(row)
    numbers = np.array(rows, dtype=float).reshape(len(nodes), n_numbers)
    values = numbers[:, ::2] + 1j * numbers[:, 1::2] if is_complex else numbers + 0j
    return np.array(nodes, dtype=np.int64), np.asarray(values, dtype=complex)


def _numbers(line: str) -> list[float]:
    """Read fields of 13 characters, as Fortran writes them without blanks in between."""
    text = line.rstrip().replace("D", "E").replace("d", "e")
    return [float(text[k : k + 13]) for k in range(0, len(text), 13)]


def poles_of(modes: Sequence[ModeSet]) -> Complex:
    """Return the poles of the modes, rad/s, shape (n_modes,).

    The pole of a normal mode is computed from frequency and damping ratio, or half the hysteretic damping where there
    is no viscous damping.
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
    """Return vectors (n_modes, n_dof) and their degrees of freedom: translations and scalars in which a mode moves.

    Nodes are ordered by their first appearance; a node that a data set omits does not move in that mode.
    """
    nodes = list(dict.fromkeys(int(node) for mode in modes for node in mode.nodes))
    axes = list(dict.fromkeys(axis for mode in modes for axis in mode.axes if not axis.startswith("R")))
    row_of = {node: row for row, node in enumerate(nodes)}
    values = np.zeros((len(modes), len(nodes), len(axes)), dtype=complex)
    for mode, shape in zip(modes, values, strict=True):
        rows = [row_of[int(node)] for node in mode.nodes]
        for column, axis in enumerate(mode.axes):
            if axis in axes:
                shape[rows, axes.index(axis)] = mode.values[:, column]
    moving = np.asarray(values.any(axis=0))
    labels = tuple(
        f"{node}:+{axis}" for row, node in enumerate(nodes) for column, axis in enumerate(axes) if moving[row, column]
    )
    return values[:, moving], labels


def shapes_at(path: Path, modes: Sequence[ModeSet], numbers: Mapping[str, int]) -> Complex:
    """Return vectors (n_modes, n_dof) at degrees of freedom whose node ``numbers`` are known.

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
