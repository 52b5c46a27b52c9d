"""As few fixed poles outside the band as the data ask for: what a term need not explain, it must not take up."""

from collections.abc import Sequence
from dataclasses import replace

from ...models.out_of_band import basis_with_poles, fixed_poles
from .elimination import Modes
from .refinement import refine
from .whitened_lines import MeasuredLines

_FEWER: tuple[tuple[tuple[float, ...], tuple[float, ...]], ...] = (
    ((), (2.0,)),
    ((), (1.3, 3.0)),
    ((0.7,), (2.0,)),
)  # of the lower and the upper edge, the fewest first
_ALL = 3
_AS_GOOD = 1.1  # misfit over that with all poles: leakage lets more terms gain up to 8 % in stacked milling records
_STEPS, _TOLERANCE = 8, 1e-4


def with_fewest_terms(modes: Modes, lines: MeasuredLines) -> MeasuredLines:
    """The lines with the fewest fixed poles outside the band whose misfit is within a tenth of that with all.

    A pole outside the band takes up what a mode there adds, and leaks into the damping inside where there is none: FRFs
    of milling records carry leakage, which any further term explains in part.

    Parameters
    ----------
    modes
        Modes of the band.
    lines
        All lines, with all fixed poles.
    """
    if len(lines.outside_poles) < _ALL:
        return lines
    least = refine(modes, lines, steps=_STEPS, tolerance=_TOLERANCE).elimination.cost
    for below, above in _FEWER:
        tried = with_fixed_poles(lines, below, above)
        if refine(modes, tried, steps=_STEPS, tolerance=_TOLERANCE).elimination.cost <= _AS_GOOD * least:
            return tried
    return lines


def with_fixed_poles(lines: MeasuredLines, below: Sequence[float], above: Sequence[float]) -> MeasuredLines:
    """The lines with fixed poles at these multiples of the lower and upper edge of the band."""
    poles = fixed_poles(lines.band, below, above)
    return replace(lines, outside_poles=tuple(poles), basis=basis_with_poles(lines.s, lines.band, poles))
