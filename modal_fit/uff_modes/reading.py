"""Modal models from UFF files: those written here, with right and left vectors, and those of other programs."""

import os
from pathlib import Path

from foundation import FileFormatError

from ..models.modal_model import ModalModel
from .foreign import foreign_model
from .groups import vector_labels
from .mode_sets import ModeSet, read_mode_sets
from .shapes import poles_of, shapes_at, shapes_of

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
