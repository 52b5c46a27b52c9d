"""A modal model in a UFF file: two data sets 55 a mode, of its right and of its left vector."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimation import is_uff_number, uff_node_numbers
from foundation import DegreeOfFreedom, InputError, writing_whole_file

from ..models.modal_model import ModalModel
from .groups import group_set
from .mode_sets import COMPLEX_FIRST
from .reading import SEPARATOR, SIDES

_AXES = ("X", "Y", "Z", "RX", "RY", "RZ")
_TRANSLATIONS = 3
_STRUCTURAL, _DISPLACEMENT, _COMPLEX = 1, 8, 5
_VECTOR = {3: 2, 6: 3}
"""Data characteristic by the number of axes: translations, or translations and rotations."""
_IN_LINE, _LINE = 6, 80


def write_modes_uff(path: str | os.PathLike[str], model: ModalModel) -> None:
    """Write each mode as two data sets 55, one of its right and one of its left vector.

    The first identification line says ``right`` or ``left``. Nodes whose names are whole numbers keep them. Names,
    signs and an order that node numbers cannot say are kept as groups of one node (data set 2477), which other programs
    may pass over. The format holds six digits; residuals, covariance, a delay and the band have no place in it.

    Parameters
    ----------
    path
        File to write, ``.uff`` or ``.unv``.
    model
        Modal model with translations and rotations as degrees of freedom.

    Raises
    ------
    InputError
        Another suffix, a scalar degree of freedom, or a name longer than a group's 40 characters.
    """
    if Path(path).suffix.lower() not in (".uff", ".unv"):
        raise InputError(f"cannot write {path}: UFF files end in .uff or .unv; change the suffix")
    parsed = [DegreeOfFreedom.parse(label) for label in (*model.responses, *model.excitations)]
    scalar = [str(dof) for dof in parsed if dof.axis not in _AXES]
    if scalar:
        raise InputError(f"{scalar[0]} has no direction; only translations and rotations are written to UFF")
    nodes = uff_node_numbers([dof.node for dof in parsed])
    sides = dict(zip(SIDES, (model.responses, model.excitations), strict=True))
    text = "" if _plain(model) else group_set({side: _numbered(labels, nodes) for side, labels in sides.items()})
    for number in range(len(model.poles)):
        text += "".join(_data_set(model, number, side, nodes) for side in SIDES)
    with writing_whole_file(path) as temporary:
        temporary.write_text(text, encoding="latin-1", errors="replace", newline="\n")


def _numbered(labels: Sequence[str], nodes: dict[str, int]) -> dict[str, int]:
    return {label: nodes[DegreeOfFreedom.parse(label).node] for label in labels}


def _plain(model: ModalModel) -> bool:
    """Whether numbers of nodes say all: numeric names, positive axes in order, and nothing that does not move."""
    for labels, vectors in ((model.responses, model.right), (model.excitations, model.left)):
        parsed = [DegreeOfFreedom.parse(label) for label in labels]
        nodes = list(dict.fromkeys(dof.node for dof in parsed))
        places = [(nodes.index(dof.node), _AXES.index(dof.axis)) for dof in parsed]
        moves = np.char.mod("%.5e", np.abs(vectors)).astype(float).any(axis=0).all()
        translations = all(dof.axis in _AXES[:_TRANSLATIONS] and dof.sign > 0 for dof in parsed)
        if not (moves and translations and places == sorted(places) and all(map(is_uff_number, nodes))):
            return False
    return True


def _data_set(model: ModalModel, number: int, side: str, nodes: dict[str, int]) -> str:
    labels, vectors = (model.responses, model.right) if side == SIDES[0] else (model.excitations, model.left)
    values, numbers = _at_nodes(labels, vectors[number], nodes)
    n_axes, pole = values.shape[1], complex(model.poles[number])
    lines = [
        "    -1",
        "    55",
        f"{side} vector of mode {number + 1}",
        f"{model.quantity}{SEPARATOR}{model.unit}"[:_LINE],
        *["NONE"] * 3,
        "".join(f"{n:10d}" for n in (_STRUCTURAL, COMPLEX_FIRST, _VECTOR[n_axes], _DISPLACEMENT, _COMPLEX, n_axes)),
        "".join(f"{n:10d}" for n in (2, 6, 1, number + 1)),
        _fields([pole.real, pole.imag, 1.0, 0.0, -pole.real, -pole.imag]),
    ]
    for node, row in zip(numbers, values, strict=True):
        pairs = np.column_stack([row.real, row.imag]).ravel()
        lines.append(f"{node:10d}")
        lines += [_fields(pairs[start : start + _IN_LINE]) for start in range(0, len(pairs), _IN_LINE)]
    return "\n".join([*lines, "    -1", ""])


def _at_nodes(
    labels: Sequence[str], vector: NDArray[np.complex128], nodes: dict[str, int]
) -> tuple[NDArray[np.complex128], list[int]]:
    """Values (n_nodes, 3 or 6) along positive axes, and the nodes' numbers."""
    parsed = [DegreeOfFreedom.parse(label) for label in labels]
    names = list(dict.fromkeys(dof.node for dof in parsed))
    n_axes = _TRANSLATIONS if all(dof.axis in _AXES[:_TRANSLATIONS] for dof in parsed) else len(_AXES)
    values = np.zeros((len(names), n_axes), dtype=complex)
    for component, dof in zip(vector, parsed, strict=True):
        values[names.index(dof.node), _AXES.index(dof.axis)] = component * dof.sign
    return values, [nodes[name] for name in names]


def _fields(numbers: Sequence[float] | NDArray[np.float64]) -> str:
    return "".join(f"{number:13.5e}" for number in numbers)
