"""Data of the page on which poles are picked, and the answers to its requests."""

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import Band, InputError, MillfrfError
from millfrf.figures import EntryCurves, picking_chart, zoomed_frfs
from modal_fit import CandidateGroup, ModalFit, ModalModel, candidate_groups, fit_picked_poles, synthesis

LINES = 1500  # frequencies at which the synthesis is drawn, besides the measured lines
MOST_ENTRIES = 60  # most FRFs in the list
MOST_POLES = 200  # most poles of one choice

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

    @property
    def groups(self) -> tuple[CandidateGroup, ...]:
        return candidate_groups(self.automatic)


def chosen_at_first(session: PickSession) -> list[Pole]:
    """Poles of the automatic fit."""
    return [(group.frequency, group.damping_ratio) for group in session.groups if group.taken]


def drawn_page(session: PickSession) -> str:
    """Return chart, FRFs and candidate poles as JSON for the page."""
    chart = picking_chart(session.automatic.chart, session.frf)
    frfs = zoomed_frfs(_entries(session), _lines(session), _grid(session), f"|H| ({session.frf.unit})")
    return json.dumps(
        {
            "name": session.name,
            "band": list(session.band),
            "chart": json.loads(chart.document),
            "frfs": json.loads(frfs.document),
            "choices": json.loads(frfs.choices),
            "poles": _chart_poles(session),
            "groups": [group.content() for group in session.groups],
            "chosen": chosen_at_first(session),
        }
    )


def fitted_answer(session: PickSession, request: object) -> dict[str, Any]:
    """Fit the chosen poles; return the synthesis of one entry and the misfit of all entries."""
    try:
        poles, entry = checked_choice(request, len(_shown(session)))
        fit = fit_picked_poles(session.frf, session.band, as_poles(poles), max_order=session.max_order)
    except MillfrfError as error:
        return {"error": str(error)}
    p, q = _shown(session)[entry]
    compared = synthesis(session.frf, fit.model, session.band)
    values = _curve(session, fit.model, p, q)
    angle = np.angle(values, deg=True)
    angle[1:][np.abs(np.diff(angle)) > 180] = np.nan
    columns = {"f": _grid(session), "size": np.abs(values), "angle": angle}
    known = 100 * compared.misfit[np.isfinite(compared.misfit)]
    return {
        "fitted": {name: _packed(column) for name, column in columns.items()},
        "misfit": float(100 * compared.misfit[p, q]),
        "misfits": [float(known.min()), float(np.median(known)), float(known.max())],
        "warnings": list(fit.warnings),
    }


def checked_choice(request: object, n_entries: int) -> tuple[list[Pole], int]:
    """Check a request of the page; return the chosen poles and the index of the entry to draw."""
    if not isinstance(request, dict) or not isinstance(request.get("poles"), list):
        raise InputError("the page sent no list of poles; reload it")
    entry, poles = request.get("entry", 0), request["poles"]
    if type(entry) is not int or not 0 <= entry < n_entries:
        raise InputError(f"there is no FRF number {entry!r}; there are {n_entries}")
    if not 0 < len(poles) <= MOST_POLES:
        raise InputError(f"{len(poles)} poles are chosen; choose 1 to {MOST_POLES}")
    return [_pole(number, pole) for number, pole in enumerate(poles, start=1)], entry


def _pole(number: int, item: object) -> Pole:
    pair: list[Any] = item if isinstance(item, list) and len(item) == 2 else [None, None]
    if not all(isinstance(value, int | float) and not isinstance(value, bool) and np.isfinite(value) for value in pair):
        raise InputError(f"pole {number} is {item!r}; give a frequency in Hz and a damping ratio")
    frequency, damping = float(pair[0]), float(pair[1])
    if not (frequency > 0 and 0 < damping < 0.5):
        raise InputError(
            f"pole {number}: {frequency:g} Hz with damping {100 * damping:g} %; give a frequency above 0 and a damping "
            "above 0 and below 50 %"
        )
    return frequency, damping


def as_poles(chosen: Sequence[Pole]) -> NDArray[np.complex128]:
    """Convert frequencies and damping ratios to poles in rad/s.

    Examples
    --------
    >>> as_poles([(1.0, 0.6)]).round(3).tolist()
    [(-3.77+5.027j)]
    """
    pairs = np.asarray(chosen, dtype=float)
    return np.asarray(2 * np.pi * pairs[:, 0] * (-pairs[:, 1] + 1j * np.sqrt(1 - pairs[:, 1] ** 2)))


def _lines(session: PickSession) -> NDArray[np.float64]:
    f = session.frf.frequencies
    return f[(f >= session.band[0]) & (f <= session.band[1])]


def _grid(session: PickSession) -> NDArray[np.float64]:
    f = np.union1d(_lines(session), np.linspace(*session.band, LINES))
    return f[f > 0]


def _shown(session: PickSession) -> list[tuple[int, int]]:
    """Return the entries that the page lists: all entries, or the entries with the largest misfit."""
    entries = [(p, q) for q in range(len(session.frf.excitations)) for p in range(len(session.frf.responses))]
    if len(entries) <= MOST_ENTRIES:
        return entries
    return list(synthesis(session.frf, session.automatic.model, session.band).ranked()[:MOST_ENTRIES])


def _entries(session: PickSession) -> list[EntryCurves]:
    frf = session.frf
    inside = (frf.frequencies >= session.band[0]) & (frf.frequencies <= session.band[1])
    values = np.where(frf.valid[:, None, None], frf.values, np.nan)[inside]
    return [
        EntryCurves(
            f"{frf.responses[p]} / {frf.excitations[q]}",
            values[:, p, q],
            _curve(session, session.automatic.model, p, q),
        )
        for p, q in _shown(session)
    ]


def _curve(session: PickSession, model: ModalModel, p: int, q: int) -> NDArray[np.complex128]:
    """Return an entry of the model in the quantity and with the exponential window of the measured FRF."""
    tau = session.frf.exponential_time_constant
    s = np.asarray(2j * np.pi * _grid(session) + (0.0 if tau is None else 1 / tau), dtype=np.complex128)
    curve = np.asarray(model.at(s)[:, p, q])
    order = {"receptance": 0, "mobility": 1, "accelerance": 2}
    equal_quantity = model.quantity == session.frf.quantity or session.frf.quantity not in order
    return curve if equal_quantity else curve * s ** (order[session.frf.quantity] - order[model.quantity])


def _chart_poles(session: PickSession) -> list[list[float]]:
    """Return frequency (Hz), damping ratio and order of all poles of the chart that can be picked."""
    chart = session.automatic.chart
    zeta = chart.damping_ratios
    valid = (zeta > 0) & (zeta < 0.5) & (chart.frequencies >= session.band[0]) & (chart.frequencies <= session.band[1])
    table = np.column_stack([chart.frequencies, zeta, chart.orders])[valid]
    return [[round(float(f), 6), round(float(z), 8), float(order)] for f, z, order in table]


def _packed(column: NDArray[np.float64]) -> str:
    return base64.b64encode(np.asarray(column, "<f4").tobytes()).decode("ascii")
