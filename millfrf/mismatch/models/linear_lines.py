"""The linear part of a hypothesis at the lines of a recording, and responses cut and windowed like a measurement."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real

from ..joints.joint_axis import JointAxis
from .hypothesis import Hypothesis, Surround, surround
from .modal_lines import line_products, receptance_at

CUT = 4  # numbers whose derivatives are cut from whole recordings together


@dataclass(frozen=True)
class LinearLines:
    """Matrices of the linear part, computed once for misfit, noise and derivatives."""

    around: Surround  # matrices of the linear causes
    # receptance H of the modal model; the excitations on which joints act come last, (n_lines, n_responses,
    # n_reached), m/N
    receptance: Complex
    closed: Complex  # receptance ``T H`` with the feedback of linear causes, (n_lines, n_responses, n_reached), m/N
    # matrix ``C Q`` from displacements to measured quantities with the kinematic factors Q and the measuring chain C,
    # (n_lines, n_responses, n_responses)
    shown: Complex
    # matrix from measured forces to measured responses, weighted by the trust in each force, (n_lines, n_responses,
    # n_excitations)
    through: Complex

    def returned(self, matrix: Complex) -> Complex:
        """Return ``M T`` for M (n_lines, n, n_responses), with the factor ``T = (I + H K)^-1`` of the feedback K."""
        if self.around.feedback is None:
            return matrix
        own = self.closed[:, :, : self.around.feedback.shape[1]]
        return matrix - line_products(line_products(matrix, own), self.around.feedback)

    def to_joint(self, push: Real) -> Complex:
        """Return the response to a joint that acts with the forces ``push`` per unit, (n_lines, n_responses).

        A joint acts on the structure with a minus sign.
        """
        # one product for all lines: numpy would call BLAS for each line
        closed = self.closed.reshape(-1, len(push)) @ -push
        return line_products(self.shown, closed.reshape(self.closed.shape[:2]))


def linear_lines(hypothesis: Hypothesis, lines: WindowedSpectrum, *more: JointAxis) -> LinearLines:
    """Return the linear part of a hypothesis at the lines of a recording; ``more`` are axes of further joints.

    Raises ``numpy.linalg.LinAlgError`` if the feedback around the structure is singular at a line.
    """
    around = surround(hypothesis, lines.frequencies)
    n, m = len(hypothesis.model.responses), len(hypothesis.model.excitations)
    receptance = receptance_at(hypothesis.reach_with(*more).model, lines.frequencies)[:, :n]
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
    """Return the response lines to a unit force along each entry of an axis, (n_lines, n_responses, n_entries)."""
    linear = linear_lines(hypothesis, lines, axis)
    columns = hypothesis.reach_with(axis).paths[-1].columns
    return line_products(linear.shown, linear.closed @ columns)


def cut_products(response: Complex, change: Complex, lines: WindowedSpectrum) -> Iterator[tuple[slice, Complex]]:
    """Yield a few columns at a time of the windowed responses to changes of a force, in single precision.

    ``response`` is (n_padded_lines, n_responses) per unit of the force, and ``change`` (n_padded_lines, n_columns).
    """
    single = response.astype(np.complex64)[:, :, None]
    for some in few_columns(change.shape[1]):
        yield some, cut_spectra(single * change[:, None, some].astype(np.complex64), lines)


def few_columns(count: int) -> Iterator[slice]:
    """Yield a few columns at a time, so that their signals stay in the processor's cache."""
    for start in range(0, count, CUT):
        yield slice(start, min(start + CUT, count))


def cut_spectra(spectra: NDArray[np.complexfloating], lines: WindowedSpectrum) -> Complex:
    """Cut and window padded spectra, (n_padded_lines, n_responses, n_columns), like the measurement."""
    cut = lines.cut(lines.signal(spectra.reshape(len(spectra), -1)))
    return cut.reshape(*lines.measured.shape, spectra.shape[2])
