"""Modal models in the Universal File Format, data set 55: complex modes, right and left vectors apart."""

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from foundation import DegreeOfFreedom, FileFormatError, InputError, writing_whole_file

from .modal_model import ModalModel

Complex = NDArray[np.complex128]
_COMPLEX_MODE = 3  # analysis type: complex eigenvalue, first order
_SIDES = ("right", "left")


def write_modes_uff(path: str | os.PathLike[str], model: ModalModel) -> None:
    """Write each mode as two data sets 55, one of its right and one of its left vector.

    The first identification line says ``right`` or ``left``, the second names the nodes in the order of their numbers.
    The format holds six digits; residuals and covariance have no place in it.

    Parameters
    ----------
    path
        ``.uff`` or ``.unv``.
    model
        With translations as degrees of freedom.

    Raises
    ------
    InputError
        Another suffix, a rotation, or the package pyuff is missing.
    """
    if Path(path).suffix.lower() not in (".uff", ".unv"):
        raise InputError(f"cannot write {path}: UFF files end in .uff or .unv; change the suffix")
    parsed = [DegreeOfFreedom.parse(label) for label in (*model.responses, *model.excitations)]
    turning = [dof for dof in parsed if dof.axis not in ("X", "Y", "Z")]
    if turning:
        raise InputError(f"{turning[0].node}:{turning[0].axis} is a rotation; only translations are written to UFF")
    nodes = list(dict.fromkeys(dof.node for dof in parsed))
    sets = []
    for number, pole in enumerate(model.poles):
        for side, labels in zip(_SIDES, (model.responses, model.excitations), strict=True):
            sets.append(_data_set(model, number, complex(pole), side, labels, nodes))
    with writing_whole_file(path) as temporary:
        _pyuff().UFF(str(temporary)).write_sets(sets, "overwrite")


def read_modes_uff(path: str | os.PathLike[str], unit: str = "m/N") -> ModalModel:
    """Read what :func:`write_modes_uff` wrote.

    Raises
    ------
    InputError
        No such file, or the package pyuff is missing.
    FileFormatError
        No complex modes inside, or right and left vectors that do not match.
    """
    if not Path(path).is_file():
        raise InputError(f"no file {path}; check the name")
    pyuff = _pyuff()
    try:
        read = pyuff.UFF(str(path)).read_sets()
    except Exception as error:  # whatever a damaged file brings pyuff to
        raise FileFormatError(f"{path} is no readable UFF file ({type(error).__name__}: {error})") from error
    sets = [s for s in (read if isinstance(read, list) else [read]) if s.get("type") == 55]
    sides = {side: [s for s in sets if str(s["id1"]).split()[:1] == [side]] for side in _SIDES}
    if not sides["right"] or len(sides["right"]) != len(sides["left"]):
        raise FileFormatError(f"{path} holds no complex modes with right and left vectors (data set 55)")
    vectors, labels = {}, {}
    for side in _SIDES:
        labels[side] = tuple(str(sides[side][0]["id3"]).split())
        vectors[side] = np.array([_vector(s, labels[side]) for s in sides[side]])
    poles = np.array([complex(s["eig"]) for s in sides["right"]])
    return ModalModel(
        poles,
        vectors["right"],
        vectors["left"],
        labels["right"],
        labels["left"],
        "receptance" if unit == "m/N" else "transfer",
        unit,
    )


def _data_set(
    model: ModalModel, number: int, pole: complex, side: str, labels: tuple[str, ...], nodes: list[str]
) -> dict[str, Any]:
    vector = (model.right if side == "right" else model.left)[number]
    values = np.zeros((3, len(nodes)), dtype=complex)
    for component, label in zip(vector, labels, strict=True):
        dof = DegreeOfFreedom.parse(label)
        values["XYZ".index(dof.axis), nodes.index(dof.node)] = component * dof.sign
    return {
        "type": 55,
        "id1": f"{side} vector of mode {number + 1}, {model.quantity}",
        "id2": " ".join(nodes),
        "id3": " ".join(labels),
        "model_type": 1,
        "analysis_type": _COMPLEX_MODE,
        "data_ch": 2,
        "spec_data_type": 8,
        "load_case": 1,
        "mode_n": number + 1,
        "eig": pole,
        "modal_a": 1 + 0j,
        "modal_b": -pole,
        "node_nums": np.arange(1, len(nodes) + 1),
        "r1": values[0],
        "r2": values[1],
        "r3": values[2],
    }


def _vector(data_set: dict[str, Any], labels: tuple[str, ...]) -> Complex:
    nodes = str(data_set["id2"]).split()
    values = np.array([data_set["r1"], data_set["r2"], data_set["r3"]], dtype=complex)
    found = []
    for label in labels:
        dof = DegreeOfFreedom.parse(label)
        found.append(values["XYZ".index(dof.axis), nodes.index(dof.node)] * dof.sign)
    return np.array(found)


def _pyuff() -> Any:
    try:
        import pyuff
    except ModuleNotFoundError as error:
        raise InputError("UFF files need the package pyuff; install it with 'pip install millfrf[formats]'") from error
    return pyuff
