"""Multi-frequency solution: harmonics of tooth passing on FRF samples, period doubling without a modal fit."""

from dataclasses import dataclass, replace

import numpy as np

from estimation import Frf
from millfrf.core import Complex, Index, InputError, Real
from millfrf.cutting import (
    MillingProcess,
    chip_direction,
    damping_harmonics,
    directional_harmonics,
    refuse_varied,
    turn_harmonics,
)
from modal_fit import ModalModel

from ..floquet.varied_edges import period_angle
from ..lobes_result import StabilityLimits, StabilityLobes
from ..roots.crossings import Crossings, find_crossings, followed, moved_depths
from ..tip_receptance import ToolReceptance, tool_receptance
from .zero_order import checked_speeds

MOST_HARMONICS = 60
"""On each side; a structure that needs more turns too often between two teeth."""

CONVERGED = 2e-4
"""Share of a limit by which more harmonics may change it."""


def multi_frequency(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float
) -> StabilityLobes:
    """Give the lowest unstable depth at each speed from FRF samples; Hopf and period doubling.

    Parameters
    ----------
    structure
        Receptance at the tip, measured or modal.
    process
        Cutter and engagement.
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds at which limits are wanted.
    max_depth : m
        Largest axial depth that is searched.

    Raises
    ------
    InputError
        As :func:`multi_frequency_limits`.
    """
    return multi_frequency_limits(structure, process, spindle_speeds, max_depth, lowest=True).lowest()


def multi_frequency_limits(
    structure: Frf | ModalModel,
    process: MillingProcess,
    spindle_speeds: Real,
    max_depth: float,
    *,
    lowest: bool = False,
) -> StabilityLimits:
    """Find all limits from ``det[I - a (1 - exp(-i w tau)) K_tc alpha_(p-q) H(w + q w_T)] = 0``.

    Forces at ``w + p w_T`` come from motions at ``w + q w_T`` through the harmonics of the directional matrix;
    harmonics at which the structure does not move drop out. The frequency above which it is taken to stand still is
    raised until the limits change by less than 0.02 %, or a measured FRF ends; the change is the stated error. The
    depth is one over an eigenvalue, as in the zero-order solution, which keeps p = q = 0 alone; period doubling is
    ``w = w_T / 2`` (Budak & Altintas 1998; Merdol & Altintas 2004).

    Unequal pitch has its harmonics at the spindle's frequency and one delay a tooth; process damping adds
    ``-i w (C / V) P`` to the force, linear in depth too.

    A measured FRF counts only inside its valid lines: below them its first line's real part is kept, above them the
    structure is taken to stand still.

    Parameters
    ----------
    structure, process, spindle_speeds, max_depth
        Receptance, cut, speeds (rad/s) and largest depth (m), as for :func:`multi_frequency`.
    lowest
        Whether the lowest limits, and those up to a tenth above them, suffice.

    Raises
    ------
    InputError
        Speeds or depth not positive, a structure that cannot be used, or speeds so low that more than 60 harmonics of
        tooth passing lie below its highest frequency.
    """
    refuse_varied(process, "the multi-frequency solution", "use collocation", takes=("pitch", "damping"))
    speeds = checked_speeds(spindle_speeds, max_depth)
    source = tool_receptance(structure)
    halved = _every_second_line(structure) if isinstance(structure, Frf) else None
    parts = [
        (chunk, _converged(source, halved, process, speeds[chunk], (max_depth, lowest))) for chunk in _chunks(speeds)
    ]
    speed = np.concatenate([chunk[part.found.speed] for chunk, part in parts])
    depth, theta, outward = (
        np.concatenate([getattr(part.found, name) for _, part in parts]) for name in ("depth", "theta", "outward")
    )
    frequency, error = (np.concatenate([getattr(part, name) for _, part in parts]) for name in ("frequency", "error"))
    order = np.lexsort([depth, speed])
    order = order[depth[order] <= max_depth]
    theta = theta[order]
    real = (theta == np.pi) | (theta == 0)
    limits = StabilityLimits(
        speeds,
        float(max_depth),
        speed[order],
        depth[order],
        frequency[order],
        tuple({np.pi: "period-doubling", 0.0: "fold"}.get(float(angle), "hopf") for angle in theta),
        np.where(outward[order], 1, -1) * np.where(real, 1, 2),
        error[order],
        "multi-frequency",
        source.warnings,
    )
    return replace(limits, warnings=source.warnings + _stated(limits, any(part.ended for _, part in parts), source))


def slowest_speed(structure: Frf | ModalModel, process: MillingProcess) -> float:
    """Lowest spindle speed at which :func:`multi_frequency` has harmonics enough for the structure's peaks, rad/s."""
    source = tool_receptance(structure)
    high = source.span[1] if source.open_above else min(_highest_peak(source), source.span[1])
    return high * period_angle(process) / MOST_HARMONICS


def _stated(limits: StabilityLimits, ended: bool, source: ToolReceptance) -> tuple[str, ...]:
    """A sentence on the largest stated error of a lowest limit where it is more than one in a hundred."""
    first = np.unique(limits.speed, return_index=True)[1]
    worst = float((limits.error[first] / limits.depth[first]).max(initial=0.0))
    if worst < 0.01:
        return ()
    why = (
        f"harmonics above {source.span[1]:.4g} Hz, where the FRF ends, still matter"
        if ended
        else f"more than {MOST_HARMONICS} harmonics matter, or lines are far apart"
    )
    return (f"multi-frequency limits are off by up to {worst:.0%} by their stated error: {why}",)


@dataclass(frozen=True)
class _Part:
    """Crossings at some speeds, their strongest line (Hz) and error (m), and whether the FRF ended too early."""

    found: Crossings
    frequency: Real
    error: Real
    ended: bool


def _chunks(speeds: Real) -> list[Index]:
    """Indices of speeds, up to 16 together, that differ by less than two fifths: they share their harmonics."""
    octave = np.floor(np.log(speeds / speeds.min()) / np.log(1.4)).astype(int)
    order = np.lexsort([speeds, octave])
    groups = np.split(order, np.flatnonzero(np.diff(octave[order])) + 1)
    return [part for group in groups for part in np.array_split(group, int(np.ceil(len(group) / 16)))]


def _converged(
    source: ToolReceptance,
    halved: ToolReceptance | None,
    process: MillingProcess,
    speeds: Real,
    wanted: tuple[float, bool],
) -> _Part:
    """Crossings with as many harmonics as matter: found with those below the structure's peaks, followed with more."""
    max_depth, lowest = wanted
    low, end = source.span[0], np.inf if source.open_above else source.span[1]
    high = source.span[1] if source.open_above else min(_highest_peak(source), end)
    flexible, periods = _flexible(source, process), period_angle(process) / speeds
    truncated = _Truncated(replace(source, span=(low, high)), process, periods, flexible)
    found = _found(truncated, source, max_depth, lowest)
    while True:
        wider = replace(truncated, source=replace(source, span=(low, min(2 * high, end))))
        if high >= end or wider.count > MOST_HARMONICS:
            narrower = replace(truncated, source=replace(source, span=(low, high / 2)))
            error = moved_depths(narrower.eigenvalues, found)
            break
        moved = followed(wider.eigenvalues, found)
        change = np.abs(moved.depth - found.depth)
        lost = ~(change < 0.1 * found.depth)
        early = truncated.source.span[1] <= source.span[1] / 2
        if lost.any() or (early and len(np.unique(found.speed)) < len(speeds)):
            moved = _found(wider, source, max_depth, lowest)
            change = moved_depths(truncated.eigenvalues, moved)
        truncated, found, error, high = wider, moved, change, min(2 * high, end)
        if not lost.any() and (error < CONVERGED * found.depth).all():
            break
    ended = bool(high >= end and (error > CONVERGED * found.depth).any())
    if halved is not None:
        lines = replace(truncated, source=replace(halved, span=(low, min(high, halved.span[1]))))
        error = error + moved_depths(lines.eigenvalues, found) / 3
    return _Part(found, truncated.strongest_lines(found), error + 1e-9 * found.depth, ended)


def _found(truncated: "_Truncated", source: ToolReceptance, max_depth: float, lowest: bool) -> Crossings:
    """All crossings of a truncation, or the lowest at each speed and those up to a tenth above it."""
    angles = truncated.first_angles(_peaks(source))
    found = find_crossings(truncated.eigenvalues, angles, max_depth, folds=not truncated.process.is_plain)
    if not lowest:
        return found
    least = np.full(len(truncated.periods), np.inf)
    np.minimum.at(least, found.speed, found.depth)
    low = found.depth <= 1.1 * least[found.speed]
    return Crossings(found.speed[low], found.depth[low], found.theta[low], found.outward[low])


@dataclass(frozen=True)
class _Truncated:
    """The truncated determinant: a receptance, a process and one truncation for all speeds."""

    source: ToolReceptance
    process: MillingProcess
    periods: Real
    flexible: tuple[list[int], list[int]]

    @property
    def count(self) -> int:
        """Harmonics on each side that can lie below the highest frequency at the longest period."""
        return int(np.ceil(self.source.span[1] * float(self.periods.max())))

    @property
    def harmonics(self) -> Index:
        """Their orders q."""
        top = self.count
        if top > MOST_HARMONICS:
            raise InputError(
                f"{top} harmonics of tooth passing lie below {self.source.span[1]:.4g} Hz at "
                f"{60 / (self.process.teeth * self.periods.max()):.4g} rpm, the most is {MOST_HARMONICS}; "
                "raise the lowest speed or cut the FRF's upper end"
            )
        return np.arange(-top - 1, top + 1)

    def lines(self, speeds: Index, theta: Real) -> Real:
        """Frequencies (n_pairs, n_harmonics), Hz, negative ones too."""
        return np.asarray((theta[:, None] / (2 * np.pi) + self.harmonics) / self.periods[speeds][:, None])

    def receptance(self, lines: Real) -> Complex:
        """H at lines of either sign, zero above the span and quasi-static below, (..., 3, 3)."""
        low, high = self.source.span
        size = np.abs(lines).ravel()
        values = self.source.evaluate(np.clip(size, low, high))
        values[size < low] = values[size < low].real
        values[size > high] = 0
        values[lines.ravel() < 0] = values[lines.ravel() < 0].conj()
        return values.reshape(*lines.shape, 3, 3)

    def matrices(self, speeds: Index, theta: Real) -> Complex:
        """The loop gain between motions along the chip at all harmonics, (n_pairs, n, n), 1/m."""
        force = self.forces(speeds, theta)
        rows, columns = self.flexible
        moving = self.receptance(self.lines(speeds, theta))[:, :, rows][:, :, :, columns]
        size = moving.shape[1] * len(rows)
        loop = np.einsum("npij,npjqk->npiqk", moving, force, optimize=True)
        return np.asarray(loop.reshape(len(theta), size, size))

    def forces(self, speeds: Index, theta: Real) -> Complex:
        """Forces at all harmonics from motions at all harmonics, (n_pairs, n_harmonics, 3, n_harmonics, 3), N/m / m."""
        count = len(self.harmonics)
        rows, columns = self.flexible
        difference = np.arange(count)[:, None] - np.arange(count) + count - 1
        blocks = np.zeros((len(theta), count, len(columns), count, len(rows)), dtype=complex)
        for harmonics, factor in self._terms(np.arange(1 - count, count), speeds, theta):
            cutting = harmonics[difference][:, :, columns][:, :, :, rows]
            blocks += np.einsum("pqjk,nq->npjqk", cutting, factor, optimize=True)
        return blocks

    def _terms(self, orders: Index, speeds: Index, theta: Real) -> list[tuple[Complex, Complex]]:
        """Harmonics (n_orders, 3, 3) of each force, Pa, and its factor (n_pairs, n_harmonics) from motion at a line."""
        process, count = self.process, len(self.harmonics)
        turns = theta[:, None] + 2 * np.pi * self.harmonics  # of the motion over a period
        if process.equal_pitch:
            delayed = np.tile(1 - np.exp(-1j * theta)[:, None], (1, count))
            terms = [(process.ktc * directional_harmonics(process, orders), delayed)]
        else:
            teeth = process.ktc * turn_harmonics(process, orders)
            factors = [1 - np.exp(-1j * turns * pitch / (2 * np.pi)) for pitch in process.pitches]
            terms = list(zip(teeth, factors, strict=True))
        if process.process_damping:
            spindle = period_angle(process) / self.periods[speeds]
            flank = process.process_damping / (spindle * process.diameter / 2)
            step = process.teeth if process.equal_pitch else 1
            velocity = -1j * turns * (flank / self.periods[speeds])[:, None]
            terms.append((damping_harmonics(process, step * orders), velocity))
        return terms

    def eigenvalues(self, speeds: Index, theta: Real) -> Complex:
        """Eigenvalues, largest first, (n_pairs, n)."""
        values = np.linalg.eigvals(self.matrices(speeds, theta))
        order = np.argsort(-np.abs(values), axis=1)
        return np.asarray(np.take_along_axis(values, order, axis=1))

    def first_angles(self, peaks: Real) -> Real:
        """Angles in (0, pi] to begin with: clustered at both ends and about every peak, (n_speeds, n_angles)."""
        even = (1 - np.cos(np.linspace(0, np.pi, 33)[1:])) * np.pi / 2
        near = peaks[:, None] * (1 + np.array([-0.1, -0.04, -0.015, 0.0, 0.015, 0.04, 0.1]))
        turns = 2 * np.pi * np.outer(self.periods, near.ravel())
        folded = np.clip(np.abs(np.mod(turns + np.pi, 2 * np.pi) - np.pi), 1e-3, np.pi - 1e-3)
        return np.asarray(np.sort(np.hstack([np.tile(even, (len(self.periods), 1)), folded]), axis=1))

    def strongest_lines(self, found: Crossings) -> Real:
        """Frequency (Hz) of the strongest line of the tool's motion at each crossing."""
        if not len(found.depth):
            return np.zeros(0)
        values, vectors = np.linalg.eig(self.matrices(found.speed, found.theta))
        chosen = np.argmin(np.abs(values - 1 / found.depth[:, None]), axis=1)
        motion = vectors[np.arange(len(chosen)), :, chosen]
        force = self.forces(found.speed, found.theta)
        shape = force.shape[:3]
        pushed = (force.reshape(len(chosen), -1, motion.shape[1]) @ motion[:, :, None]).reshape(shape)
        lines = self.lines(found.speed, found.theta)
        size = np.linalg.norm(self.receptance(lines)[:, :, :, self.flexible[1]] @ pushed[..., None], axis=(2, 3))
        return np.asarray(np.abs(lines[np.arange(len(lines)), np.argmax(size, axis=1)]))


def _flexible(source: ToolReceptance, process: MillingProcess) -> tuple[list[int], list[int]]:
    """Directions that move and in which the chip is measured, and those in which a force moves anything."""
    size = np.abs(source.evaluate(source.grid)).max(axis=0)
    chip = np.abs(chip_direction(process, np.linspace(process.start_angle, process.exit_angle, 9))).max(axis=0) > 1e-12
    return np.flatnonzero(size.any(axis=1) & chip).tolist(), np.flatnonzero(size.any(axis=0)).tolist()


def _peaks(source: ToolReceptance) -> Real:
    """Up to eight highest peaks of the receptance, Hz."""
    size = np.linalg.norm(source.evaluate(source.grid), axis=(1, 2))
    tops = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:])) + 1
    return source.grid[tops[np.argsort(-size[tops])][:8]]


def _highest_peak(source: ToolReceptance) -> float:
    """Give the first frequency (Hz) to cut off an FRF: above all lines that reach a thirtieth of its highest peak."""
    size = np.linalg.norm(source.evaluate(source.grid), axis=(1, 2))
    return 1.5 * float(source.grid[np.flatnonzero(size >= size.max() / 30)[-1]])


def _every_second_line(frf: Frf) -> ToolReceptance | None:
    """Keep every second line, to see the effect of their distance; None where too few would be left."""
    half = replace(
        frf,
        frequencies=frf.frequencies[::2],
        values=frf.values[::2],
        valid=frf.valid[::2],
        multiple_coherence=None,
        covariance=None,
        coherence=None,
    )
    return tool_receptance(half) if (half.valid & (half.frequencies > 0)).sum() >= 8 else None
