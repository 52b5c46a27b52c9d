"""Poles picked on a stabilisation chart: what can be picked, and the fit of a choice."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import Band, InputError
from millfrf.figures import EntryCurves
from modal_fit import CandidateGroup, ModalFit, ModalModel, candidate_groups, fit_picked_poles, synthesis

LINES = 1500  # frequencies at which the synthesis is drawn, besides the measured lines
MOST_ENTRIES = 60  # most FRFs in the list
MOST_POLES = 200  # most poles of one choice
NEAR = 14  # pixels; largest distance of a click from a pole that it picks

Pole = tuple[float, float]  # natural frequency (Hz), damping ratio


@dataclass(frozen=True)
class PickSession:
    """An FRF and its automatic fit, from which the user picks poles."""

    name: str  # of the FRF file
    frf: Frf
    automatic: ModalFit  # with its stabilisation chart
    max_order: int | None = None  # highest model order

    @property
    def band(self) -> Band:
        """Lowest and highest frequency of the fit, Hz."""
        return self.automatic.band

    @cached_property
    def groups(self) -> tuple[CandidateGroup, ...]:
        """Groups of poles that several model orders share."""
        return candidate_groups(self.automatic)

    @cached_property
    def entries(self) -> tuple[tuple[int, int], ...]:
        """Response and excitation of the entries that the page lists: all, or those with the largest misfit."""
        entries = [(p, q) for q in range(len(self.frf.excitations)) for p in range(len(self.frf.responses))]
        if len(entries) <= MOST_ENTRIES:
            return tuple(entries)
        return tuple(synthesis(self.frf, self.automatic.model, self.band).ranked()[:MOST_ENTRIES])


def chosen_at_first(session: PickSession) -> list[Pole]:
    """Return the poles of the automatic fit; of poles that are one mode of several directions, the first."""
    chosen: list[Pole] = []
    for group in session.groups:
        pole = (group.frequency, group.damping_ratio)
        if group.taken and not any(are_alike(other, pole) for other in chosen):
            chosen.append(pole)
    return chosen


@dataclass(frozen=True)
class PickedFit:
    """Fit of chosen poles: the synthesis of one entry, and the misfit of all.

    Parameters
    ----------
    curves
        Entry as measured and as fitted.
    misfit : %
        Misfit of the entry.
    misfits : %
        Smallest, median and largest misfit of all entries.
    warnings
        Warnings of the fit.
    """

    curves: EntryCurves
    misfit: float
    misfits: tuple[float, float, float]
    warnings: tuple[str, ...]


def fit_choice(session: PickSession, poles: Sequence[Pole], entry: int) -> PickedFit:
    """Fit chosen poles, and compare an entry of the FRF with them.

    Raises
    ------
    InputError
        No pole, one outside the band, or two that are the same.
    """
    if not 0 < len(poles) <= MOST_POLES:
        raise InputError(f"{len(poles)} poles are chosen; choose 1 to {MOST_POLES}")
    fit = fit_picked_poles(session.frf, session.band, as_poles(poles), max_order=session.max_order)
    p, q = session.entries[entry]
    compared = synthesis(session.frf, fit.model, session.band)
    known = 100 * compared.misfit[np.isfinite(compared.misfit)]
    return PickedFit(
        entry_curves(session, fit.model, p, q),
        float(100 * compared.misfit[p, q]),
        (float(known.min()), float(np.median(known)), float(known.max())),
        tuple(fit.warnings),
    )


def checked_pole(frequency: str, damping: str) -> Pole:
    """Read a pole from a frequency in Hz and a damping ratio in per cent as they were typed.

    Raises
    ------
    InputError
        No numbers, or a pole that no mode has.
    """
    try:
        f, zeta = float(frequency), float(damping) / 100
    except ValueError as error:
        raise InputError(f"{frequency!r} Hz, {damping!r} %: give two numbers, such as 22.5 and 1.2") from error
    if not (np.isfinite(f) and f > 0 and 0 < zeta < 0.5):
        raise InputError(
            f"{f:g} Hz with damping {100 * zeta:g} %; give a frequency above 0 and a damping above 0 and below 50 %"
        )
    return f, zeta


def nearest_pole(session: PickSession, at: tuple[float, float], per_pixel: tuple[float, float], by: str) -> Pole | None:
    """Return the pole of the chart that is nearest to a click, if it is near enough.

    Parameters
    ----------
    at
        Frequency (Hz) of the click, and order or damping ratio (%).
    per_pixel
        Size of a pixel in the same units.
    by
        ``orders`` or ``damping``: the panel of the chart.
    """
    poles = chart_poles(session)
    height = poles[:, 2] if by == "orders" else 100 * poles[:, 1]
    distance = np.hypot((poles[:, 0] - at[0]) / per_pixel[0], (height - at[1]) / per_pixel[1])
    nearest = int(np.argmin(distance)) if len(poles) else -1
    if nearest < 0 or distance[nearest] > NEAR:
        return None
    return float(poles[nearest, 0]), float(poles[nearest, 1])


def are_alike(first: Pole, second: Pole) -> bool:
    """Return whether two poles of a chart belong to one mode: nearer than half of their damping."""
    apart = np.hypot((first[0] - second[0]) / first[0], 0.3 * (first[1] - second[1]))
    return bool(apart < 0.5 * max(first[1], second[1], 2e-3))


def as_poles(chosen: Sequence[Pole]) -> NDArray[np.complex128]:
    """Convert frequencies and damping ratios to poles in rad/s.

    Examples
    --------
    >>> as_poles([(1.0, 0.6)]).round(3).tolist()
    [(-3.77+5.027j)]
    """
    pairs = np.asarray(chosen, dtype=float)
    return np.asarray(2 * np.pi * pairs[:, 0] * (-pairs[:, 1] + 1j * np.sqrt(1 - pairs[:, 1] ** 2)))


def lines_of(session: PickSession) -> NDArray[np.float64]:
    f = session.frf.frequencies
    return f[(f >= session.band[0]) & (f <= session.band[1])]


def grid_of(session: PickSession) -> NDArray[np.float64]:
    f = np.union1d(lines_of(session), np.linspace(*session.band, LINES))
    return f[f > 0]


def entry_label(session: PickSession, entry: int) -> str:
    """Name an entry: response and excitation."""
    p, q = session.entries[entry]
    return f"{session.frf.responses[p]} / {session.frf.excitations[q]}"


def entry_curves(session: PickSession, model: ModalModel, p: int, q: int) -> EntryCurves:
    """Return an entry as measured in the band, and as a model gives it."""
    frf = session.frf
    in_band = (frf.frequencies >= session.band[0]) & (frf.frequencies <= session.band[1])
    values = np.where(frf.valid, frf.values[:, p, q], np.nan)[in_band]
    return EntryCurves(f"{frf.responses[p]} / {frf.excitations[q]}", values, _curve(session, model, p, q))


def _curve(session: PickSession, model: ModalModel, p: int, q: int) -> NDArray[np.complex128]:
    """Return an entry of the model in the quantity and with the exponential window of the measured FRF."""
    tau = session.frf.exponential_time_constant
    s = np.asarray(2j * np.pi * grid_of(session) + (0.0 if tau is None else 1 / tau), dtype=np.complex128)
    curve = np.asarray(model.at(s)[:, p, q])
    order = {"receptance": 0, "mobility": 1, "accelerance": 2}
    equal_quantity = model.quantity == session.frf.quantity or session.frf.quantity not in order
    return curve if equal_quantity else curve * s ** (order[session.frf.quantity] - order[model.quantity])


def chart_poles(session: PickSession) -> NDArray[np.float64]:
    """Return frequency (Hz), damping ratio and order of all poles of the chart that can be picked, (n, 3)."""
    chart = session.automatic.chart
    zeta = chart.damping_ratios
    valid = (zeta > 0) & (zeta < 0.5) & (chart.frequencies >= session.band[0]) & (chart.frequencies <= session.band[1])
    return np.column_stack([chart.frequencies, zeta, chart.orders])[valid]
