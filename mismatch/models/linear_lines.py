"""The linear part of a hypothesis at the lines of a recording that are compared."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation import WindowedSpectrum

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
    receptance : (n_lines, n_responses, n_excitations), m/N
        Receptance H of the modal model.
    closed : (n_lines, n_responses, n_excitations), m/N
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
        return matrix - line_products(line_products(matrix, self.closed), self.around.feedback)


def linear_lines(hypothesis: Hypothesis, lines: WindowedSpectrum) -> LinearLines:
    """The linear part of a hypothesis at the lines of a recording.

    Parameters
    ----------
    hypothesis
        Hypothesis whose linear part is wanted.
    lines
        Windowed spectrum of the recording.

    Raises
    ------
    numpy.linalg.LinAlgError
        The feedback around the structure is singular at a line.
    """
    around = surround(hypothesis, lines.frequencies)
    receptance = hypothesis.model.receptance(lines.frequencies)
    n = receptance.shape[1]
    if around.response is None:
        shown = np.zeros((len(receptance), n, n), dtype=complex)
        shown[:, np.arange(n), np.arange(n)] = lines.kinematic
    else:
        shown = around.response * lines.kinematic[:, None, :]
    closed = around.closed(receptance)
    through = line_products(shown, closed)
    if around.force is not None:
        through = line_products(through, around.force)
    return LinearLines(around, receptance, closed, shown, line_products(through, lines.trust))
