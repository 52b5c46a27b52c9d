"""Receptance of tools in bending, and of a tool on a base."""

import math
from dataclasses import dataclass

import numpy as np

from millfrf.core import Complex

from .beam import bending_stiffness, shear_factor
from .tool_file import MaterialTable, SegmentTable, Tool


@dataclass(frozen=True)
class FreeTool:
    """Receptance of a tool that floats freely, over ``(w, phi)`` at its end in the holder and ``w`` at its points.

    Parameters
    ----------
    end : (n_frequencies, 2, 2)
        Receptance at the end: m/N, 1/N (m per N m, and rad per N) and rad/(N m).
    across : (n_frequencies, 2, n_points)
        Motion of the end under a force at each point, m/N and rad/N.
    points : (n_frequencies, n_points, n_points), m/N
        Receptance at the points.
    """

    end: Complex
    across: Complex
    points: Complex

    def on_base(self, base: Complex) -> Complex:
        """Couple the tool to a base; return the receptance at the points, (n_frequencies, n_points, n_points).

        ``G = R_pp - R_pe (R_ee + R_b)^-1 R_ep`` (Schmitz & Smith, Machining Dynamics, chapter 9).

        Parameters
        ----------
        base : (n_frequencies, 2, 2)
            Receptance of the base over ``(w, phi)``.
        """
        return np.asarray(self.points - self.across.swapaxes(1, 2) @ self.forces(base))

    def forces(self, base: Complex) -> Complex:
        """Return force and moment between tool and base under a force at each point, (n_frequencies, 2, n_points)."""
        return np.asarray(np.linalg.solve(self.end + base, self.across))


@dataclass(frozen=True)
class _Piece:
    """Free receptance of rigidly joined segments over both ends and the points, which stand last."""

    receptance: Complex  # (n_frequencies, 4 + n_points, 4 + n_points)

    def joined(self, following: "_Piece", compliance: Complex) -> "_Piece":
        """Join the far end to the near end of the ``following`` piece over a spring with (2, 2) ``compliance``.

        ``H' = H - H B (B^T H B + C)^-1 B^T H`` (de Klerk, Rixen & Voormeeren 2008, AIAA J. 46, dual assembly).
        """
        first, second = self.receptance, following.receptance
        n, m = first.shape[1], second.shape[1]
        both = np.zeros((len(first), n + m, n + m), dtype=complex)
        both[:, :n, :n], both[:, n:, n:] = first, second
        columns = both[:, :, [2, 3]] - both[:, :, [n, n + 1]]
        gap = columns[:, [2, 3]] - columns[:, [n, n + 1]] + compliance
        coupled = both - columns @ np.linalg.solve(gap, columns.swapaxes(1, 2))
        kept = [0, 1, n + 2, n + 3, *range(4, n), *range(n + 4, n + m)]
        return _Piece(coupled[:, kept][:, :, kept])


def free_tool(tool: Tool, points: tuple[str, ...], s: Complex, compliance: Complex) -> FreeTool:
    """Compute the free receptance of a tool.

    Parameters
    ----------
    tool
        Description of the tool.
    points
        Names of the points, which its file places. A point at the contact lies on the holder's side.
    s : (n_frequencies,), rad/s
        Laplace variable.
    compliance : (2,)
        Complex compliance of the contact, m/N and rad/(N m); a tool without contact does not use it.
    """
    split = tool.first_of_tool
    pieces = [range(split), range(split, len(tool.table.segment))] if split else [range(len(tool.table.segment))]
    ends = np.cumsum([segment.length_m for segment in tool.table.segment])
    places = {name: tool.length - tool.table.distance_from_tip_m[name] for name in points}
    joined, order = None, []
    for segments in pieces:
        start = float(ends[segments[0]] - tool.table.segment[segments[0]].length_m)
        stop, inclusive = float(ends[segments[-1]]), 1 + 1e-9
        inside = [name for name in points if name not in order and places[name] <= stop * inclusive]
        order += inside
        piece = _piece(tool, segments, [max(places[name], start) for name in inside], start, s)
        joined = piece if joined is None else joined.joined(piece, np.diag(compliance))
    assert joined is not None
    by_name = [4 + order.index(name) for name in points]
    whole = joined.receptance
    return FreeTool(whole[:, :2, :2], whole[:, :2, by_name], whole[:, by_name][:, :, by_name])


def _piece(tool: Tool, segments: range, places: list[float], start: float, s: Complex) -> _Piece:
    """Assemble the exact dynamic stiffness of segments between nodes at their ends and at the points; invert it."""
    edges, beams = [start], []
    for number in segments:
        segment = tool.table.segment[number]
        end = edges[-1] + segment.length_m
        tiny = 1e-9 * tool.length
        inner = sorted({place for place in places if edges[-1] + tiny < place < end - tiny})
        for stop in (*inner, end):
            beams.append((segment, stop - edges[-1]))
            edges.append(stop)
    size = 2 * len(edges)
    stiffness = np.zeros((len(s), size, size), dtype=complex)
    for number, (segment, length) in enumerate(beams):
        both = slice(2 * number, 2 * number + 4)
        stiffness[:, both, both] += _segment_stiffness(segment, tool.table.material[segment.material], length, s)
    nodes = [int(np.argmin(np.abs(np.array(edges) - place))) for place in places]
    kept = [0, 1, size - 2, size - 1, *(2 * node for node in nodes)]
    return _Piece(np.asarray(np.linalg.inv(stiffness)[:, kept][:, :, kept], dtype=complex))


def _segment_stiffness(segment: SegmentTable, material: MaterialTable, length: float, s: Complex) -> Complex:
    outer = segment.diameter_m * (segment.effective_share if segment.fluted else 1.0)
    inner, young, nu = segment.inner_diameter_m, material.youngs_modulus_pa, material.poissons_ratio
    area, moment = math.pi / 4 * (outer**2 - inner**2), math.pi / 64 * (outer**4 - inner**4)
    shear = shear_factor(nu, inner / outer) * young / (2 * (1 + nu)) * area
    mass, rotary = material.density_kg_per_m3 * area, material.density_kg_per_m3 * moment
    return bending_stiffness(young * moment, shear, mass, rotary, length, s, material.loss_factor)
