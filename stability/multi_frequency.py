"""Multi-frequency solution: harmonics of tooth passing on FRF samples, period doubling without a modal fit."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess, damping_harmonics, directional_harmonics, refuse_varied, turn_harmonics
from estimation import Frf
from foundation import InputError
from modal_fit import ModalModel

from .crossings import Crossings, find_crossings, moved_depths
from .stability_limits import StabilityLimits
from .stability_lobes import StabilityLobes
from .tool_receptance import ToolReceptance, tool_receptance
from .varied_edges import period_angle
from .zero_order import checked_speeds

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Index = NDArray[np.int64]

MOST_HARMONICS = 60
"""On each side; a structure that needs more turns too often between two teeth."""


def multi_frequency(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float
) -> StabilityLobes:
    """Lowest unstable depth at each speed from FRF samples; Hopf and period doubling.

    Parameters
    ----------
    structure
        Tip receptance, measured or modal.
    process
        Cutter and engagement.
    spindle_speeds : (n_speeds,), rad/s
    max_depth
        Depths above it are not looked for, m.

    Raises
    ------
    InputError
        As :func:`multi_frequency_limits`.
    """
    return multi_frequency_limits(structure, process, spindle_speeds, max_depth).lowest()


def multi_frequency_limits(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float
) -> StabilityLimits:
    """All limits from ``det[I - a (1 - exp(-i w tau)) K_tc alpha_(p-q) H(w + q w_T)] = 0``.

    Forces at ``w + p w_T`` come from motions at ``w + q w_T`` through the harmonics of the directional matrix;
    harmonics at which the structure does not move drop out, which truncates the infinite determinant by itself. The
    depth is one over an eigenvalue, as in the zero-order solution, which keeps p = q = 0 alone; period doubling is
    ``w = w_T / 2`` (Budak & Altintas 1998; Merdol & Altintas 2004).

    Unequal pitch has its harmonics at the spindle's frequency and one delay a tooth; process damping adds
    ``-i w (C / V) P`` to the force, linear in depth too.

    A measured FRF counts only inside its valid lines: below them its first line's real part is kept, above them the
    structure is taken to stand still.

    Parameters
    ----------
    structure, process, spindle_speeds, max_depth
        As :func:`multi_frequency`.

    Raises
    ------
    InputError
        Speeds or depth not positive, a structure that cannot be used, or speeds so low that more than 60 harmonics of
        tooth passing lie below its highest frequency.
    """
    refuse_varied(process, "the multi-frequency solution", "use collocation", takes=("pitch", "damping"))
    speeds = checked_speeds(spindle_speeds, max_depth)
    source = tool_receptance(structure)
    truncated = _Truncated(source, process, period_angle(process) / speeds, _flexible(source))
    coarser = replace(truncated, source=_coarser(structure, source))
    found = find_crossings(
        truncated.eigenvalues, truncated.first_angles(_peaks(source)), max_depth, folds=not process.is_plain
    )
    real = (found.theta == np.pi) | (found.theta == 0)
    return StabilityLimits(
        speeds,
        float(max_depth),
        found.speed,
        found.depth,
        truncated.strongest_lines(found),
        tuple({np.pi: "period-doubling", 0.0: "fold"}.get(float(theta), "hopf") for theta in found.theta),
        np.where(found.outward, 1, -1) * np.where(real, 1, 2),
        moved_depths(coarser.eigenvalues, found) / 3 + 1e-9 * found.depth,
        "multi-frequency",
        source.warnings,
    )


@dataclass(frozen=True)
class _Truncated:
    """The truncated determinant: a receptance, a process and one truncation for all speeds."""

    source: ToolReceptance
    process: MillingProcess
    periods: Real
    flexible: tuple[list[int], list[int]]

    @property
    def harmonics(self) -> Index:
        """Orders q that can lie below the highest frequency at the longest period."""
        top = int(np.ceil(self.source.span[1] * float(self.periods.max())))
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
        """The loop gain between forces at all harmonics, (n_pairs, n, n), 1/m."""
        orders = self.harmonics
        count = len(orders)
        rows, columns = self.flexible
        difference = np.arange(count)[:, None] - np.arange(count) + count - 1
        orders = np.arange(1 - count, count)
        moving = self.receptance(self.lines(speeds, theta))[:, :, rows][:, :, :, columns]
        size = count * len(columns)
        blocks = np.zeros((len(theta), count, len(columns), count, len(columns)), dtype=complex)
        for harmonics, factor in self._terms(orders, speeds, theta):
            cutting = harmonics[difference][:, :, columns][:, :, :, rows]
            blocks += np.einsum("pqij,nqjk->npiqk", cutting, factor[:, :, None, None] * moving, optimize=True)
        return blocks.reshape(len(theta), size, size)

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
        rows, columns = self.flexible
        force = vectors[np.arange(len(chosen)), :, chosen].reshape(len(chosen), -1, len(columns))
        lines = self.lines(found.speed, found.theta)
        moving = self.receptance(lines)[:, :, rows][:, :, :, columns]
        motion = np.linalg.norm(np.einsum("nqjk,nqk->nqj", moving, force), axis=2)
        return np.asarray(np.abs(lines[np.arange(len(lines)), np.argmax(motion, axis=1)]))


def _flexible(source: ToolReceptance) -> tuple[list[int], list[int]]:
    """Directions that move, and directions in which a force moves anything."""
    size = np.abs(source.evaluate(source.grid)).max(axis=0)
    return np.flatnonzero(size.any(axis=1)).tolist(), np.flatnonzero(size.any(axis=0)).tolist()


def _peaks(source: ToolReceptance) -> Real:
    """Up to eight highest peaks of the receptance, Hz."""
    size = np.linalg.norm(source.evaluate(source.grid), axis=(1, 2))
    tops = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:])) + 1
    return source.grid[tops[np.argsort(-size[tops])][:8]]


def _coarser(structure: Frf | ModalModel, source: ToolReceptance) -> ToolReceptance:
    """What the limits are compared with: every second FRF line, or a model truncated a quarter lower."""
    if isinstance(structure, ModalModel):
        return replace(source, span=(source.span[0], 0.75 * source.span[1]))
    half = replace(
        structure,
        frequencies=structure.frequencies[::2],
        values=structure.values[::2],
        valid=structure.valid[::2],
        multiple_coherence=None,
        covariance=None,
    )
    usable = (half.valid & (half.frequencies > 0)).sum() >= 8
    return tool_receptance(half) if usable else source
