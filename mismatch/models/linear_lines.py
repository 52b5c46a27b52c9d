"""The linear part of a hypothesis at the lines of a recording that are compared."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation import WindowedSpectrum

from ..joints import JointAxis
from .hypothesis import Hypothesis, Surround, surround
from .lines import line_products

Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class LinearLines:
    """Matrices of the linear part, worked out once for all that needs them: misfit, noise and derivatives.

    Parameters
    ----------
    around
        Matrices of the linear causes.
    receptance : (n_lines, n_responses, n_reached), m/N
        Receptance H of the modal model, with the excitations that joints reach behind its own.
    closed : (n_lines, n_responses, n_reached), m/N
        Receptance ``T H`` with the feedback of linear causes around it.
    shown : (n_lines, n_responses, n_responses)
        Matrix ``C Q`` from displacements to measured quantities: Q their kinematic factors, C the measuring chain.
    through : (n_lines, n_responses, n_excitations)
        Matrix from measured forces, trusted as far as they are, to measured responses.
    """

    around: Surround
    receptance: Complex
    closed: Complex
    shown: Complex
    through: Complex

    def returned(self, matrix: Complex) -> Complex:
        """``M T``, with T the factor ``I - T H K`` of the feedback, for a matrix M (n_lines, n, n_responses)."""
        if self.around.feedback is None:
            return matrix
        own = self.closed[:, :, : self.around.feedback.shape[1]]
        return matrix - line_products(line_products(matrix, own), self.around.feedback)


def linear_lines(hypothesis: Hypothesis, lines: WindowedSpectrum, *more: JointAxis) -> LinearLines:
    """The linear part of a hypothesis at the lines of a recording.

    Parameters
    ----------
    hypothesis
        Hypothesis whose linear part is wanted.
    lines
        Windowed spectrum of the recording.
    more
        Axes of further joints that may push.

    Raises
    ------
    numpy.linalg.LinAlgError
        The feedback around the structure is singular at a line.
    """
    around = surround(hypothesis, lines.frequencies)
    n, m = len(hypothesis.model.responses), len(hypothesis.model.excitations)
    receptance = hypothesis.reach_with(*more).model.receptance(lines.frequencies)[:, :n]
    if around.response is None:
        shown = np.zeros((len(receptance), n, n), dtype=complex)
        shown[:, np.arange(n), np.arange(n)] = lines.kinematic
    else:
        shown = around.response * lines.kinematic[:, None, :]
    closed = around.closed(receptance)
    through = line_products(shown, closed[:, :, :m])
    if around.force is not None:
        through = line_products(through, around.force)
    return LinearLines(around, receptance, closed, shown, line_products(through, lines.trust))


def response_to_joint(hypothesis: Hypothesis, lines: WindowedSpectrum, axis: JointAxis) -> Complex:
    """Responses at the lines to a unit force along each entry of an axis, (n_lines, n_responses, n_entries)."""
    linear = linear_lines(hypothesis, lines, axis)
    columns = hypothesis.reach_with(axis).paths[-1].columns
    return line_products(linear.shown, linear.closed @ columns)
