"""Places as files write them, shift and three angles, and the 4 x 4 matrices that they mean."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Real = NDArray[np.float64]

_SMALLEST, _LARGEST = 1e-12, 1e5
"""Sizes of the largest entry of an inertia, kg m^2."""


def place_of(shift: Sequence[float], angles: Sequence[float]) -> Real:
    """Shift (3,), m, and turns about the fixed axes x, y and z in turn (roll, pitch, yaw as in URDF), rad; (4, 4).

    Examples
    --------
    >>> place_of((0.0, 0.0, 1.0), (np.pi / 2, 0.0, 0.0))[:3, 2].round(12).tolist()
    [0.0, -1.0, 0.0]
    """
    place = np.eye(4)
    place[:3, :3] = Rotation.from_euler("xyz", angles).as_matrix()
    place[:3, 3] = shift
    return place


def shift_and_angles(place: Real) -> tuple[list[float], list[float]]:
    """The way back: shift, m, and roll, pitch, yaw, rad."""
    rotation = place[:3, :3]
    pitch = float(np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0])))
    if np.hypot(rotation[0, 0], rotation[1, 0]) > 1e-12:
        roll = float(np.arctan2(rotation[2, 1], rotation[2, 2]))
        yaw = float(np.arctan2(rotation[1, 0], rotation[0, 0]))
    else:  # pitch +-90 degrees: roll and yaw turn about one axis
        roll, yaw = 0.0, float(np.arctan2(-rotation[0, 1], rotation[1, 1]))
    return [float(value) for value in place[:3, 3]], [roll, pitch, yaw]


def symmetric(six: Sequence[float]) -> Real:
    """``(xx, yy, zz, xy, xz, yz)``, or three on the diagonal, as a symmetric matrix (3, 3)."""
    xx, yy, zz, xy, xz, yz = (*six, 0.0, 0.0, 0.0) if len(six) == 3 else six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def six_of(matrix: Real) -> list[float]:
    """``(xx, yy, zz, xy, xz, yz)`` of a symmetric matrix (3, 3)."""
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return [float(matrix[i, j] + matrix[j, i]) / 2 for i, j in pairs]


def inertia_fault(inertia: Real, tolerance: float = 1e-3) -> str | None:
    """Why no body can have this inertia (3, 3), kg m^2, about its centre; or None.

    Principal moments are not negative, and none is larger than the other two together. ``tolerance`` is the share of
    the largest that rounding may take.
    """
    if not np.allclose(inertia, inertia.T, rtol=0, atol=1e-9 * max(float(np.abs(inertia).max()), 1e-300)):
        return "it is not symmetric"
    largest = float(np.abs(inertia).max())
    if largest > _LARGEST or 0 < largest < _SMALLEST:
        return f"its largest entry is {largest:.3g}; give kg m^2 (size {_SMALLEST:g} to {_LARGEST:g})"
    moments = np.linalg.eigvalsh(inertia)
    if moments[0] < -tolerance * max(abs(moments[2]), 1e-12):
        return f"a principal moment is negative: {moments[0]:.4g} kg m^2"
    if moments[2] > moments[0] + moments[1] + tolerance * moments[2] and moments[0] > tolerance * moments[2]:
        return (
            f"principal moments {moments[0]:.4g}, {moments[1]:.4g}, {moments[2]:.4g} kg m^2: no body has one that is "
            "larger than the other two together; check units and axes"
        )
    return None
