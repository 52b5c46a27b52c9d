"""Depth limit, chatter frequency and deflection of postures along a path."""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Real
from millfrf.cutting import MillingProcess
from millfrf.robot_model import Payload, SpatialRobot, model_of_modes, modes_at, tool_deflection
from millfrf.stability import certified_lobes
from modal_fit import ModalModel

_SAME = 1e-7
"""Relative difference of poles and residues below which two postures have one limit."""

_CHUNK = 24
"""Postures that one process takes at a time, at most: those of one point stand together."""

ValueRow = tuple[float, float, str, str, float, Real, Real]
"""Values of a posture, in the order of the fields of :class:`PostureValues`."""


@dataclass(frozen=True)
class PathCut:
    """Robot and cut of a path.

    Parameters
    ----------
    robot
        Robot with structure and masses.
    process
        Cutter and engagement.
    speed : rad/s
        Spindle speed of the cut.
    max_depth : m
        Largest depth that is searched.
    payload
        Load besides the bodies of the robot's file.
    highest_frequency : Hz
        Natural frequency up to which modes are kept; higher ones are left as their static flexibility.
    """

    robot: SpatialRobot
    process: MillingProcess
    speed: float
    max_depth: float
    payload: Payload
    highest_frequency: float = np.inf


@dataclass(frozen=True)
class Request:
    """A posture q (n_moving,), axes of the cut (3, 3) as columns and the wrench (6,) on the tool, base frame."""

    q: Real
    axes: Real
    wrench: Real


@dataclass(frozen=True)
class PostureValues:
    """Values of n postures.

    Parameters
    ----------
    depth : (n,), m
        Depth limit; infinite above the largest depth, NaN where it is not known.
    frequency : (n,), Hz
        Chatter frequency; NaN where there is no limit.
    kind, status
        Bifurcation and worth of the limit, as in ``StabilityLobes``.
    lowest : (n,), Hz
        Lowest natural frequency.
    cut, weight : (n, 6), m and rad
        Deflection under the cut, and under own weight and payload, base frame.
    """

    depth: Real
    frequency: Real
    kind: tuple[str, ...]
    status: tuple[str, ...]
    lowest: Real
    cut: Real
    weight: Real

    def rows(self) -> list[ValueRow]:
        """One row for each posture, in the order of the fields."""
        columns = (self.depth, self.frequency, self.kind, self.status, self.lowest, self.cut, self.weight)
        return list(zip(*columns, strict=True))

    def over(self, reached: NDArray[np.bool_]) -> "PostureValues":
        """The values over all places of which these were ``reached``: NaN and ``not reached`` at the others."""
        if reached.all():
            return self
        missing: ValueRow = (np.nan, np.nan, "none", "not reached", np.nan, np.full(6, np.nan), np.full(6, np.nan))
        rows = iter(self.rows())
        return of_rows([next(rows) if here else missing for here in reached])

    def known_depth(self, max_depth: float) -> Real:
        """Depth that is proven, m, (n,): at most ``max_depth``, zero where nothing is known."""
        return np.minimum(np.where(np.isnan(self.depth), 0.0, self.depth), max_depth)


def values_of(cut: PathCut, requests: Sequence[Request], pool: Executor | None = None) -> PostureValues:
    """Evaluate postures: certified limit at the path's speed, lowest frequency, deflections.

    :func:`millfrf.stability.certified_lobes` of the modal model in the axes of the cut. Postures whose poles and
    residues agree share a solution: on a spindle in line with the last joint, all turns about the tool.
    """
    size = max(1, min(_CHUNK, len(requests) // 4))
    parts = [list(requests[i : i + size]) for i in range(0, len(requests), size)]
    evaluated = list((map if pool is None else pool.map)(_rows, [cut] * len(parts), parts))
    return of_rows([row for part in evaluated for row in part])


def of_rows(rows: Sequence[ValueRow]) -> PostureValues:
    """Values from one row for each posture, in the order of the fields."""
    depth, frequency, lowest = (np.array([row[i] for row in rows], dtype=float) for i in (0, 1, 4))
    moved, sag = (np.array([row[i] for row in rows]).reshape(len(rows), 6) for i in (5, 6))
    kind, status = (tuple(str(row[i]) for row in rows) for i in (2, 3))
    return PostureValues(depth, frequency, kind, status, lowest, moved, sag)


def _rows(cut: PathCut, requests: Sequence[Request]) -> list[ValueRow]:
    known: list[tuple[ModalModel, tuple[float, float, str, str]]] = []
    rows: list[ValueRow] = []
    for request in requests:
        modes = modes_at(cut.robot, request.q)
        model = model_of_modes(modes, cut.robot, axes=request.axes, highest_frequency=cut.highest_frequency)
        limit = next((limit for other, limit in known if _alike(model, other)), None)
        if limit is None:
            limit = _limit(cut, model)
            known.append((model, limit))
        moved, sag = tool_deflection(cut.robot, request.q, request.wrench, cut.payload)
        rows.append((*limit, float(modes.frequencies[0]), moved, sag))
    return rows


def _limit(cut: PathCut, model: ModalModel) -> tuple[float, float, str, str]:
    lobes = certified_lobes(model, cut.process, np.array([cut.speed]), cut.max_depth)
    return float(lobes.depth_limits[0]), float(lobes.chatter_frequencies[0]), lobes.bifurcations[0], lobes.status[0]


def _alike(first: ModalModel, second: ModalModel) -> bool:
    """Whether two models have the same poles and residues."""
    if len(first.poles) != len(second.poles) or not np.allclose(first.poles, second.poles, rtol=_SAME, atol=0):
        return False
    residues = [np.einsum("rp,rq->rpq", model.right, model.left) for model in (first, second)]
    return bool(np.abs(residues[0] - residues[1]).max() <= _SAME * np.abs(residues[0]).max())


SETTLED = 5e-3
"""Relative change of the limits at which more modes change nothing that a cut would show."""

_COUNTS = (8, 11, 15, 20, 27)
"""Numbers of modes that are tried; the last is the reference, a kilohertz on a heavy robot."""

_MOST_TURNS = 15.0
"""Turns of the highest mode in a tooth period up to which the reference goes: the cost grows with the third power."""


@dataclass(frozen=True)
class KeptModes:
    """Modes up to which limits are computed.

    Parameters
    ----------
    highest_frequency : Hz
        Natural frequency up to which modes are kept.
    reference : Hz
        The same of the reference that the limits were compared with.
    change
        Largest relative difference of a limit from the reference's.
    checked
        Number of postures that were compared.
    """

    highest_frequency: float
    reference: float
    change: float
    checked: int


def kept_modes(cut: PathCut, samples: Sequence[Request], pool: Executor | None = None) -> KeptModes:
    """Find the fewest modes whose limits lie within 0.5 % of a reference with many more, at the sampled postures.

    Modes that are not kept are replaced by their static flexibility, so that only their dynamics is lost. The
    reference has all modes that turn at most 15 times in a tooth period. A step that changes nothing proves nothing: a
    mode at 400 Hz can lower a limit that was the same with 8 modes and with 11.
    """
    frequencies = [modes_at(cut.robot, sample.q).frequencies for sample in samples]
    size = min(len(values) for values in frequencies)
    steps = [_above(frequencies, count) for count in _COUNTS if count < size]
    steps += [np.inf] if size <= _COUNTS[-1] else []
    all_of_them = 1.0001 * max(float(values[-1]) for values in frequencies)
    most = _MOST_TURNS * cut.process.teeth * cut.speed / (2 * np.pi)
    steps = [step for step in steps if min(step, all_of_them) <= most] or steps[:1]
    reference = _limits(replace(cut, highest_frequency=steps[-1]), samples, pool)
    for step in steps[:-1]:
        change = float(np.abs(_limits(replace(cut, highest_frequency=step), samples, pool) / reference - 1).max())
        if change < SETTLED:
            return KeptModes(step, steps[-1], change, len(samples))
    return KeptModes(steps[-1], steps[-1], 0.0, len(samples))


def change_with_more(cut: PathCut, reference: float, samples: Sequence[Request], pool: Executor | None) -> float:
    """Largest relative change of the limits at some postures if modes up to ``reference`` (Hz) are kept."""
    few, many = (_limits(each, samples, pool) for each in (cut, replace(cut, highest_frequency=reference)))
    return float(np.abs(few / many - 1).max())


def _above(frequencies: Sequence[Real], count: int) -> float:
    """Frequency below which ``count`` modes lie at every posture: in the middle of the gap above them, where one is.

    Just above the highest of them it would cut off the same mode at a posture that was not sampled.

    Examples
    --------
    >>> round(_above([np.array([10.0, 100.0, 400.0]), np.array([11.0, 96.0, 420.0])], 2))
    200
    >>> round(_above([np.array([10.0, 100.0, 120.0]), np.array([11.0, 130.0, 150.0])], 2))
    130
    """
    below = max(float(values[count - 1]) for values in frequencies)
    return max(1.0001 * below, float(np.sqrt(below * min(float(values[count]) for values in frequencies))))


def _limits(cut: PathCut, samples: Sequence[Request], pool: Executor | None) -> Real:
    return np.maximum(values_of(cut, samples, pool).known_depth(cut.max_depth), 1e-9)
