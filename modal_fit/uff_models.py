"""Modal models from and to Universal File Format files."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from acquisition import read_uff_sets
from estimation import is_uff_number, uff_node_numbers
from millfrf.core import Complex, DegreeOfFreedom, FileFormatError, InputError, Real, writing_whole_file

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

_SIDES = ("right", "left")
_SEPARATOR = " in "  # between quantity and unit on the second identification line
_DERIVATIVES = {8: 0, 11: 1, 12: 2}  # code of the motion: order of the derivative
_MOTIONS = ("displacement", "velocity", "acceleration")
_AXES = ("X", "Y", "Z", "RX", "RY", "RZ")


def import_modes_uff(path: Path) -> tuple[ModalModel, tuple[str, ...]]:
    """Read the modal model of a UFF file, with one sentence for each assumption and each omission.

    Files of :func:`write_modes_uff` give the written model. In files of other programs, every degree of freedom that
    moves is a response and, by reciprocity, an excitation. With modal mass m (normal modes) or modal A a (complex ones)
    the residues are ``phi phi^T / (2 i m w_d)`` and ``phi phi^T / a`` (Ewins, Modal Testing, 2nd ed., sections 2.4 and
    2.7), converted by the file's units. Where a mode has neither, poles and shapes hold but sizes do not, and the model
    is a ``transfer`` of unit 1.

    Parameters
    ----------
    path
        File with the suffix ``.uff`` or ``.unv``.

    Returns
    -------
    ModalModel, tuple of str

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        No mode that vibrates, a damaged file, a damping ratio of 1 and above, or right and left vectors that do not
        match.
    """
    sets = read_mode_sets(path)
    right, left = ([mode for mode in sets if mode.texts[0].split()[:1] == [side]] for side in _SIDES)
    if not right:
        return _foreign_model(path, sets)
    if len(right) != len(left):
        raise FileFormatError(f"{path} holds {len(right)} right but {len(left)} left vectors; export the modes again")
    right_vectors, responses = _vectors(path, "right", right)
    left_vectors, excitations = _vectors(path, "left", left)
    quantity, _, unit = right[0].texts[1].partition(_SEPARATOR)
    return ModalModel(poles_of(right), right_vectors, left_vectors, responses, excitations, quantity, unit), ()


def _vectors(path: Path, side: str, modes: Sequence[ModeSet]) -> tuple[Complex, tuple[str, ...]]:
    labels = vector_labels(path, side)
    return (shapes_at(path, modes, labels), tuple(labels)) if labels else shapes_of(modes)


def _foreign_model(path: Path, sets: Sequence[ModeSet]) -> tuple[ModalModel, tuple[str, ...]]:
    """Build the model of all modes in a file of another program, with notes on it; see :func:`import_modes_uff`."""
    notes: list[str] = []
    _require_ratios(path, sets)
    modes = _of_one_reference(_vibrating(path, sets, notes), notes)
    poles = poles_of(modes)
    if (undamped := int((poles.real >= 0).sum())) > 0:
        notes.append(f"{undamped} of {len(poles)} modes have no damping; no FRF or limit can be computed from them")
    shapes, labels = shapes_of(modes)
    if not labels:
        raise FileFormatError(f"{path}: no mode moves along X, Y or Z; export shapes with translations")
    if any(mode.values[:, 3:].any() for mode in modes):
        notes.append("rotations of the shapes are left out")
    notes.append("its shapes are taken for right and left vectors: the structure is assumed to be reciprocal")
    sizes, known = _scales(path, modes, poles, notes)
    quantity, unit = ("receptance", "m/N") if known else ("transfer", "1")
    model = ModalModel(poles, shapes, shapes / sizes[:, None], labels, labels, quantity, unit)
    return model, tuple(f"{path.name}: {note}" for note in notes)


def _vibrating(path: Path, sets: Sequence[ModeSet], notes: list[str]) -> list[ModeSet]:
    """Keep the modes with a pole in the upper half plane; note how many modes of each other kind are left out."""
    poles = poles_of(sets)
    rigid, lower = int((np.abs(poles) == 0).sum()), int((poles.imag < 0).sum())
    overdamped = int((poles.imag == 0).sum()) - rigid
    for count, what in ((rigid, "at 0 Hz"), (lower, "in the lower half plane"), (overdamped, "that do not vibrate")):
        if count:
            notes.append(f"{count} mode{'s' if count > 1 else ''} {what} left out")
    modes = [mode for mode, pole in zip(sets, poles, strict=True) if pole.imag > 0]
    if not modes:
        raise FileFormatError(f"{path} holds no mode that vibrates ({'; '.join(notes)}); export elastic modes")
    return modes


def _of_one_reference(modes: Sequence[ModeSet], notes: list[str]) -> list[ModeSet]:
    """Keep one shape of each mode: a program that fits several references may write each mode once for each."""
    distinct: list[ModeSet] = []
    for mode, pole in zip(modes, poles_of(modes), strict=True):
        same = [other for other in distinct if abs(poles_of([other])[0] - pole) <= 1e-6 * abs(pole)]
        if not any(other.texts[4] != mode.texts[4] for other in same):  # line 5 names the reference
            distinct.append(mode)
    if len(distinct) < len(modes):
        notes.append(f"shapes of further references left out ({len(modes) - len(distinct)})")
    return distinct


def _require_ratios(path: Path, modes: Sequence[ModeSet]) -> None:
    for mode in modes:
        if mode.analysis == NORMAL and max(mode.parameters[2], mode.parameters[3] / 2) >= 1:
            raise FileFormatError(
                f"{path}: data set {mode.place} has a damping ratio of {max(mode.parameters[2:4]):g}; the format holds "
                "shares (0.02 is 2 %), correct the file"
            )


def _scales(path: Path, modes: Sequence[ModeSet], poles: Complex, notes: list[str]) -> tuple[Complex, bool]:
    """Return the divisor of ``phi phi^T`` for residues of a receptance in m/N, and whether the file states it."""
    normal = np.array([mode.analysis == NORMAL for mode in modes])
    masses = np.array([mode.parameters[1] if mode.analysis == NORMAL else 0.0 for mode in modes])
    modal_a = np.array([complex(*mode.parameters[2:4]) for mode in modes])
    divisors = np.where(normal, 2j * poles.imag * masses, modal_a)
    motions = {mode.motion for mode in modes}
    if not divisors.all() or motions - set(_DERIVATIVES):
        missing = "modal masses" if not divisors.all() else "kinds of motion"
        notes.append(f"without {missing}, poles and shapes hold but the size of FRFs does not: the model is a transfer")
        return np.asarray(2j * poles.imag), False
    order = np.array([_DERIVATIVES[mode.motion] for mode in modes])
    if order.any():
        notes.append(f"shapes of {_MOTIONS[order.max()]} are converted to displacement")
    units = read_uff_sets(path, (164,))
    factor = float(units[0]["force"]) / float(units[0]["length"]) if units else 1.0
    if factor != 1:
        notes.append(f"sizes are converted to SI by the file's units (set 164): times {factor:g}")
    return np.asarray(divisors * poles**order / factor), True


def write_modes_uff(path: str | os.PathLike[str], model: ModalModel) -> None:
    """Write each mode as two data sets 55: its right vector and its left vector.

    The first identification line is ``right`` or ``left``. Nodes whose names are whole numbers keep them. Names,
    signs and an order that node numbers cannot express are kept as groups of one node (data set 2477), which other
    programs may ignore. The format holds six digits, and no residuals, covariance, delay or band.

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
    text = ""
    if not _is_plain(model):
        sides = zip(_SIDES, (model.responses, model.excitations), strict=True)
        text = group_set(
            {side: {label: nodes[DegreeOfFreedom.parse(label).node] for label in labels} for side, labels in sides}
        )
    for number in range(len(model.poles)):
        text += "".join(_data_set(model, number, side, nodes) for side in _SIDES)
    with writing_whole_file(path) as temporary:
        temporary.write_text(text, encoding="latin-1", errors="replace", newline="\n")


def _is_plain(model: ModalModel) -> bool:
    """Return whether node numbers express all degrees of freedom.

    They do with numeric names, positive translations in order, and no component that never moves.
    """
    for labels, vectors in ((model.responses, model.right), (model.excitations, model.left)):
        parsed = [DegreeOfFreedom.parse(label) for label in labels]
        nodes = list(dict.fromkeys(dof.node for dof in parsed))
        places = [(nodes.index(dof.node), _AXES.index(dof.axis)) for dof in parsed]
        moves = np.char.mod("%.5e", np.abs(vectors)).astype(float).any(axis=0).all()
        translations = all(dof.axis in _AXES[:3] and dof.sign > 0 for dof in parsed)
        if not (moves and translations and places == sorted(places) and all(map(is_uff_number, nodes))):
            return False
    return True


def _data_set(model: ModalModel, number: int, side: str, nodes: dict[str, int]) -> str:
    labels, vectors = (model.responses, model.right) if side == "right" else (model.excitations, model.left)
    values, node_numbers = _at_nodes(labels, vectors[number], nodes)
    n_axes, pole = values.shape[1], complex(model.poles[number])
    # model type 1: structural; characteristic 2: translations, 3: with rotations; motion 8: displacement; 5: complex
    codes = (1, COMPLEX_FIRST, 2 if n_axes == 3 else 3, 8, 5, n_axes)
    lines = [
        "    -1",
        "    55",
        f"{side} vector of mode {number + 1}",
        f"{model.quantity}{_SEPARATOR}{model.unit}"[:80],
        *["NONE"] * 3,
        "".join(f"{n:10d}" for n in codes),
        "".join(f"{n:10d}" for n in (2, 6, 1, number + 1)),
        _fields([pole.real, pole.imag, 1.0, 0.0, -pole.real, -pole.imag]),
    ]
    for node, row in zip(node_numbers, values, strict=True):
        pairs = np.column_stack([row.real, row.imag]).ravel()
        lines.append(f"{node:10d}")
        lines += [_fields(pairs[start : start + 6]) for start in range(0, len(pairs), 6)]
    return "\n".join([*lines, "    -1", ""])


def _at_nodes(labels: Sequence[str], vector: Complex, nodes: dict[str, int]) -> tuple[Complex, list[int]]:
    """Return values (n_nodes, 3 or 6) along positive axes, and the numbers of the nodes."""
    parsed = [DegreeOfFreedom.parse(label) for label in labels]
    names = list(dict.fromkeys(dof.node for dof in parsed))
    n_axes = 3 if all(dof.axis in _AXES[:3] for dof in parsed) else len(_AXES)
    values = np.zeros((len(names), n_axes), dtype=complex)
    for component, dof in zip(vector, parsed, strict=True):
        values[names.index(dof.node), _AXES.index(dof.axis)] = component * dof.sign
    return values, [nodes[name] for name in names]


def _fields(numbers: Sequence[float] | Real) -> str:
    return "".join(f"{number:13.5e}" for number in numbers)
