"""The fixed poles outside the band that the data show: a model must not carry terms that run away beyond its band."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..out_of_band import basis_with_poles, fixed_poles
from .elimination import Modes
from .held_out_lines import prediction_error
from .measured_lines import MeasuredLines
from .neighbourhood import half_power_lines
from .refinement import refine

_END = 0.075  # of the band, held out at an edge
_BELOW: tuple[tuple[float, ...], ...] = ((), (0.7,))  # of the lower edge, the fewest first
_ABOVE: tuple[tuple[float, ...], ...] = ((), (2.0,), (1.3, 3.0))  # of the upper edge
_BETTER = 0.9  # of the error: what another pole must lower it to
_STEPS, _TOLERANCE = 8, 1e-4


def with_terms_that_hold(modes: Modes, lines: MeasuredLines) -> MeasuredLines:
    """The lines with as few fixed poles outside the band as predict its ends.

    A pole outside the band takes up what a mode there adds. It takes up leakage, too, and then the model runs away
    beyond the band, where harmonics of the tooth passing ask for it. Lines at one end of the band are held out:
    a term that stands for a mode outside predicts them, one that stands for an error does not. An end where a mode
    stands cannot be held out; there the textbook residuals alone stay.

    Parameters
    ----------
    modes
        Modes of the band.
    lines
        All lines.
    """
    above = _best(modes, lines, _lower_lines(modes, lines), [((), places) for places in _ABOVE])[1]
    below = _best(modes, lines, _upper_lines(modes, lines), [(places, above) for places in _BELOW])[0]
    return with_fixed_poles(lines, below, above)


def with_fixed_poles(lines: MeasuredLines, below: Sequence[float], above: Sequence[float]) -> MeasuredLines:
    """The lines with fixed poles at these multiples of the lower and upper edge of the band."""
    poles = fixed_poles(lines.band, below, above)
    return replace(lines, outside_poles=tuple(poles), basis=basis_with_poles(lines.s, lines.band, poles))


_Places = tuple[tuple[float, ...], tuple[float, ...]]


def _best(modes: Modes, lines: MeasuredLines, seen: NDArray[np.bool_] | None, choices: Sequence[_Places]) -> _Places:
    """The first of the choices, unless a later one predicts the lines that are not ``seen`` plainly better."""
    if seen is None:
        return choices[0]
    best, least = choices[0], np.inf
    for places, error in zip(choices, _errors(modes, lines, seen, choices), strict=True):
        if error < _BETTER * least:
            best, least = places, error
    return best


def _errors(modes: Modes, lines: MeasuredLines, seen: NDArray[np.bool_], choices: Sequence[_Places]) -> Iterator[float]:
    for below, above in choices:
        tried = with_fixed_poles(lines, below, above)
        again = refine(modes, tried.part(seen), steps=_STEPS, tolerance=_TOLERANCE)
        yield prediction_error(again.modes, again.elimination, tried.part(~seen))


def _lower_lines(modes: Modes, lines: MeasuredLines) -> NDArray[np.bool_] | None:
    """The lines but for the upper end, or None where a mode stands there."""
    return _free(modes, lines, lines.frequencies <= lines.frequencies[-1] - _END * np.ptp(lines.frequencies))


def _upper_lines(modes: Modes, lines: MeasuredLines) -> NDArray[np.bool_] | None:
    """The lines but for the lower end, or None where a mode stands there."""
    return _free(modes, lines, lines.frequencies >= lines.frequencies[0] + _END * np.ptp(lines.frequencies))


def _free(modes: Modes, lines: MeasuredLines, seen: NDArray[np.bool_]) -> NDArray[np.bool_] | None:
    stands = any((half_power_lines(complex(pole), lines) & ~seen).any() for pole in modes.poles)
    return None if stands or seen.all() else seen
