"""Base of a spindle or robot from taps on blanks, with the contact and what the description of blanks leaves open."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import Complex, InputError, Real

from ..settings import SETTINGS
from .assembly import FreeTool, free_tool
from .base_lines import BaseLines, TappedEntry, identify_lines
from .tool_file import Tool

CONTACT = ("contact, deflection", "contact, deflection lost", "contact, rotation", "contact, rotation lost")
"""Names of real part and loss of both compliances of the contact, in units of :attr:`Base.compliance_unit`."""


@dataclass(frozen=True)
class Blank:
    """A tool that was tapped, with the points of its receptances.

    Parameters
    ----------
    tool
        Description of the blank.
    points
        Names of the points.
    """

    tool: Tool
    points: tuple[str, ...]


@dataclass(frozen=True)
class Taps:
    """Receptances of blanks in one or more directions, which move independently, on common lines.

    Parameters
    ----------
    blanks
        Blanks in their order.
    s : (n_lines,), rad/s
        Laplace variable of the lines.
    entries
        Measured entries of each direction, by its name such as ``X``.
    """

    blanks: tuple[Blank, ...]
    s: Complex
    entries: dict[str, tuple[TappedEntry, ...]]

    def thinned(self, most: int) -> "Taps":
        """Return every n-th line, so that at most so many remain."""
        every = -(-len(self.s) // most)
        entries = {
            direction: tuple(
                replace(entry, values=entry.values[::every], variance=entry.variance[::every]) for entry in measured
            )
            for direction, measured in self.entries.items()
        }
        return replace(self, s=self.s[::every], entries=entries)


@dataclass(frozen=True)
class Base:
    """Receptance of a base in each direction, with the numbers of the description that the taps correct.

    Parameters
    ----------
    taps
        Taps from which it was identified.
    lines
        Receptance of each direction.
    names
        Names of the numbers: the contact's, then what is uncertain of the blanks.
    numbers : (n_numbers,)
        The contact's in units of ``compliance_unit``; others are changes in units of their standard errors.
    covariance : (n_numbers, n_numbers)
        Covariance of ``numbers`` after the taps.
    chi_square
        Misfit of the taps over that which noise explains; NaN where nothing is left over.
    compliance_unit : (2,)
        m/N and rad/(N m): flexibility of the first blank as a cantilever.
    """

    taps: Taps
    lines: dict[str, BaseLines]
    names: tuple[str, ...]
    numbers: Real
    covariance: Real
    chi_square: float
    compliance_unit: Real

    @property
    def scale(self) -> float:
        """Factor on all variances where the taps disagree by more than their noise."""
        return float(np.fmax(1.0, self.chi_square))

    @property
    def has_contact(self) -> bool:
        """Whether a contact was identified."""
        return self.names[: len(CONTACT)] == CONTACT

    def compliances(self) -> tuple[Complex, Real]:
        """Return the compliance of the contact in deflection (m/N) and rotation (rad/(N m)), and standard errors.

        Both have the shape (2,); the errors are those of the real parts.
        """
        errors = np.sqrt(np.diag(self.covariance)[[0, 2]])
        return _compliance(self.numbers, self.compliance_unit), errors * self.compliance_unit

    def doubts(self) -> tuple[str, ...]:
        """Return what the misfit of the taps leaves in doubt, one sentence each."""
        if len(self.taps.blanks) == 1 and not self.has_contact:
            return ("only one blank was tapped: a wrong length or material of it would not show; tap a second one",)
        if self.chi_square > SETTINGS.poor_chi_square:
            return (
                f"the taps disagree: their misfit is {self.chi_square:.1f} times what noise explains; a blank was "
                "clamped differently, or a length, diameter or material is wrong. The errors are widened by its root",
            )
        return ()

    def moved(self, numbers: Real) -> dict[str, BaseLines]:
        """Identify the base anew with other ``numbers``."""
        return _profile(self.taps, self.names, numbers, self.compliance_unit, self.lines)


def identify_base(taps: Taps) -> Base:
    """Identify base, contact and uncertain numbers of the blanks together.

    The least sum of squares over the contact and the uncertain numbers, with their standard errors as a prior, and
    over three numbers a line, which are eliminated (variable projection), on some of the lines. With three entries a
    line in each direction nothing is left over: the numbers keep their prior, and the contact cannot be found.

    Parameters
    ----------
    taps
        Receptances of the blanks.

    Raises
    ------
    InputError
        Taps that do not determine the base, or a contact that they do not tell from it.
    """
    with_contact = any(blank.tool.first_of_tool for blank in taps.blanks)
    if with_contact:
        _require_both_sides(taps)
    uncertain = dict.fromkeys(name for blank in taps.blanks for name in blank.tool.uncertain())
    names = (*(CONTACT if with_contact else ()), *uncertain)
    prior = np.array([0.0 if name in CONTACT else 1.0 for name in names])
    unit = _compliance_unit(taps.blanks[0].tool)
    freedom = sum(2 * len(taps.s) * (len(each) - 3) for each in taps.entries.values()) - int((prior == 0).sum())
    numbers, information = np.zeros(len(names)), np.diag(prior)
    if names and freedom > 0:
        numbers, information = _fitted_numbers(taps.thinned(SETTINGS.lines_for_numbers), names, prior, unit)
    lines = _profile(taps, names, numbers, unit, None)
    residual = _stacked(lines)
    chi_square = float(residual @ residual) / freedom if freedom > 0 else np.nan
    return Base(taps, lines, names, numbers, np.linalg.inv(information), chi_square, unit)


def _fitted_numbers(taps: Taps, names: Sequence[str], prior: Real, unit: Real) -> tuple[Real, Real]:
    """Fit the numbers by Gauss and Newton, the contact alone first; return them and the inverse of their covariance."""
    numbers, information = np.zeros(len(names)), np.diag(prior)
    lines = _profile(taps, names, numbers, unit, None)
    contact_alone = bool((prior == 0).any())
    for _ in range(SETTINGS.base_steps):
        residual, slopes = _stacked(lines), _slopes(taps, names, numbers, unit, lines)
        information = slopes.T @ slopes + np.diag(prior)
        moved = np.flatnonzero(prior == 0) if contact_alone else np.arange(len(names))
        step = np.zeros(len(names))
        downhill = slopes.T @ residual + prior * numbers
        step[moved] = -np.linalg.solve(information[np.ix_(moved, moved)], downhill[moved])
        cost, share = float(residual @ residual + numbers @ (prior * numbers)), 1.0
        while share > SETTINGS.base_tolerance:
            trial = numbers + share * step
            trial_lines = _profile(taps, names, trial, unit, lines)
            after = _stacked(trial_lines)
            if float(after @ after + trial @ (prior * trial)) < cost:
                numbers, lines = trial, trial_lines
                break
            share /= 2
        if share * step @ information @ step < SETTINGS.settled_numbers:  # a small part of a standard error
            if not contact_alone:
                break
            contact_alone = False
    return numbers, information


def _require_both_sides(taps: Taps) -> None:
    """Refuse a contact of which only one side was tapped: its flexibility cannot be told from the base's."""
    direct = any(not blank.tool.first_of_tool for blank in taps.blanks)
    for blank in taps.blanks:
        table = blank.tool.table
        reach = sum(segment.length_m for segment in table.segment[blank.tool.first_of_tool :])
        on_holder = [name for name in blank.points if table.distance_from_tip_m[name] >= reach * (1 - 1e-9)]
        direct |= len(on_holder) > 1
    if not direct:
        raise InputError(
            "the taps do not tell the contact from the base: hit and measure two points of the holder before the "
            "contact too, or leave out contact = true (its flexibility is then part of the base)"
        )


def _compliance_unit(tool: Tool) -> Real:
    """Return the flexibility of a blank as a cantilever of its last segment's section: m/N and rad/(N m)."""
    segment = tool.table.segment[-1]
    young = tool.table.material[segment.material].youngs_modulus_pa
    bending = young * np.pi / 64 * segment.diameter_m**4
    return np.array([tool.length**3 / (3 * bending), tool.length / bending])


def _compliance(numbers: Real, unit: Real) -> Complex:
    """Return the complex compliances of the contact, (2,): the loss is negative imaginary."""
    return np.asarray((numbers[[0, 2]] - 1j * numbers[[1, 3]]) * unit)


def free_blank(
    tool: Tool, points: tuple[str, ...], s: Complex, names: Sequence[str], numbers: Real, unit: Real
) -> FreeTool:
    """Compute the free receptance of a tool whose description is corrected by ``numbers`` of these ``names``."""
    compliance = _compliance(numbers, unit) if names[: len(CONTACT)] == CONTACT else np.zeros(2, dtype=complex)
    return free_tool(tool.changed(dict(zip(names, numbers, strict=True))), points, s, compliance)


def _profile(
    taps: Taps, names: Sequence[str], numbers: Real, unit: Real, start: dict[str, BaseLines] | None
) -> dict[str, BaseLines]:
    """Identify the lines of each direction for given numbers."""
    free = [free_blank(blank.tool, blank.points, taps.s, names, numbers, unit) for blank in taps.blanks]
    lines = {}
    for direction, entries in taps.entries.items():
        try:
            lines[direction] = identify_lines(free, entries, None if start is None else start[direction].numbers)
        except InputError as error:
            raise InputError(f"direction {direction}: {error}") from error
    return lines


def _stacked(lines: dict[str, BaseLines]) -> Real:
    whitened = np.concatenate([each.residual.ravel() for each in lines.values()])
    return np.concatenate([whitened.real, whitened.imag])


def _slopes(taps: Taps, names: Sequence[str], numbers: Real, unit: Real, lines: dict[str, BaseLines]) -> Real:
    """Return derivatives of the residual by the numbers, from differences over a part of a standard error."""
    columns = []
    for step in np.eye(len(numbers)) * SETTINGS.number_step:
        above, below = (_stacked(_profile(taps, names, numbers + sign * step, unit, lines)) for sign in (1, -1))
        columns.append((above - below) / (2 * SETTINGS.number_step))
    return np.stack(columns, axis=1)
