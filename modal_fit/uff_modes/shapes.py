"""Poles and vectors of modes as a UFF file holds them: values at nodes along axes."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from foundation import DegreeOfFreedom, FileFormatError

from .mode_sets import NORMAL, ModeSet

Complex = NDArray[np.complex128]
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
