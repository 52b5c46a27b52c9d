"""Modal models from modes of other programs, which have one vector and perhaps a modal mass each."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition import read_uff_sets
from foundation import FileFormatError

from ..models import ModalModel
from .mode_sets import NORMAL, ModeSet
from .shapes import poles_of, shapes_of

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
