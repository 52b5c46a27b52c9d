"""`open`: any file that the product knows, as what it holds."""

from collections.abc import Callable, Mapping
from typing import Any

from acquisition import Recording
from estimation import read_frf, read_geometry
from millfrf.core.steps import File
from millfrf.core.terminal import warn
from millfrf.cutting import read_cutting_process
from millfrf.gate import FileKind, kind_of, stored_doubts
from millfrf.mismatch import read_diagnosis
from millfrf.stability import read_cuts, read_lobes
from modal_fit import read_modal_model, read_picked_poles

READERS: Mapping[str, Callable[[File], Any]] = {
    FileKind.RECORDING: Recording,
    FileKind.FRF: read_frf,
    FileKind.MODEL: read_modal_model,
    FileKind.LOBES: read_lobes,
    FileKind.CUTTING: read_cutting_process,
    FileKind.GEOMETRY: read_geometry,
    FileKind.CHATTER: read_cuts,
    FileKind.POLES: read_picked_poles,
    FileKind.DIAGNOSIS: read_diagnosis,
}
"""What reads each kind of file."""


def open(path: File) -> Any:
    """What a file holds: a recording, an FRF, a modal model, lobes, a diagnosis, a cut, a geometry, verdicts or poles.

    A recording stays open until it is closed; use it in a ``with`` block. Doubts that a file states of its making are
    warned of.

    Parameters
    ----------
    path
        Name of the file; what it is is told by what it holds, not by its suffix.

    Returns
    -------
    Recording, Frf, ModalModel, StabilityLobes, Diagnosis, MillingProcess, Geometry, tuple of KeptCut, or array of poles

    Raises
    ------
    InputError
        There is no such file.
    FileFormatError
        It is none of these; the message names what they are.
    """
    kind = kind_of(path)
    found = READERS[kind](path)
    if kind in (FileKind.FRF, FileKind.MODEL):
        warn(stored_doubts(path), 3)
    return found
