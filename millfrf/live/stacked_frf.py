"""`StackedFrf`: the FRF of all tests of a session together, and the lines on which it says something."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation import CrossSpectra, Frf, h1, input_independence, sum_tests
from millfrf.core import InputError

from ..gate import driven_lines

_COHERENT = 0.5
_POOR = 1e3  # condition of the scaled forces from which noise on the weakest direction rules


@dataclass(frozen=True)
class StackedFrf:
    """FRF of several tests.

    Parameters
    ----------
    frf
        H1 over the tests' summed spectra; None: the forces are independent on no line.
    driven, known : (n_lines,), bool
        Lines on which a force has power, and those of them on which the forces are independent and a response
        follows them.
    """

    frf: Frf | None
    driven: NDArray[np.bool_]
    known: NDArray[np.bool_]


def stack(tests: Sequence[CrossSpectra]) -> StackedFrf:
    """Stack tests of one set-up, spectra of equal settings.

    Raises
    ------
    InputError
        No test, or tests that cannot be stacked.
    """
    total = sum_tests(tests)
    driven = driven_lines(total)
    none = StackedFrf(None, driven, np.zeros_like(driven))
    if total.effective_averages <= len(total.excitations) + 0.5:
        return none
    try:
        frf = h1(total)
    except InputError:
        return none
    known = driven & frf.valid & (input_independence(total).condition < _POOR)
    if frf.multiple_coherence is not None:
        known &= frf.multiple_coherence.max(axis=1) >= _COHERENT
    return StackedFrf(frf, driven, known) if known.any() else none
