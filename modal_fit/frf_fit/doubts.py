"""Doubts about the choice of modes: where the modes and the columns of the stabilisation chart disagree."""

from collections.abc import Iterator

import numpy as np

from ..settings import SETTINGS
from .candidates import Candidate
from .elimination import Modes
from .peaks import peak_rise
from .selection import Selection


def off_columns(modes: Modes, selection: Selection) -> Iterator[str]:
    """Yield a sentence for each mode in the band that is further than a half bandwidth from every stable column."""
    columns = [c for c in _considered(selection) if c.n_orders > 0]
    for pole in modes.poles[modes.inside(selection.lines.band)]:
        if not any(_belong_together(complex(pole), column) for column in columns):
            yield f"the mode at {_named(complex(pole))} stands on no stable column of the chart; check it with --pick"


def peaks_without_mode(modes: Modes, selection: Selection) -> Iterator[str]:
    """Yield a sentence for each steady column at a peak of the response that is not a mode, the steadiest first."""
    reasons = {candidate.pole: reason for candidate, reason in selection.rejected}
    told: list[Candidate] = []
    axis = selection.lines.frequencies
    spacing = selection.lines.spacing  # nothing narrower can be seen
    for column in sorted(_considered(selection), key=lambda candidate: -candidate.order_share):
        width = column.damping_ratio * column.frequency
        if column.order_share < SETTINGS.steady_candidate or column.pole not in reasons or width < spacing:
            continue
        if any(_belong_together(complex(pole), column) for pole in modes.poles) or any(
            abs(other.frequency - column.frequency) < width for other in told
        ):
            continue
        others = np.abs(axis[:, None] - modes.frequencies).min(axis=1)
        if peak_rise(column.pole, np.abs(axis - column.frequency) < others, selection.lines) > 1:
            told.append(column)
            share = f"{100 * column.order_share:.0f} % of the orders"
            yield f"no mode at {_named(column.pole)}, a peak and a stable column ({share}): {reasons[column.pole]}"


def _considered(selection: Selection) -> list[Candidate]:
    return [*selection.accepted, *(candidate for candidate, _ in selection.rejected)]


def _belong_together(pole: complex, column: Candidate) -> bool:
    return abs(pole - column.pole) <= abs(column.pole.real)


def _named(pole: complex) -> str:
    return f"{abs(pole) / (2 * np.pi):.4g} Hz ({-100 * pole.real / abs(pole):.2g} %)"
