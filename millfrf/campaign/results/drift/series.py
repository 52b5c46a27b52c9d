"""`Series`: one quantity of one mode in one pose through its sets."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..identity import IdentifiedModes, ModeOfPose
from ..read_set import SetResults

Real = NDArray[np.float64]

FREQUENCY, DAMPING, DEPTH = "frequency", "damping ratio", "depth limit"
QUANTITIES = (FREQUENCY, DAMPING, DEPTH)


@dataclass(frozen=True)
class Series:
    """One quantity through the sets of a pose.

    Parameters
    ----------
    pose
        Name of the pose.
    mode
        Number of the mode in the campaign; 0: the quantity belongs to no mode.
    frequency : Hz
        Mean natural frequency of the mode; NaN without a mode.
    quantity
        ``frequency``, ``damping ratio`` or ``depth limit``.
    rows
        Numbers of the sets, rising.
    logs : (n,)
        Natural logarithms of the quantity in SI units.
    errors : (n,)
        Their standard errors as the fits state them; 0 where none is known.
    """

    pose: str
    mode: int
    frequency: float
    quantity: str
    rows: tuple[int, ...]
    logs: Real
    errors: Real


def series_of(sets: Sequence[SetResults], modes: IdentifiedModes) -> list[Series]:
    """Collect the series of all poses; a mode that may be another one in a set is left out there.

    Parameters
    ----------
    sets
        Sets of the campaign, as read.
    modes
        Which modes are the same.
    """
    number = {one.name: row for row, one in enumerate(sets)}
    found = [series for mode in modes.modes for series in _of_mode(sets, mode, number)]
    for pose in sorted({one.measured.pose for one in sets}):
        found += _of_depth(sets, pose)
    return found


def _of_mode(sets: Sequence[SetResults], mode: ModeOfPose, number: dict[str, int]) -> list[Series]:
    members = sorted((number[name], index) for name, index in mode.members.items() if name not in mode.doubted)
    rows = tuple(row for row, _ in members)
    values, errors = np.zeros((len(rows), 2)), np.zeros((len(rows), 2))
    for k, (row, index) in enumerate(members):
        model = sets[row].model
        assert model is not None
        values[k] = model.natural_frequencies[index], model.damping_ratios[index]
        errors[k] = [part[index] for part in sets[row].errors]
    usable = np.asarray((values > 0).all(axis=1))
    rows = tuple(rows[k] for k in np.flatnonzero(usable))
    logs, relative = np.log(values[usable]), np.nan_to_num(errors[usable] / values[usable])
    return [
        Series(mode.pose, mode.number, mode.frequency, quantity, rows, logs[:, k], relative[:, k])
        for k, quantity in enumerate((FREQUENCY, DAMPING))
        if rows
    ]


def _of_depth(sets: Sequence[SetResults], pose: str) -> list[Series]:
    known = [
        (row, one.limit.depth)
        for row, one in enumerate(sets)
        if one.measured.pose == pose and one.limit is not None and np.isfinite(one.limit.depth)
    ]
    if not known:
        return []
    rows = tuple(row for row, _ in known)
    return [Series(pose, 0, np.nan, DEPTH, rows, np.log([depth for _, depth in known]), np.zeros(len(rows)))]
