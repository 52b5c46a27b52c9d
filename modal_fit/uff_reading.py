"""Modal models from and to Universal File Format files."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition import read_uff_sets
from estimation import is_uff_number, uff_node_numbers
from millfrf.core import DegreeOfFreedom, FileFormatError, InputError, writing_whole_file

from .models.modal_model import ModalModel
from .uff_modes import (
    COMPLEX_FIRST,
    NORMAL,
    ModeSet,
    group_set,
    poles_of,
    read_mode_sets,
    shapes_at,
    shapes_of,
    vector_labels,
)

_UNITS = 164
_DERIVATIVES = {8: 0, 11: 1, 12: 2}
_NAMES = ("displacement", "velocity", "acceleration")
_SAME_POLE = 1e-6
_REFERENCE = 4  # identification line

Notes = list[str]


def foreign_model(path: Path, sets: Sequence[ModeSet]) -> tuple[ModalModel, tuple[str, ...]]:
    """Build the model of all modes of a file, and say what the file leaves open.

    Every degree of freedom that moves is a response and, by reciprocity, an excitation. With modal mass m (normal
    modes) or modal A a (complex ones) the residues are ``phi phi^T / (2 i m w_d)`` and ``phi phi^T / a`` (Ewins, Modal
    Testing, 2nd ed., sections 2.4 and 2.7), converted by the file's units. Where a mode has neither, poles and shapes
    hold but sizes do not, and the model is a ``transfer`` of unit 1.

    Parameters
    ----------
    path
        Path of the file, for messages and for the file's units.
    sets
        Mode shapes of the file.

    Returns
    -------
    ModalModel, tuple of str
        The model, and one sentence for each thing that was inferred or left out.

    Raises
    ------
    FileFormatError
        No mode that vibrates, or a damping ratio of 1 and above.
    """
    notes: Notes = []
    _require_shares(path, sets)
    modes = _of_one_reference(_vibrating(path, sets, notes), notes)
    poles = poles_of(modes)
    if (undamped := int((poles.real >= 0).sum())) > 0:
        notes.append(f"{undamped} of {len(poles)} modes have no damping; no FRF or limit can stand on them")
    shapes, labels = shapes_of(modes)
    if not labels:
        raise FileFormatError(f"{path}: no mode moves along X, Y or Z; export shapes with translations")
    if any(mode.values[:, 3:].any() for mode in modes):
        notes.append("rotations of the shapes are left out")
    notes.append("its shapes are taken for right and left vectors: the structure is taken as reciprocal")
    sizes, known = _scales(path, modes, poles, notes)
    left = shapes / sizes[:, None]
    quantity, unit = ("receptance", "m/N") if known else ("transfer", "1")
    told = tuple(f"{path.name}: {note}" for note in notes)
    return ModalModel(poles, shapes, left, labels, labels, quantity, unit), told


def _vibrating(path: Path, sets: Sequence[ModeSet], notes: Notes) -> list[ModeSet]:
    """Keep modes with a pole in the upper half plane: no rigid bodies, and one of each conjugate pair."""
    poles = poles_of(sets)
    rigid, lower = int((np.abs(poles) == 0).sum()), int((poles.imag < 0).sum())
    still = int((poles.imag == 0).sum()) - rigid
    for count, what in ((rigid, "at 0 Hz"), (lower, "in the lower half plane"), (still, "that do not vibrate")):
        if count:
            notes.append(f"{count} mode{'s' if count > 1 else ''} {what} left out")
    kept = [mode for mode, pole in zip(sets, poles, strict=True) if pole.imag > 0]
    if not kept:
        raise FileFormatError(f"{path} holds no mode that vibrates ({'; '.join(notes)}); export elastic modes")
    return kept


def _of_one_reference(modes: Sequence[ModeSet], notes: Notes) -> list[ModeSet]:
    """A program that fits several references may write each mode once for each of them; one is enough for its shape."""
    kept: list[ModeSet] = []
    poles = poles_of(modes)
    for mode, pole in zip(modes, poles, strict=True):
        same = [other for other in kept if abs(poles_of([other])[0] - pole) <= _SAME_POLE * abs(pole)]
        if not any(other.texts[_REFERENCE] != mode.texts[_REFERENCE] for other in same):
            kept.append(mode)
    if len(kept) < len(modes):
        notes.append(f"shapes of further references left out ({len(modes) - len(kept)})")
    return kept


def _require_shares(path: Path, modes: Sequence[ModeSet]) -> None:
    for mode in modes:
        if mode.analysis == NORMAL and max(mode.parameters[2], mode.parameters[3] / 2) >= 1:
            raise FileFormatError(
                f"{path}: data set {mode.place} has a damping ratio of {max(mode.parameters[2:4]):g}; the format holds "
                "shares (0.02 is 2 %), correct the file"
            )


def _scales(
    path: Path, modes: Sequence[ModeSet], poles: NDArray[np.complex128], notes: Notes
) -> tuple[NDArray[np.complex128], bool]:
    """Give the divisor of ``phi phi^T`` for residues of a receptance in m/N, and whether the file states it."""
    normal = np.array([mode.analysis == NORMAL for mode in modes])
    masses = np.array([mode.parameters[1] if mode.analysis == NORMAL else 0.0 for mode in modes])
    modal_a = np.array([complex(*mode.parameters[2:4]) for mode in modes])
    stated = np.where(normal, 2j * poles.imag * masses, modal_a)
    motions = {mode.motion for mode in modes}
    if not stated.all() or motions - set(_DERIVATIVES):
        why = "modal masses" if not stated.all() else "kinds of motion"
        notes.append(f"without {why}, poles and shapes hold but the size of FRFs does not: the model is a transfer")
        return np.asarray(2j * poles.imag), False
    order = np.array([_DERIVATIVES[mode.motion] for mode in modes])
    if order.any():
        notes.append(f"shapes of {_NAMES[order.max()]} are turned into displacement")
    units = read_uff_sets(path, (_UNITS,))
    factor = float(units[0]["force"]) / float(units[0]["length"]) if units else 1.0
    if factor != 1:
        notes.append(f"sizes are turned into SI by the file's units (set 164): times {factor:g}")
    return np.asarray(stated * poles**order / factor), True


SIDES = ("right", "left")
SEPARATOR = " in "
"""Between quantity and unit on the second identification line."""


def read_modes_uff(path: str | os.PathLike[str]) -> ModalModel:
    """Read modes (data sets 55) as a modal model; see :func:`import_modes_uff`.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        No modes inside, a damaged file, or right and left vectors that do not match.
    """
    return import_modes_uff(Path(path))[0]


def import_modes_uff(path: Path) -> tuple[ModalModel, tuple[str, ...]]:
    """Modal model of a UFF file, and one sentence for each thing that the file does not say or that is left out.

    Files of :func:`write_modes_uff` come back as they were; `foreign_model` says what those of other programs give.

    Parameters
    ----------
    path
        ``.uff`` or ``.unv``.

    Returns
    -------
    ModalModel, tuple of str

    Raises
    ------
    InputError, FileFormatError
        As :func:`read_modes_uff`.
    """
    sets = read_mode_sets(path)
    sides = {side: [one for one in sets if one.texts[0].split()[:1] == [side]] for side in SIDES}
    if not sides["right"]:
        return foreign_model(path, sets)
    return _ours(path, sides), ()


def _ours(path: Path, sides: dict[str, list[ModeSet]]) -> ModalModel:
    right, left = sides["right"], sides["left"]
    if len(right) != len(left):
        raise FileFormatError(f"{path} holds {len(right)} right but {len(left)} left vectors; export the modes again")
    found = []
    for side in SIDES:
        labels = vector_labels(path, side)
        found.append((shapes_at(path, sides[side], labels), tuple(labels)) if labels else shapes_of(sides[side]))
    (responding, responses), (driving, excitations) = found
    quantity, _, unit = right[0].texts[1].partition(SEPARATOR)
    return ModalModel(poles_of(right), responding, driving, responses, excitations, quantity, unit)


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
