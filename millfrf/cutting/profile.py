"""Axial profile of a cutter: radius and edge angle along its edges, and slices of the edges in the cut."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from millfrf.core import InputError, Real

if TYPE_CHECKING:
    from .process import MillingProcess

LONGEST_LAG = 0.3  # rad; four Gauss points integrate sin(2 phi) over it to 1e-10
LONGEST_THIN_LAG = 0.05  # rad; where coefficients depend on the chip, which changes fast at entry and exit
LARGEST_TURN = 0.04  # rad; of the edge angle within a slice, whose lag and immersion are taken as linear
LARGEST_BEND = 5e-3  # rad; by which the immersion at the middle of a slice may differ from that of a linear one
WAVE_SLICES = 48  # slices in a wave of a serrated edge


@dataclass(frozen=True)
class ProfileElement:
    """A straight line or an arc of the profile that the edges turn about the axis.

    Along its length s the edge angle is ``kappa(s) = edge_angle + curvature s``, the radius grows by ``cos kappa ds``
    and the height by ``sin kappa ds``. A cylinder has kappa = 90 deg; at the tip of a ball kappa is 0.

    Parameters
    ----------
    radius : m
        Radius at the lower end.
    edge_angle : rad
        Angle between the edge and the plane normal to the axis, at the lower end.
    length : m
        Length along the edge; infinite for the last element.
    curvature : 1/m
        Change of the edge angle per length: zero for a line, 1 / corner radius for an arc.
    """

    radius: float
    edge_angle: float
    length: float = math.inf
    curvature: float = 0.0

    def angle_at(self, s: float) -> float:
        """Return the edge angle (rad) at the length s (m)."""
        return self.edge_angle + self.curvature * s

    def rise(self, s: float) -> float:
        """Return by how much the height (m) grows up to the length s (m)."""
        if self.curvature == 0:
            return s * math.sin(self.edge_angle)
        return (math.cos(self.edge_angle) - math.cos(self.angle_at(s))) / self.curvature

    def radius_at(self, s: float) -> float:
        """Return the radius (m) at the length s (m)."""
        if self.curvature == 0:
            return self.radius + (s * math.cos(self.edge_angle) if math.isfinite(s) else 0.0)
        return self.radius + (math.sin(self.angle_at(s)) - math.sin(self.edge_angle)) / self.curvature

    def length_to(self, rise: float) -> float:
        """Return the length (m) at which the element has risen by ``rise`` (m)."""
        if self.curvature == 0:
            return rise / math.sin(self.edge_angle)
        cosine = math.cos(self.edge_angle) - self.curvature * rise
        return (math.acos(min(1.0, max(-1.0, cosine))) - self.edge_angle) / self.curvature


def ball_profile(diameter: float) -> tuple[ProfileElement, ...]:
    """Return the profile of a ball end mill: a quarter circle of half the diameter (m), then a cylinder."""
    return bull_nose_profile(diameter, diameter / 2)


def bull_nose_profile(diameter: float, corner_radius: float) -> tuple[ProfileElement, ...]:
    """Return the profile of an end mill with a corner radius (m): a quarter circle, then a cylinder.

    Raises
    ------
    InputError
        A corner radius that is not above 0 and at most half the diameter.

    Examples
    --------
    >>> corner, cylinder = bull_nose_profile(0.02, 0.002)
    >>> round(corner.radius, 6), round(corner.rise(corner.length), 6), cylinder.radius
    (0.008, 0.002, 0.01)
    """
    radius = diameter / 2
    if not 0 < corner_radius <= radius * (1 + 1e-9):
        raise InputError(
            f"corner radius {corner_radius!r} m must be above 0 and at most half the diameter, {radius:g} m"
        )
    arc = ProfileElement(radius - corner_radius, 0.0, corner_radius * math.pi / 2, 1 / corner_radius)
    return arc, ProfileElement(radius, math.pi / 2)


def straight_profile(diameter: float, edge_angle: float) -> tuple[ProfileElement, ...]:
    """Return the profile of straight edges at an angle (rad) to the plane normal to the axis.

    It describes tapered end mills (90 deg less the taper) and inserts with a lead angle; ``diameter`` (m) is that of
    the tip.
    """
    return (ProfileElement(diameter / 2, edge_angle),)


def check_profile(profile: tuple[ProfileElement, ...]) -> None:
    """Refuse a profile with gaps, or with edges that do not rise.

    Raises
    ------
    InputError
        The first element at fault, with its values.
    """
    for number, element in enumerate(profile, 1):
        last = number == len(profile)
        top = element.edge_angle if last and element.curvature == 0 else element.angle_at(element.length)
        if not (element.radius >= 0 and min(element.edge_angle, top) >= 0 and max(element.edge_angle, top) < math.pi):
            raise InputError(
                f"element {number} of the cutter: radius {element.radius:g} m and edge angles "
                f"{math.degrees(element.edge_angle):g} to {math.degrees(top):g} deg; radii are 0 or more, and edge "
                "angles 0 to below 180 deg"
            )
        if element.length <= 0 or (element.curvature == 0 and element.edge_angle == 0):
            raise InputError(
                f"element {number} of the cutter does not rise: length {element.length:g} m, edge angle "
                f"{math.degrees(element.edge_angle):g} deg; give a positive length and an edge angle above 0"
            )
    for number, (lower, upper) in enumerate(pairwise(profile), 2):
        end = lower.radius_at(lower.length)
        if abs(upper.radius - end) > 1e-6 * max(end, upper.radius):
            raise InputError(
                f"element {number} of the cutter begins at the radius {1e3 * upper.radius:g} mm, and the one below it "
                f"ends at {1e3 * end:g} mm; join them, or add a straight element between them"
            )


class EdgeSlices(NamedTuple):
    """Slices of the edges from the tip to a depth; values at the lower and the upper end, linear between them."""

    lags: Real  # (teeth, n_slices, 2), rad: angle by which the edge of each tooth lags its tip
    starts: Real  # (n_slices, 2), rad: immersion angle at which the slice enters the cut
    exits: Real  # (n_slices, 2), rad
    edge_angles: Real  # (n_slices, 2), rad
    widths: Real  # (n_slices,), m: width of the edge
    offsets: Real  # (teeth, n_slices, 2), m: radial offset of each tooth by runout and serration
    radii: Real  # (n_slices, 2), m


@dataclass(frozen=True)
class WholeSlices:
    """Slices of the edges up to a height at least, which do not depend on the depth of the cut."""

    slices: EdgeSlices
    heights: Real  # (n_slices, 2), m
    lengths: Real  # (n_slices, 2), m: along the element of the profile
    elements: tuple[tuple[ProfileElement, float], ...]  # of each slice, with the height (m) of its lower end


def edge_slices(process: "MillingProcess", depth: float, divide: int = 1) -> EdgeSlices:
    """Divide the edges that cut at a depth (m) into slices.

    The workpiece extends along Y from ``R cos(exit_angle)`` to ``R cos(start_angle)``, with half the diameter R, so
    that a slice of another radius enters and leaves the cut at other angles. An immersion that starts at 0 or ends at
    180 deg begins or ends at the surface that the cutter itself makes, for all radii.

    Slices of a profile end at the same heights at all depths, but the last, which ends at the depth. There are
    ``divide`` times as many where a profile bends.

    Raises
    ------
    InputError
        A depth above the profile's end.
    """
    if not (process.profile or process.has_offsets):
        return _plain_slices(process, depth)
    whole = whole_slices(process, table_height(depth), divide)
    last = int(np.searchsorted(whole.heights[:, 1], depth * (1 - 1e-9)))
    if last == len(whole.heights):
        raise InputError(
            f"depth {1e3 * depth:g} mm is above the cutter's last element, which ends at "
            f"{1e3 * whole.heights[-1, 1]:g} mm"
        )
    element, base = whole.elements[last]
    low, high = whole.lengths[last]
    share = min((element.length_to(depth - base) - low) / (high - low), 1.0)
    return EdgeSlices(*(_ended(values, last, share) for values in whole.slices))


def _ended(whole: Real, last: int, share: float) -> Real:
    """Return the values of slices up to the one with the number ``last``, of which only a share is kept.

    Slices are the first axis of widths, and the last but one of values at their ends.
    """
    if whole.ndim == 1:
        values = whole[: last + 1].copy()
        values[last] *= share
        return values
    values = whole[..., : last + 1, :].copy()
    low, high = values[..., last, 0], values[..., last, 1]
    values[..., last, 1] = low + share * (high - low)
    return values


def table_height(depth: float) -> float:
    """Return the height (m) of the slices from which those up to a depth (m) are cut off: a power of two."""
    return 2.0 ** math.ceil(math.log2(max(depth, 1e-9)))


@lru_cache(maxsize=64)
def whole_slices(process: "MillingProcess", height: float, divide: int) -> WholeSlices:
    """Return the slices of a profile, or of edges with offsets, up to a height (m) at least or the profile's end."""
    base, parts, lengths, elements = 0.0, [], [], []
    for element in process.profile or (ProfileElement(process.diameter / 2, math.pi / 2),):
        if base >= height:
            break
        marks = _marks(process, element, height - base, divide)
        ends = np.column_stack([marks[:-1], marks[1:]])
        parts.append((base + _rises(element, ends), _rows(process, element, base, ends)))
        lengths.append(ends)
        elements += [(element, base)] * len(ends)
        base += element.rise(element.length) if math.isfinite(element.length) else math.inf
    slices = EdgeSlices(
        *(
            np.concatenate(values, axis=max(0, values[0].ndim - 2))
            for values in zip(*(rows for _, rows in parts), strict=True)
        )
    )
    return WholeSlices(
        slices, np.concatenate([heights for heights, _ in parts]), np.concatenate(lengths), tuple(elements)
    )


def _rows(process: "MillingProcess", element: ProfileElement, base: float, ends: Real) -> EdgeSlices:
    """Return slices of an element between lengths (n_slices, 2), m; its lower end is at the height ``base``, m."""
    heights = base + _rises(element, ends)
    radii, angles = _over(element.radius_at, ends), element.edge_angle + element.curvature * ends
    starts, exits = _engagement(process, radii)
    if process.is_turning:
        radii = np.full_like(radii, process.diameter / 2)  # of the workpiece
    if not process.profile:  # the edge angle of a plain cut counts the depth as the width of the edge
        angles = np.full_like(angles, process.edge_angle)
    teeth = process.teeth
    lags = np.array([2 * heights * math.tan(helix) / process.diameter for helix in process.helices])
    offsets, numbers = np.zeros((teeth, *heights.shape)), np.arange(teeth)[:, None, None]
    if process.serration_amplitude:
        phase = 2 * np.pi * (heights / process.serration_wavelength + numbers / teeth)
        offsets += process.serration_amplitude * np.cos(phase)
    if process.runout_decides:
        offsets += process.runout * np.cos(2 * np.pi * numbers / teeth)
    return EdgeSlices(lags, starts, exits, angles, ends[:, 1] - ends[:, 0], offsets, radii)


def _over(function: Callable[[float], float], lengths: Real) -> Real:
    return np.array([function(float(length)) for length in lengths.ravel()]).reshape(lengths.shape)


def _rises(element: ProfileElement, lengths: Real) -> Real:
    return _over(element.rise, lengths)


def _plain_slices(process: "MillingProcess", depth: float) -> EdgeSlices:
    """Return the slices of a cylinder, which are those of a unit depth stretched."""
    steepest = max(math.tan(helix) for helix in process.helices)
    unit = _unit_slices(process, max(1, math.ceil(2 * depth * steepest / process.diameter / _longest_lag(process))))
    return unit._replace(lags=depth * unit.lags, widths=depth * unit.widths)


def _longest_lag(process: "MillingProcess") -> float:
    return LONGEST_THIN_LAG if process.chip_law.varies else LONGEST_LAG


@lru_cache(maxsize=64)
def _unit_slices(process: "MillingProcess", count: int) -> EdgeSlices:
    """Return equal slices of a cylinder up to a depth of 1 m.

    In milling the edge angle counts the depth as the edge's width.
    """
    marks = np.linspace(0.0, 1.0, count + 1)
    heights = np.column_stack([marks[:-1], marks[1:]])
    values = (process.start_angle, process.exit_angle, process.edge_angle, process.diameter / 2)
    starts, exits, angles, radii = (np.full((count, 2), value) for value in values)
    lags = np.array([2 * heights * math.tan(helix) / process.diameter for helix in process.helices])
    width = 1 / math.sin(process.edge_angle) if process.is_turning else 1.0
    return EdgeSlices(lags, starts, exits, angles, np.full(count, width / count), np.zeros_like(lags), radii)


def _marks(process: "MillingProcess", element: ProfileElement, rise: float, divide: int) -> Real:
    """Return the lengths (m) between the slices of an element, up to a rise (m) at least or its end.

    Slices are halved where entry or exit are not linear in them: a taper widens the engagement along its edge, and near
    the tip of a ball the edge leaves the workpiece.
    """
    steepest = max(math.tan(helix) for helix in process.helices)
    longest = _longest_lag(process) * process.diameter / (2 * steepest) if steepest > 0 else math.inf
    if process.serration_amplitude:
        longest = min(longest, process.serration_wavelength / WAVE_SLICES)
    if math.isfinite(element.length):
        turn = abs(element.curvature) * element.length * divide / LARGEST_TURN
        count = max(1, math.ceil(element.rise(element.length) / longest), math.ceil(turn))
        marks = np.linspace(0.0, element.length, count + 1)
    else:
        step = min(longest, process.diameter / 4)
        marks = element.length_to(step) * np.arange(math.ceil(rise / step) + 1.0)
    for _ in range(12):  # immersions turn infinitely fast where an edge only just reaches the workpiece
        middles = (marks[1:] + marks[:-1]) / 2
        ends, between = (np.array(_engagement(process, _over(element.radius_at, each))) for each in (marks, middles))
        bent = (np.abs(between - (ends[:, 1:] + ends[:, :-1]) / 2) > LARGEST_BEND / divide**2).any(axis=0)
        if not bent.any():
            break
        marks = np.sort(np.concatenate([marks, middles[bent]]))
    return marks


def _engagement(process: "MillingProcess", radii: Real) -> tuple[Real, Real]:
    """Return the immersion angles at which slices of some radii (m) enter and leave the cut, rad."""
    if process.is_turning or not process.profile:
        return np.full_like(radii, process.start_angle), np.full_like(radii, process.exit_angle)
    half = process.diameter / 2
    safe = np.maximum(radii, 1e-12 * half)
    bounds = [half * math.cos(angle) / safe for angle in (process.start_angle, process.exit_angle)]
    starts, exits = (np.arccos(np.clip(bound, -1.0, 1.0)) for bound in bounds)
    if process.start_angle < 1e-9:
        starts = np.zeros_like(starts)
    if process.exit_angle > math.pi - 1e-9:
        exits = np.full_like(exits, math.pi)
    return starts, exits
