"""Derivative of the response lines by everything that is fitted."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real

from .hypothesis import Hypothesis, Predicted, Surround, surround
from .joint_tangents import JointChange, joint_changes
from .misfit import LinearLines, linear_lines
from .modal_lines import line_products, receptance_at
from .modal_loops import add_outer


@dataclass(frozen=True)
class Slopes:
    """Derivative of the response lines, in parts that are multiplied out line by line.

    Parameters
    ----------
    hypothesis
        Hypothesis at which the derivative is taken.
    frequencies : (n_lines,), Hz
        Frequencies of the lines.
    force : (n_lines, n_excitations), N
        Force that the modes feel, on all excitations that joints reach.
    shown : (n_lines, n_responses, n_responses)
        Matrix from displacements to measured responses, with what feedback returns.
    pushed
        For each joint and each turn of one: the response lines (n_lines, n_responses) to a unit force of it, what is
        fitted changes of that force (n_lines, n_columns), and the first of these columns.
    direct
        For each number of a linear cause: its column, and its derivative (n_lines, n_responses).
    """

    hypothesis: Hypothesis
    frequencies: Real
    force: Complex
    shown: Complex
    pushed: tuple[tuple[Complex, Complex, int], ...]
    direct: tuple[tuple[int, Complex], ...]

    def of(self, part: slice, white: Complex | None = None) -> Real:
        """Rows (2, n_lines, n_responses, size) of some lines: real above imaginary parts, whitened by W if given.

        Parameters
        ----------
        part
            Lines that are wanted.
        white : (n_lines, n_responses, n_responses)
            Whitening of all lines.
        """
        hypothesis, shape = self.hypothesis, self.hypothesis.shape

        def seen(lines: Complex) -> Complex:
            return lines[part] if white is None else line_products(white[part], lines[part])

        shown = seen(self.shown)
        out = np.empty((2, *shown.shape[:2], hypothesis.size))
        shape.write_slopes(hypothesis.reach.model, self.frequencies[part], self.force[part], shown, out)
        out[..., shape.size :] = 0.0
        for response, change, first in self.pushed:
            add_outer(seen(response), change[part], first, out)
        for column, change in self.direct:
            add_outer(seen(change), np.ones((shown.shape[0], 1), dtype=complex), column, out)
        return out


def jacobian(hypothesis: Hypothesis, lines: WindowedSpectrum, predicted: Predicted) -> Complex:
    """Derivative of the response lines by u and the causes' coordinates, (n_lines, n_responses, size)."""
    parts = slopes(hypothesis, lines, predicted, linear_lines(hypothesis, lines)).of(slice(None))
    return np.asarray(parts[0] + 1j * parts[1])


def slopes(hypothesis: Hypothesis, lines: WindowedSpectrum, predicted: Predicted, linear: LinearLines) -> Slopes:
    """Derivative of the response lines by u and the causes' coordinates, not multiplied out.

    Parameters
    ----------
    hypothesis
        Hypothesis at which the derivative is taken.
    lines
        Windowed spectrum of the recording.
    predicted
        What the hypothesis predicts for the recording.
    linear
        Matrices of its linear part at the lines.
    """
    changes = joint_changes(hypothesis, lines, predicted) if predicted.joints else ()
    reach = hypothesis.reach
    felt = reach.forces(linear.around.pushed(lines.force_here))
    for change in changes:
        felt = felt - change.force[:, None] * change.push
    force = felt
    if linear.around.feedback is not None:
        force = felt - reach.forces(line_products(linear.around.feedback, line_products(linear.closed, felt)))
    return Slopes(
        hypothesis,
        lines.frequencies,
        np.ascontiguousarray(force),
        linear.returned(linear.shown),
        tuple(pushed for change in changes for pushed in _pushed(change, linear)),
        tuple(_direct(hypothesis, lines, linear, felt)),
    )


def _pushed(change: JointChange, linear: LinearLines) -> Iterator[tuple[Complex, Complex, int]]:
    """What a joint's force and the turns of its axis do, as :class:`Slopes` takes it."""

    def response(push: Real) -> Complex:
        # the structure feels a joint's force with a minus sign
        return line_products(linear.shown, -(linear.closed @ push))

    yield response(change.push), change.change, change.first
    for k, turn in enumerate(change.turns.T):
        yield response(turn), change.force[:, None], change.angles + k


def _direct(
    hypothesis: Hypothesis, lines: WindowedSpectrum, linear: LinearLines, felt: Complex
) -> Iterator[tuple[int, Complex]]:
    """Column and difference quotient of each number of a linear cause; ``felt`` is the force at the lines."""
    linear_ones = [np.full(cause.size, cause.axis is None) for cause in hypothesis.causes]
    columns = np.flatnonzero(np.concatenate([np.zeros(0, dtype=bool), *linear_ones]))
    if not len(columns):
        return
    receptance = linear.receptance
    if hypothesis.model.residuals is not None and hypothesis.model.residuals.lower.any():
        receptance = receptance_at(hypothesis.reach.model, lines.frequencies)[:, : receptance.shape[1]]
    forces = hypothesis.reach.forces
    joint = forces(linear.around.pushed(lines.force_here)) - felt

    def response(around: Surround) -> Complex:
        through = receptance if around.feedback is None else around.closed(linear.receptance)
        displacement = line_products(through, forces(around.pushed(lines.force_here)) - joint)
        return around.shown(displacement * lines.kinematic)

    here, plain = hypothesis.coordinates(), response(linear.around)
    steps = hypothesis.steps_aside()
    for k in columns:
        aside = here.copy()
        aside[k] += steps[k]
        moved = surround(hypothesis.with_causes(aside), lines.frequencies)
        yield hypothesis.shape.size + int(k), (response(moved) - plain) / steps[k]
