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
    edge_end_harmonics,
    refuse_varied,
    turn_harmonics,
)
from modal_fit import ModalModel

from ..floquet.collocated_period import largest_first
from ..floquet.crossings import Crossings, find_crossings, followed, moved_depths
from ..floquet.cut_layout import period_angle
from ..lobes_result import StabilityLimits, StabilityLobes
from ..milling_loop import speed_groups
from ..settings import SETTINGS
from ..tip_receptance import ToolReceptance, tool_receptance
from .zero_order import checked_speeds


def multi_frequency(
    structure: Frf | ModalModel | ToolReceptance,
    process: MillingProcess,
    spindle_speeds: Real,
    max_depth: float,
    *,
    edge_ends: bool = False,
) -> StabilityLobes:
    """Compute the lowest unstable depth at each speed from FRF samples; Hopf and period doubling.

    Parameters
    ----------
    structure
        Receptance at the tip, measured or modal.
    process
        Cutter and engagement.
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds of the limits.
    max_depth : m
        Largest axial depth that is searched.
    edge_ends
        Whether a vibration moves the ends of the edge forces (:func:`edge_end_harmonics`); equal pitch.

    Raises
    ------
    InputError
        As ``multi_frequency_limits``.
    """
    options = {"lowest": True, "edge_ends": edge_ends}
    return multi_frequency_limits(structure, process, spindle_speeds, max_depth, **options).lowest()


def multi_frequency_limits(
    structure: Frf | ModalModel | ToolReceptance,
    process: MillingProcess,
    spindle_speeds: Real,
    max_depth: float,
    *,
    lowest: bool = False,
    edge_ends: bool = False,
) -> StabilityLimits:
    """Find all limits from ``det[I - a (1 - exp(-i w tau)) K_tc alpha_(p-q) H(w + q w_T)] = 0``.

    Motions at ``w + q w_T`` cause forces at ``w + p w_T`` through the harmonics of the directional matrix. Harmonics at
    which the structure does not move have no effect. The frequency above which it is taken as rigid is raised until the
    limits change by less than 0.02 %, or until a measured FRF ends; the change is the stated error. The depth is the
    reciprocal of an eigenvalue, as in the zero-order solution, which uses p = q = 0 only. Period doubling is
    ``w = w_T / 2`` (Budak & Altintas 1998; Merdol & Altintas 2004).

    Unequal pitch has its harmonics at the spindle's frequency and one delay per tooth; process damping adds
    ``-i w (C / V) P`` to the force, which is linear in depth, too.

    A measured FRF is used only inside its valid lines: below them the real part of its first line is used, above them
    the structure is taken as rigid. With ``lowest`` only the lowest limits, and those up to a tenth above them, are
    returned. Speeds are refused where more than 60 harmonics lie below the structure's highest frequency.
    """
    refuse_varied(process, "the multi-frequency solution", "use collocation", takes=("turning", "pitch", "damping"))
    speeds = checked_speeds(spindle_speeds, max_depth)
    source = tool_receptance(structure)
    halved = _every_second_line(structure) if isinstance(structure, Frf) else None
    # groups of up to 16 speeds that differ by less than two fifths share their harmonics
    groups = [
        part for group in speed_groups(speeds, 1.4) for part in np.array_split(group, int(np.ceil(len(group) / 16)))
    ]
    parts = [_Part(source, halved, process, speeds[group], edge_ends) for group in groups]
    results = [_converged(part, max_depth, lowest=lowest) for part in parts]
    speed = np.concatenate([group[result.crossings.speed] for group, result in zip(groups, results, strict=True)])
    depth, theta, outward = (
        np.concatenate([getattr(result.crossings, name) for result in results])
        for name in ("depth", "theta", "outward")
    )
    frequency, error = (
        np.concatenate([getattr(result, name) for result in results]) for name in ("frequency", "error")
    )
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
    return replace(
        limits, warnings=source.warnings + _error_warning(limits, any(result.ended for result in results), source)
    )


def slowest_speed(structure: Frf | ModalModel, process: MillingProcess) -> float:
    """Compute the lowest spindle speed (rad/s) at which :func:`multi_frequency` has enough harmonics for all peaks."""
    source = tool_receptance(structure)
    high = source.span[1] if source.open_above else min(_highest_peak(source), source.span[1])
    return high * period_angle(process) / SETTINGS.most_harmonics


def compared_speeds(structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real) -> Real:
    """Return a few evenly chosen speeds (rad/s) at which :func:`multi_frequency` can compare limits; may be empty."""
    speeds = spindle_speeds[spindle_speeds >= slowest_speed(structure, process)]
    if not len(speeds):
        return speeds
    return np.asarray(speeds[np.unique(np.linspace(0, len(speeds) - 1, SETTINGS.compared_speeds).astype(int))])


BY_ERROR = " by their stated error: "  # in the warning, before the reason


def _error_warning(limits: StabilityLimits, ended: bool, source: ToolReceptance) -> tuple[str, ...]:
    """Return a warning if the largest stated error of a lowest limit is 1 % or more."""
    first = np.unique(limits.speed, return_index=True)[1]
    worst = float((limits.error[first] / limits.depth[first]).max(initial=0.0))
    if worst < 0.01:
        return ()
    reason = (
        f"harmonics above {source.span[1]:.4g} Hz, where the FRF ends, are not negligible"
        if ended
        else f"more than {SETTINGS.most_harmonics} harmonics are needed, or the FRF's lines are too far apart"
    )
    return (f"multi-frequency limits are off by up to {worst:.0%}{BY_ERROR}{reason}",)


@dataclass(frozen=True)
class _Result:
    """Crossings of a group of speeds."""

    crossings: Crossings
    frequency: Real  # Hz, of the strongest line of each crossing
    error: Real  # m
    ended: bool  # whether the limits have not converged at the end of the FRF


@dataclass(frozen=True)
class _Part:
    """Speeds that share their harmonics, and what their limits depend on."""

    source: ToolReceptance
    halved: ToolReceptance | None  # every second line
    process: MillingProcess
    speeds: Real  # rad/s
    edge_ends: bool


def _converged(part: _Part, max_depth: float, *, lowest: bool) -> _Result:
    """Find crossings with the harmonics up to the structure's peaks; add harmonics until the crossings converge."""
    source, process, speeds = part.source, part.process, part.speeds
    low, end = source.span[0], np.inf if source.open_above else source.span[1]
    high = source.span[1] if source.open_above else min(_highest_peak(source), end)
    flexible, periods = _flexible(source, process), period_angle(process) / speeds
    truncated = _Truncated(replace(source, span=(low, high)), process, periods, flexible, part.edge_ends)
    crossings = _search(truncated, source, max_depth, lowest)
    while True:
        wider = replace(truncated, source=replace(source, span=(low, min(2 * high, end))))
        if high >= end or wider.count > SETTINGS.most_harmonics:
            narrower = replace(truncated, source=replace(source, span=(low, high / 2)))
            error = moved_depths(narrower.eigenvalues, crossings)
            break
        moved = followed(wider.eigenvalues, crossings)
        change = np.abs(moved.depth - crossings.depth)
        lost = ~(change < 0.1 * crossings.depth)
        # with few harmonics limits may be missed: then all crossings are searched again
        early = truncated.source.span[1] <= source.span[1] / 2
        if lost.any() or (early and len(np.unique(crossings.speed)) < len(speeds)):
            moved = _search(wider, source, max_depth, lowest)
            change = moved_depths(truncated.eigenvalues, moved)
        truncated, crossings, error, high = wider, moved, change, min(2 * high, end)
        if not lost.any() and (error < SETTINGS.converged * crossings.depth).all():
            break
    ended = bool(high >= end and (error > SETTINGS.converged * crossings.depth).any())
    if part.halved is not None:
        # linear interpolation: the error is quadratic in the line distance, so a third of the change by doubling
        lines = replace(truncated, source=replace(part.halved, span=(low, min(high, part.halved.span[1]))))
        error = error + moved_depths(lines.eigenvalues, crossings) / 3
    return _Result(crossings, truncated.strongest_lines(crossings), error + 1e-9 * crossings.depth, ended)


def _search(truncated: "_Truncated", source: ToolReceptance, max_depth: float, lowest: bool) -> Crossings:
    """Find all crossings of a truncation; with ``lowest``, only the lowest at each speed and those up to 10 % above."""
    angles = truncated.first_angles(_peaks(source))
    crossings = find_crossings(truncated.eigenvalues, angles, max_depth, folds=not truncated.process.is_plain)
    if not lowest:
        return crossings
    least = np.full(len(truncated.periods), np.inf)
    np.minimum.at(least, crossings.speed, crossings.depth)
    return crossings.select(crossings.depth <= 1.1 * least[crossings.speed])


@dataclass(frozen=True)
class _Truncated:
    """The determinant truncated at one highest frequency for all speeds."""

    source: ToolReceptance  # its span ends at the highest frequency
    process: MillingProcess
    periods: Real  # (n_speeds,), s
    flexible: tuple[list[int], list[int]]  # as from `_flexible`
    edge_ends: bool = False  # whether a vibration moves the ends of the edge forces

    @property
    def count(self) -> int:
        """Return the number of harmonics on each side below the highest frequency, at the longest period."""
        return int(np.ceil(self.source.span[1] * float(self.periods.max())))

    @property
    def harmonics(self) -> Index:
        """Return the orders q of the harmonics."""
        top = self.count
        if top > SETTINGS.most_harmonics:
            raise InputError(
                f"{top} harmonics of tooth passing lie below {self.source.span[1]:.4g} Hz at "
                f"{60 / (self.process.teeth * self.periods.max()):.4g} rpm, the most is {SETTINGS.most_harmonics}; "
                "raise the lowest speed or cut the FRF's upper end"
            )
        return np.arange(-top - 1, top + 1)

    def lines(self, speeds: Index, theta: Real) -> Real:
        """Return the frequencies of all harmonics, positive and negative, (n_pairs, n_harmonics), Hz."""
        return np.asarray((theta[:, None] / (2 * np.pi) + self.harmonics) / self.periods[speeds][:, None])

    def receptance(self, lines: Real) -> Complex:
        """Return H at lines of either sign, zero above the span and quasi-static below it, (..., 3, 3)."""
        low, high = self.source.span
        size = np.abs(lines).ravel()
        values = self.source.evaluate(np.clip(size, low, high))
        values[size < low] = values[size < low].real
        values[size > high] = 0
        values[lines.ravel() < 0] = values[lines.ravel() < 0].conj()
        return values.reshape(*lines.shape, 3, 3)

    def matrices(self, speeds: Index, theta: Real) -> Complex:
        """Compute the loop gain between motions along the chip at all harmonics, (n_pairs, n, n), 1/m."""
        force = self.forces(speeds, theta)
        rows, columns = self.flexible
        moving = self.receptance(self.lines(speeds, theta))[:, :, rows][:, :, :, columns]
        size = moving.shape[1] * len(rows)
        loop = np.einsum("npij,npjqk->npiqk", moving, force, optimize=True)
        return np.asarray(loop.reshape(len(theta), size, size))

    def forces(self, speeds: Index, theta: Real) -> Complex:
        """Compute forces per motion and depth at all harmonics, (n_pairs, n_harmonics, 3, n_harmonics, 3), N/m^2."""
        count = len(self.harmonics)
        rows, columns = self.flexible
        difference = np.arange(count)[:, None] - np.arange(count) + count - 1
        blocks = np.zeros((len(theta), count, len(columns), count, len(rows)), dtype=complex)
        for harmonics, factor in self._terms(np.arange(1 - count, count), speeds, theta):
            cutting = harmonics[difference][:, :, columns][:, :, :, rows]
            blocks += np.einsum("pqjk,nq->npjqk", cutting, factor, optimize=True)
        return blocks

    def _terms(self, orders: Index, speeds: Index, theta: Real) -> list[tuple[Complex, Complex]]:
        """Return for each part of the force its harmonics (n_orders, 3, 3) and its factor (n_pairs, n_harmonics).

        The parts are the cutting forces of all teeth together (equal pitch) or of each tooth, and process damping.
        """
        process, count = self.process, len(self.harmonics)
        turns = theta[:, None] + 2 * np.pi * self.harmonics  # of the motion over a period
        if process.equal_pitch:
            delayed = np.tile(1 - np.exp(-1j * theta)[:, None], (1, count))
            terms = [(process.ktc * directional_harmonics(process, orders), delayed)]
            terms += [(edge_end_harmonics(process, orders), delayed)] if self.edge_ends else []
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
        """Compute the eigenvalues of the loop gain, largest first, (n_pairs, n), 1/m."""
        return largest_first(np.asarray(np.linalg.eigvals(self.matrices(speeds, theta)), dtype=complex))

    def first_angles(self, peaks: Real) -> Real:
        """Choose the angles in (0, pi] at which the search begins, (n_speeds, n_angles).

        They are denser at both ends and around every peak.
        """
        even = (1 - np.cos(np.linspace(0, np.pi, 33)[1:])) * np.pi / 2
        near = peaks[:, None] * (1 + np.array([-0.1, -0.04, -0.015, 0.0, 0.015, 0.04, 0.1]))
        turns = 2 * np.pi * np.outer(self.periods, near.ravel())
        folded = np.clip(np.abs(np.mod(turns + np.pi, 2 * np.pi) - np.pi), 1e-3, np.pi - 1e-3)
        return np.asarray(np.sort(np.hstack([np.tile(even, (len(self.periods), 1)), folded]), axis=1))

    def strongest_lines(self, crossings: Crossings) -> Real:
        """Compute the frequency (Hz) of the strongest line of the tool's motion at each crossing."""
        if not len(crossings.depth):
            return np.zeros(0)
        values, vectors = np.linalg.eig(self.matrices(crossings.speed, crossings.theta))
        chosen = np.argmin(np.abs(values - 1 / crossings.depth[:, None]), axis=1)
        motion = vectors[np.arange(len(chosen)), :, chosen]
        force = self.forces(crossings.speed, crossings.theta)
        shape = force.shape[:3]
        excitation = (force.reshape(len(chosen), -1, motion.shape[1]) @ motion[:, :, None]).reshape(shape)
        lines = self.lines(crossings.speed, crossings.theta)
        size = np.linalg.norm(self.receptance(lines)[:, :, :, self.flexible[1]] @ excitation[..., None], axis=(2, 3))
        return np.asarray(np.abs(lines[np.arange(len(lines)), np.argmax(size, axis=1)]))


def _flexible(source: ToolReceptance, process: MillingProcess) -> tuple[list[int], list[int]]:
    """List the directions of motion that change the chip, and the directions in which a force causes motion."""
    size = np.abs(source.evaluate(source.grid)).max(axis=0)
    chip = np.abs(chip_direction(process, np.linspace(process.start_angle, process.exit_angle, 9))).max(axis=0) > 1e-12
    return np.flatnonzero(size.any(axis=1) & chip).tolist(), np.flatnonzero(size.any(axis=0)).tolist()


def _peaks(source: ToolReceptance) -> Real:
    """Return the frequencies (Hz) of up to eight highest peaks of the receptance."""
    size = np.linalg.norm(source.evaluate(source.grid), axis=(1, 2))
    tops = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:])) + 1
    return source.grid[tops[np.argsort(-size[tops])][:8]]


def _highest_peak(source: ToolReceptance) -> float:
    """Return the frequency (Hz) above all lines of an FRF that reach a thirtieth of the highest peak."""
    size = np.linalg.norm(source.evaluate(source.grid), axis=(1, 2))
    return 1.5 * float(source.grid[np.flatnonzero(size >= size.max() / 30)[-1]])


def _every_second_line(frf: Frf) -> ToolReceptance | None:
    """Return the receptance of every second line, to show the effect of the line distance; None for too few lines."""
    half = replace(
        frf,
        frequencies=frf.frequencies[::2],
        values=frf.values[::2],
        valid=frf.valid[::2],
        multiple_coherence=None,
        covariance=None,
        coherence=None,
        common_errors=None,
    )
    return tool_receptance(half) if (half.valid & (half.frequencies > 0)).sum() >= SETTINGS.least_lines else None
