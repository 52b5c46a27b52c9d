"""The axis of a joint as a term of a modal model file holds it, and back."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .joint_axis import JointAxis, ModalScales

Complex = NDArray[np.complex128]


def axis_location(axis: JointAxis) -> dict[str, Any]:
    """Location of a joint in a file: ``direction``, or ``participation`` of each mode with its two scales."""
    entries = [float(x) for x in axis.entries]
    if axis.scales is None:
        return {"direction": entries}
    scales = {"seen": _pairs(axis.scales.seen), "pushed": _pairs(axis.scales.pushed)}
    return {"participation": entries, "scales": scales}


def axis_of(location: Mapping[str, Any]) -> JointAxis | None:
    """The axis that a location holds; None where it is that of no joint.

    Raises
    ------
    KeyError, TypeError, ValueError
        The location is incomplete.
    """
    if "direction" in location:
        return JointAxis(np.array(location["direction"], dtype=float))
    if "participation" not in location:
        return None
    seen, pushed = (_numbers(location["scales"][name]) for name in ("seen", "pushed"))
    return JointAxis(np.array(location["participation"], dtype=float), ModalScales(seen, pushed))


def _pairs(numbers: Complex) -> list[list[float]]:
    return [[float(x.real), float(x.imag)] for x in numbers]


def _numbers(pairs: list[list[float]]) -> Complex:
    parts = np.array(pairs, dtype=float)
    return np.asarray(parts[:, 0] + 1j * parts[:, 1])
