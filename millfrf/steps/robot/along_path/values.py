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

from ...settings import PATH

# Values of a posture, in the order of the fields of :class:`PostureValues`
ValueRow = tuple[float, float, str, str, float, Real, Real]


@dataclass(frozen=True)
class PathCut:
    """Robot and cut of a path."""

    robot: SpatialRobot
    process: MillingProcess
    speed: float  # rad/s; spindle speed of the cut
    max_depth: float  # m; largest depth that is searched
    payload: Payload  # load besides the bodies of the robot's file
    highest_frequency: float = np.inf  # Hz; modes above are replaced by their static flexibility


@dataclass(frozen=True)
class PostureRequest:
    """A posture q (n_moving,), axes of the cut (3, 3) as columns and the wrench (6,) on the tool, base frame."""

    q: Real
    axes: Real
    wrench: Real


@dataclass(frozen=True)
class PostureValues:
    """Values of n postures."""

    depth: Real  # (n,), m; depth limit; infinite above the largest depth, NaN where it is not known
    frequency: Real  # (n,), Hz; chatter frequency; NaN where there is no limit
    kind: tuple[str, ...]  # bifurcation, as in ``StabilityLobes``
    status: tuple[str, ...]
    lowest: Real  # (n,), Hz; lowest natural frequency
    cut: Real  # (n, 6), m and rad; deflection under the cut, base frame
    weight: Real  # (n, 6), m and rad; deflection under own weight and payload, base frame

    def rows(self) -> list[ValueRow]:
        """One row for each posture, in the order of the fields."""
        columns = (self.depth, self.frequency, self.kind, self.status, self.lowest, self.cut, self.weight)
        return list(zip(*columns, strict=True))

    def over(self, reached: NDArray[np.bool_]) -> "PostureValues":
        """The values over all places, with NaN and ``not reached`` at those that were not ``reached``."""
        if reached.all():
            return self
        missing: ValueRow = (np.nan, np.nan, "none", "not reached", np.nan, np.full(6, np.nan), np.full(6, np.nan))
        rows = iter(self.rows())
        return of_rows([next(rows) if is_reached else missing for is_reached in reached])

    def known_depth(self, max_depth: float) -> Real:
        """Depth that is proven, m, (n,): at most ``max_depth``, zero where nothing is known."""
        return np.minimum(np.where(np.isnan(self.depth), 0.0, self.depth), max_depth)


def values_of(cut: PathCut, requests: Sequence[PostureRequest], pool: Executor | None = None) -> PostureValues:
    """Evaluate postures: certified limit at the path's speed, lowest frequency, deflections.

    Postures with the same poles and residues share a solution: on a spindle in line with the last joint, all turns
    about the tool.
    """
    size = max(1, min(PATH.postures_per_task, len(requests) // 4))
    parts = [list(requests[i : i + size]) for i in range(0, len(requests), size)]
    evaluated = list((map if pool is None else pool.map)(_rows, [cut] * len(parts), parts))
    return of_rows([row for part in evaluated for row in part])


def of_rows(rows: Sequence[ValueRow]) -> PostureValues:
    """Values from one row for each posture, in the order of the fields."""
    depth, frequency, lowest = (np.array([row[i] for row in rows], dtype=float) for i in (0, 1, 4))
    moved, sag = (np.array([row[i] for row in rows]).reshape(len(rows), 6) for i in (5, 6))
    kind, status = (tuple(str(row[i]) for row in rows) for i in (2, 3))
    return PostureValues(depth, frequency, kind, status, lowest, moved, sag)


def _rows(cut: PathCut, requests: Sequence[PostureRequest]) -> list[ValueRow]:
    solved: list[tuple[ModalModel, tuple[float, float, str, str]]] = []
    rows: list[ValueRow] = []
    for request in requests:
        modes = modes_at(cut.robot, request.q)
        model = model_of_modes(modes, cut.robot, axes=request.axes, highest_frequency=cut.highest_frequency)
        limit = next((limit for other, limit in solved if _same_model(model, other)), None)
        if limit is None:
            limit = _limit(cut, model)
            solved.append((model, limit))
        moved, sag = tool_deflection(cut.robot, request.q, request.wrench, cut.payload)
        rows.append((*limit, float(modes.frequencies[0]), moved, sag))
    return rows


def _limit(cut: PathCut, model: ModalModel) -> tuple[float, float, str, str]:
    lobes = certified_lobes(model, cut.process, np.array([cut.speed]), cut.max_depth)
    return float(lobes.depth_limits[0]), float(lobes.chatter_frequencies[0]), lobes.bifurcations[0], lobes.status[0]


def _same_model(first: ModalModel, second: ModalModel) -> bool:
    """Return whether two models have the same poles and residues."""
    if len(first.poles) != len(second.poles) or not np.allclose(
        first.poles, second.poles, rtol=PATH.same_model, atol=0
    ):
        return False
    residues = [np.einsum("rp,rq->rpq", model.right, model.left) for model in (first, second)]
    return bool(np.abs(residues[0] - residues[1]).max() <= PATH.same_model * np.abs(residues[0]).max())


@dataclass(frozen=True)
class KeptModes:
    """Modes up to which limits are computed."""

    highest_frequency: float  # Hz
    reference: float  # Hz; highest frequency of the reference
    change: float  # largest relative difference of a limit from that of the reference
    checked: int  # number of postures that were compared


def kept_modes(cut: PathCut, samples: Sequence[PostureRequest], pool: Executor | None = None) -> KeptModes:
    """Find the fewest modes whose limits lie within 0.5 % of a reference with many more, at the sampled postures.

    Modes that are not kept are replaced by their static flexibility, so that only their dynamics is lost. The
    reference has all modes with at most 15 periods in a tooth period.
    """
    # every step is compared with the reference, not with the next step: a mode at 400 Hz can lower a limit that was
    # the same with 8 modes and with 11
    frequencies = [modes_at(cut.robot, sample.q).frequencies for sample in samples]
    size = min(len(values) for values in frequencies)
    steps = [_above(frequencies, count) for count in PATH.mode_counts if count < size]
    steps += [np.inf] if size <= PATH.mode_counts[-1] else []
    all_of_them = 1.0001 * max(float(values[-1]) for values in frequencies)
    most = PATH.periods_in_tooth_period * cut.process.teeth * cut.speed / (2 * np.pi)
    steps = [step for step in steps if min(step, all_of_them) <= most] or steps[:1]
    reference = _limits(replace(cut, highest_frequency=steps[-1]), samples, pool)
    for step in steps[:-1]:
        change = float(np.abs(_limits(replace(cut, highest_frequency=step), samples, pool) / reference - 1).max())
        if change < PATH.negligible_change:
            return KeptModes(step, steps[-1], change, len(samples))
    return KeptModes(steps[-1], steps[-1], 0.0, len(samples))


def change_with_more(cut: PathCut, reference: float, samples: Sequence[PostureRequest], pool: Executor | None) -> float:
    """Largest relative change of the limits at some postures if modes up to ``reference`` (Hz) are kept."""
    few, many = (_limits(each, samples, pool) for each in (cut, replace(cut, highest_frequency=reference)))
    return float(np.abs(few / many - 1).max())


def _above(frequencies: Sequence[Real], count: int) -> float:
    """Return a frequency below which at least ``count`` modes lie in every posture.

    If there is a gap above these modes, the frequency is in its middle: a frequency just above the highest mode would
    exclude this mode in a posture that was not sampled.

    Examples
    --------
    >>> round(_above([np.array([10.0, 100.0, 400.0]), np.array([11.0, 96.0, 420.0])], 2))
    200
    >>> round(_above([np.array([10.0, 100.0, 120.0]), np.array([11.0, 130.0, 150.0])], 2))
    130
    """
    below = max(float(values[count - 1]) for values in frequencies)
    return max(1.0001 * below, float(np.sqrt(below * min(float(values[count]) for values in frequencies))))


def _limits(cut: PathCut, samples: Sequence[PostureRequest], pool: Executor | None) -> Real:
    return np.maximum(values_of(cut, samples, pool).known_depth(cut.max_depth), 1e-9)
