"""Intervals of the period of any cut between which the force of its edges is smooth, and their pieces."""

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from millfrf.core import InputError, Real
from millfrf.core.compilation import compiled
from millfrf.cutting import EdgeForces, EdgeSlices, MillingProcess, edge_slices, thin_chip_immersions

LARGEST_PHASE = 5.0  # rad; of the fastest mode in a piece: the cheapest for (phase + 10)^3 / phase operations


def single_delay(process: MillingProcess) -> bool:
    """Check whether all teeth cut the surface of the tooth before them at the same angle, one tooth period ago."""
    return process.equal_pitch and len(set(process.helices)) == 1 and not process.has_offsets


def period_angle(process: MillingProcess) -> float:
    """Return the spindle angle (rad) after which the cut repeats: one tooth, or one revolution where teeth differ."""
    return 2 * math.pi / process.teeth if single_delay(process) else 2 * math.pi


class Teeth(NamedTuple):
    """Constants of a process that do not depend on depth and speed."""

    forces: EdgeForces
    summed: bool  # whether slices that cut as a whole are summed once for all depths
    single_delay: bool
    period: float  # rad
    switches: Real  # (teeth, n), rad: immersions at which another earlier tooth left the surface, or the law changes


@lru_cache(maxsize=64)
def teeth_of(process: MillingProcess) -> Teeth:
    """Return the constants of a process."""
    single = single_delay(process)
    summed = single and bool(process.profile) and not (process.chip_law.varies or process.is_turning)
    return Teeth(EdgeForces.of(process), summed, single, period_angle(process), _switches(process))


def _switches(process: MillingProcess) -> Real:
    """Return immersions (rad) of each tooth between which its force per motion is smooth, (teeth, n), else NaN."""
    teeth = range(process.teeth)
    rows = [(*thin_chip_immersions(process, tooth), *_changes_of_pass(process, tooth)) for tooth in teeth]
    switches = np.full((process.teeth, max(map(len, rows))), np.nan)
    for row, angles in zip(switches, rows, strict=True):
        row[: len(angles)] = angles
    return switches


def _changes_of_pass(process: MillingProcess, tooth: int) -> list[float]:
    """Return the immersions (rad) between which a tooth cuts what one earlier tooth left, or nothing.

    ``h_k = f_k sin(phi) + rho_j - rho_(j+k)`` for the feed f_k since the tooth j + k passed; k of the least, or none
    where it is not positive.
    """
    if not process.runout_decides:
        return []
    teeth = process.teeth
    offsets = process.runout * np.cos(2 * np.pi * np.arange(teeth) / teeth)
    order = (tooth + np.arange(1, teeth + 1)) % teeth
    ahead = np.cumsum(np.roll(process.pitches, -tooth))
    feeds = np.append(process.feed_per_tooth * teeth * ahead / (2 * np.pi), 0.0)
    heights = np.append(offsets[tooth] - offsets[order], 0.0)  # the last: no chip
    with np.errstate(divide="ignore", invalid="ignore"):
        sines = (heights[None, :] - heights[:, None]) / (feeds[:, None] - feeds[None, :])
    sines = np.unique(sines[(sines > 0) & (sines < 1)])
    both = [np.argmin(feeds[:, None] * (sines + shift) + heights[:, None], axis=0) for shift in (-1e-9, 1e-9)]
    angles = np.arcsin(sines[both[0] != both[1]])
    return [*angles.tolist(), *(np.pi - angles).tolist()]


class Pieces(NamedTuple):
    """Pieces of a period, in which the force of the edges is smooth."""

    begins: Real  # (n_pieces,), rad
    ends: Real  # (n_pieces,), rad
    widest: float  # rad


def pieces_of(process: MillingProcess, slices: EdgeSlices, fastest: float) -> Pieces:
    """Divide the period of a cut into pieces.

    Parameters
    ----------
    process, slices
        Cut, and its edges up to the depth.
    fastest
        Phase (rad) by which the fastest mode advances per radian of the spindle.

    Raises
    ------
    InputError
        Two edges that meet.
    """
    teeth = teeth_of(process)
    largest = 0.4 if process.has_offsets else 1.6
    if not teeth.single_delay:
        largest = min(largest, _apart(slices, teeth.forces.pitches))
    return Pieces(*_divided(slices, teeth.forces.aheads, teeth.switches, teeth.period, fastest, largest))


def least_angle(process: MillingProcess, depth: float) -> float:
    """Return the smallest angle (rad) between two edges up to a depth (m).

    Raises
    ------
    InputError
        A depth that the edges do not reach, or below which two of them meet.
    """
    return _apart(edge_slices(process, depth), np.array(process.pitches))


def _apart(slices: EdgeSlices, pitches: Real) -> float:
    """Return the smallest angle (rad) between an edge and the edge before it, at any height."""
    shortest = _shortest_delay(slices, pitches)
    if shortest < math.radians(1.0):
        raise InputError(
            f"two edges come within {math.degrees(shortest):.3g} deg of each other below this depth, as their helix "
            "angles differ; lower the largest depth"
        )
    return float(shortest)


def _slices_example() -> EdgeSlices:
    rows, numbers = np.zeros((1, 2)), np.zeros(1)
    return EdgeSlices(rows[None], rows, rows, rows, numbers, rows[None], rows)


@compiled(example=lambda: (_slices_example(), np.zeros(1)))
def _shortest_delay(slices: EdgeSlices, pitches: Real) -> float:
    shortest, teeth = np.inf, len(pitches)
    for tooth in range(teeth):
        other = (tooth + 1) % teeth
        for row in range(len(slices.widths)):
            for end in range(2):
                lag = slices.lags[other, row, end] - slices.lags[tooth, row, end]
                shortest = min(shortest, pitches[tooth] - lag)
    return float(shortest)


def _divided_example() -> tuple[Any, ...]:
    return _slices_example(), np.zeros(1), np.zeros((1, 1)), 1.0, 1.0, 1.0


@compiled(example=_divided_example)
def _divided(
    slices: EdgeSlices, aheads: Real, switches: Real, period: float, fastest: float, largest: float
) -> tuple[Real, Real, float]:
    """Return begins and ends of the pieces, and the width of the widest; none is wider than ``largest`` (rad)."""
    edges = _piece_edges(slices, aheads, switches, period)
    longest = min(LARGEST_PHASE / fastest, 0.999 * largest)
    begins, ends, widest = [0.0], [0.0], 0.0
    for k in range(len(edges)):
        count = max(1, int(np.ceil((edges[k, 1] - edges[k, 0]) / longest - 1e-9)))
        width = (edges[k, 1] - edges[k, 0]) / count
        widest = max(widest, width)
        for number in range(count):
            begins.append(edges[k, 0] + number * width)
            ends.append(edges[k, 0] + (number + 1) * width)
    return np.array(begins[1:]), np.array(ends[1:]), widest


@compiled
def _piece_edges(slices: EdgeSlices, aheads: Real, switches: Real, period: float) -> Real:
    """Return the spindle angles (rad) between which edges are in the cut, (n, 2), divided at entries and exits.

    Entries and exits count at the ends of the profile's elements. Elsewhere they move smoothly from slice to slice.
    At the immersions ``switches`` (teeth, n), rad, another earlier tooth left the surface; NaN: at fewer.
    """
    teeth, rows = len(aheads), len(slices.widths)
    low, high = np.full(teeth, np.inf), np.full(teeth, -np.inf)
    corners = [0.0, period]
    for tooth in range(teeth):
        for row in range(rows):
            for end in range(2):
                entry = slices.starts[row, end] + slices.lags[tooth, row, end] - aheads[tooth]
                leave = slices.exits[row, end] + slices.lags[tooth, row, end] - aheads[tooth]
                low[tooth], high[tooth] = min(low[tooth], entry), max(high[tooth], leave)
                neighbour = row - 1 if end == 0 else row + 1
                if (
                    not 0 <= neighbour < rows
                    or abs(slices.edge_angles[neighbour, 1 - end] - slices.edge_angles[row, end]) > 1e-9
                ):
                    corners.append(entry % period)
                    corners.append(leave % period)
        corners.append(low[tooth] % period)
        corners.append(high[tooth] % period)
        for switch in switches[tooth]:
            if switch == switch:  # not NaN
                corners.append((switch + slices.lags[tooth, 0, 0] - aheads[tooth]) % period)
                corners.append((switch + slices.lags[tooth, rows - 1, 1] - aheads[tooth]) % period)
    marks = np.sort(np.array(corners))
    return _cut_intervals(marks, low, high, period)


@compiled
def _cut_intervals(marks: Real, low: Real, high: Real, period: float) -> Real:
    """Return the intervals between angles (rad) in which a tooth cuts: from ``low`` to ``high`` (teeth,), rad."""
    edges, count, begin = np.empty((len(marks), 2)), 0, 0.0
    for mark in marks:
        if mark - begin < 1e-9 or (period - mark < 1e-9 and mark != period):
            continue
        middle = (begin + mark) / 2
        if ((middle - low) % period < high - low).any():
            edges[count, 0], edges[count, 1] = begin, mark
            count += 1
        begin = mark
    return edges[:count].copy()
