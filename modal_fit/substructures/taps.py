"""Taps on blanks from their FRFs: common lines, entries of each direction, and their noise."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, to_receptance
from millfrf.core import DegreeOfFreedom, Index, InputError, Real, listed

from ..frf_fit.measured_lines import entry_noise
from ..settings import SETTINGS
from .base import Blank, Taps
from .base_lines import TappedEntry
from .tool_file import Tool, check_together

DIRECTIONS = ("X", "Y")
"""Directions across the tool."""


@dataclass(frozen=True)
class TapsOfBlanks:
    """Taps of blanks on common lines.

    Parameters
    ----------
    taps
        Receptances of all blanks.
    frequencies : (n_lines,), Hz
        Frequencies of the lines.
    time_constant : s, or None
        Time constant of the exponential window of all FRFs.
    left_out
        What of the FRFs is not used, one sentence each.
    """

    taps: Taps
    frequencies: Real
    time_constant: float | None
    left_out: tuple[str, ...]


def taps_of_blanks(tools: Sequence[Tool], frfs: Sequence[Frf]) -> TapsOfBlanks:
    """Collect the receptances of blanks at the points that their files place.

    Parameters
    ----------
    tools, frfs
        Blanks and their FRFs, which may be accelerances and share frequencies.

    Raises
    ------
    InputError
        Blanks of one name or of unlike materials under one name, FRFs without a common line, of several exponential
        windows, or without a receptance between points of the blank.
    """
    check_together(tools)
    constants = {frf.exponential_time_constant for frf in frfs}
    if len(constants) > 1:
        raise InputError(
            "the FRFs have different exponential windows; give `millfrf tap` the same for all, "
            "such as --exponential none"
        )
    receptances = [to_receptance(frf) for frf in frfs]
    chosen = _common_lines(receptances)
    blanks, left_out = [], []
    entries: dict[str, list[TappedEntry]] = {direction: [] for direction in DIRECTIONS}
    for number, (tool, frf, lines) in enumerate(zip(tools, receptances, chosen, strict=True)):
        points, measured = _entries(number, tool, frf, lines)
        blanks.append(Blank(tool, points))
        for direction, entry in measured:
            entries[direction].append(entry)
        unused = [name for name in dict.fromkeys((*frf.responses, *frf.excitations)) if not _is_used(name, tool)]
        if unused:
            left_out.append(f"{tool.name}: {listed(unused)} is left out, which is no X or Y of a point that it places")
    frequencies = receptances[0].frequencies[chosen[0]]
    kept = {direction: tuple(measured) for direction, measured in entries.items() if measured}
    taps = Taps(tuple(blanks), receptances[0].laplace[chosen[0]], kept)
    return TapsOfBlanks(taps, frequencies, constants.pop(), tuple(left_out))


def _is_used(name: str, tool: Tool) -> bool:
    dof = DegreeOfFreedom.parse(name)
    return dof.node in tool.table.distance_from_tip_m and dof.axis in DIRECTIONS


def _common_lines(frfs: Sequence[Frf]) -> list[Index]:
    """Return the indices of the lines that are valid in all FRFs and lie in the bands of all."""
    axis, known = frfs[0].frequencies, _known(frfs[0])
    kept, places = np.flatnonzero(known), [np.flatnonzero(known)]
    for frf in frfs[1:]:
        nearest = np.abs(frf.frequencies[None, :] - axis[kept][:, None]).argmin(axis=1)
        same = np.isclose(frf.frequencies[nearest], axis[kept], rtol=1e-9, atol=0) & _known(frf)[nearest]
        kept, places = kept[same], [*(place[same] for place in places), nearest[same]]
    if len(kept) < SETTINGS.fewest_lines:
        raise InputError(
            f"the FRFs of the blanks share {len(kept)} lines; make all with the same --segment, and with bands "
            "that overlap"
        )
    return places


def _known(frf: Frf) -> NDArray[np.bool_]:
    low, high = frf.band or (0.0, np.inf)
    f = frf.frequencies
    return np.asarray(frf.valid & (f > 0) & (f >= low) & (f <= high))


def _entries(number: int, tool: Tool, frf: Frf, lines: Index) -> tuple[tuple[str, ...], list[tuple[str, TappedEntry]]]:
    """Return the points of a blank and its entries with their direction, both along the positive axis."""
    chosen = np.zeros(len(frf.frequencies), dtype=bool)
    chosen[lines] = True
    noise = entry_noise(replace(frf, valid=chosen), chosen)
    points: list[str] = []
    entries: list[tuple[str, TappedEntry]] = []
    for p, response in enumerate(frf.responses):
        for q, excitation in enumerate(frf.excitations):
            rows, columns = DegreeOfFreedom.parse(response), DegreeOfFreedom.parse(excitation)
            measured = frf.measured is None or bool(frf.measured[p, q])
            if rows.axis != columns.axis or not (measured and _is_used(response, tool) and _is_used(excitation, tool)):
                continue
            points += [node for node in dict.fromkeys((rows.node, columns.node)) if node not in points]
            values = frf.values[lines, p, q] * rows.sign * columns.sign
            places = points.index(rows.node), points.index(columns.node)
            variance = np.maximum(noise[:, p, q], (np.spacing(1.0) * np.abs(values)) ** 2)
            entries.append((rows.axis, TappedEntry(number, *places, values, variance)))
    if not entries:
        raise InputError(
            f"{tool.name}: its FRF has no receptance between points of distance_from_tip_m; the FRF has "
            f"{listed(frf.responses)} / {listed(frf.excitations)}, the file "
            f"{listed(list(tool.table.distance_from_tip_m))}"
        )
    return tuple(points), entries
