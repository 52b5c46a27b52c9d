"""Tool and workpiece that both move: their receptances at the cut add up."""

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Band, DegreeOfFreedom, InputError, Real
from modal_fit import ModalModel, Residuals, pack_parameters

from .tip_receptance import ToolDirections, tool_directions, with_residual_flexibility


def with_workpiece(tool: ModalModel, workpiece: ModalModel) -> ModalModel:
    """Return one model of the motion of the tool relative to the workpiece, for a force on the tool.

    The workpiece receives the opposite force and moves by ``-H_w F``, so that the relative receptance is
    ``H = H_tool + H_w`` (Altintas, Manufacturing Automation, 2nd ed., section 3.8). A direction that only one of them
    was measured in counts as rigid in the other.

    Parameters
    ----------
    tool
        Receptance in m/N at the tool, in the cut's X (feed), Y (normal) and Z (axial).
    workpiece
        Receptance in m/N at the place of the cut, in the same directions; its point may have another name.

    Returns
    -------
    ModalModel
        The modes of both, at the tool's point, in the band that both have in common. Covariances are joined as those
        of independent measurements, where both are known.

    Raises
    ------
    InputError
        A receptance that cannot be used, terms of a diagnosis, or bands that do not meet.

    Examples
    --------
    >>> mode = ModalModel(np.array([-2 + 100j]), np.array([[-1e-4j]]), np.ones((1, 1)) + 0j, ("T:+X",), ("T:+X",))
    >>> wall = ModalModel(np.array([-5 + 900j]), np.array([[-1e-5j]]), np.ones((1, 1)) + 0j, ("P:-X",), ("P:-X",))
    >>> both = with_workpiece(mode, wall)
    >>> both.responses, bool(np.allclose(both.receptance([2.0]), mode.receptance([2.0]) + wall.receptance([2.0])))
    (('T:+X',), True)
    """
    parts = [with_residual_flexibility(tool), with_residual_flexibility(workpiece)]
    for part, words in zip(parts, ("tool", "workpiece"), strict=True):
        if part.physics:
            raise InputError(f"the {words}'s model has terms of a diagnosis, which do not add up; give a linear model")
    directions = [tool_directions(part) for part in parts]
    node = DegreeOfFreedom.parse(tool.excitations[0]).node
    rows, columns = (
        sorted({axis for each in directions for axis in getattr(each, name).axes})
        for name in ("responses", "excitations")
    )
    right = np.concatenate(
        [each.responses.place(part.right)[:, rows] for each, part in zip(directions, parts, strict=True)]
    )
    left = np.concatenate(
        [each.excitations.place(part.left)[:, columns] for each, part in zip(directions, parts, strict=True)]
    )
    return ModalModel(
        np.concatenate([part.poles for part in parts]),
        right,
        left,
        tuple(f"{node}:+{'XYZ'[axis]}" for axis in rows),
        tuple(f"{node}:+{'XYZ'[axis]}" for axis in columns),
        residuals=_residuals(parts, directions, rows, columns),
        covariance=_covariance(parts, directions, rows, columns),
        band=_common_band(parts),
        unmeasured_flexibility=_sum_of_bounds(parts),
        measured=_measured(parts, directions, rows, columns),
    )


def _residuals(
    parts: list[ModalModel], directions: list[ToolDirections], rows: list[int], columns: list[int]
) -> Residuals | None:
    """Return the sum of the residuals; None if no part has any."""
    upper, lower, present = np.zeros((3, 3)), np.zeros((3, 3)), False
    for part, each in zip(parts, directions, strict=True):
        if part.residuals is not None:
            upper, lower = upper + each.place(part.residuals.upper), lower + each.place(part.residuals.lower)
            present = True
    chosen = np.ix_(rows, columns)
    return Residuals(upper[chosen], lower[chosen]) if present else None


def _covariance(
    parts: list[ModalModel], directions: list[ToolDirections], rows: list[int], columns: list[int]
) -> Real | None:
    """Return the covariance of the joined parameters, which are a linear function of those of the parts."""
    known = [part.covariance for part in parts if part.covariance is not None]
    if len(known) < len(parts):
        return None
    total = sum(len(part.poles) for part in parts)
    size = 2 * total * (1 + len(rows) + len(columns))
    joined, first = np.zeros((size, size)), 0
    for part, covariance, each in zip(parts, known, directions, strict=True):
        count = len(part.poles)
        places = first + np.arange(count)
        right = each.responses.place(np.eye(part.right.shape[1]))[:, rows]
        left = each.excitations.place(np.eye(part.left.shape[1]))[:, columns]
        jacobian = np.zeros((size, len(pack_parameters(part))))
        begin_of, begin_in = 0, 0
        for change in (np.eye(1), np.eye(1), right, right, left, left):
            width_of, width_in = change.shape
            for mode in range(count):
                out = begin_in + places[mode] * width_in
                source = begin_of + mode * width_of
                jacobian[out : out + width_in, source : source + width_of] = change.T
            begin_of, begin_in = begin_of + count * width_of, begin_in + total * width_in
        joined += jacobian @ covariance @ jacobian.T
        first += count
    return joined


def _common_band(parts: list[ModalModel]) -> Band | None:
    """Return the frequencies (Hz) that all parts with a stated band have in common."""
    bands = [part.band for part in parts if part.band is not None]
    if not bands:
        return None
    low, high = max(band[0] for band in bands), min(band[1] for band in bands)
    if low >= high:
        stated = " and ".join(f"{band[0]:g} to {band[1]:g} Hz" for band in bands)
        raise InputError(f"the bands of tool and workpiece, {stated}, do not meet; measure both in one band")
    return low, high


def _sum_of_bounds(parts: list[ModalModel]) -> float | None:
    known = [part.unmeasured_flexibility for part in parts if part.unmeasured_flexibility is not None]
    return sum(known) if len(known) == len(parts) else None


def _measured(
    parts: list[ModalModel], directions: list[ToolDirections], rows: list[int], columns: list[int]
) -> NDArray[np.bool_] | None:
    """Return which entries both parts know; None: all of those that they have."""
    if all(part.measured is None for part in parts):
        return None
    known = np.ones((3, 3), dtype=bool)
    for part, each in zip(parts, directions, strict=True):
        if part.measured is not None:
            known &= each.place(np.where(part.measured, 0.0, 1.0)) == 0
    return known[np.ix_(rows, columns)]
