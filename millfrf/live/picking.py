"""What the page on which poles are picked shows, and what it is answered: no server, no browser."""

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

LINES = 1500
"""Frequencies at which the synthesis is drawn, besides the measured lines."""

MOST_ENTRIES = 60
"""FRFs that are offered to look at."""

MOST_POLES = 200
"""Poles of one choice."""

Pole = tuple[float, float]
"""Natural frequency in Hz, and damping ratio."""


@dataclass(frozen=True)
class PickSession:
    """An FRF, and the automatic fit from which somebody starts to pick.

    Parameters
    ----------
    name
        Name of the FRF's file.
    frf
        FRF to fit.
    automatic
        Automatic fit of it, with its stabilisation chart.
    max_order
        Highest model order, as it was asked for.
    """

    name: str
    frf: Frf
    automatic: ModalFit
    max_order: int | None = None

    @property
    def band(self) -> Band:
        """Lowest and highest frequency of the fit, Hz."""
        return self.automatic.band

    @property
    def groups(self) -> tuple[CandidateGroup, ...]:
        """Poles that are offered."""
        return candidate_groups(self.automatic)


def chosen_at_first(session: PickSession) -> list[Pole]:
    """Poles of the automatic fit."""
    return [(one.frequency, one.damping_ratio) for one in session.groups if one.taken]


def drawn_page(session: PickSession) -> str:
    """Chart, FRFs and offered poles, as JSON for the page.

    Parameters
    ----------
    session
        FRF and automatic fit.
    """
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
            "groups": [_told(one) for one in session.groups],
            "chosen": chosen_at_first(session),
        }
    )


def fitted_answer(session: PickSession, asked: object) -> dict[str, Any]:
    """Fit a choice and give what the page draws of it: the synthesis of one entry, and how far all are off.

    Parameters
    ----------
    session
        FRF and automatic fit.
    asked
        ``poles`` (pairs of frequency in Hz and damping ratio) and ``entry`` (number of an FRF), as a page sent them.

    Returns
    -------
    dict
        ``fitted`` (columns of the curve as base64), ``misfit`` (per cent) of that entry and of all, ``warnings``; or
        ``error``, one line.
    """
    try:
        poles, entry = checked_choice(asked, len(_shown(session)))
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


def checked_choice(asked: object, n_entries: int) -> tuple[list[Pole], int]:
    """Poles and number of an entry out of what a page sent.

    Raises
    ------
    InputError
        Anything else than that.
    """
    if not isinstance(asked, dict) or not isinstance(asked.get("poles"), list):
        raise InputError("the page sent no list of poles; reload it")
    entry, poles = asked.get("entry", 0), asked["poles"]
    if type(entry) is not int or not 0 <= entry < n_entries:
        raise InputError(f"there is no FRF number {entry!r}; there are {n_entries}")
    if not 0 < len(poles) <= MOST_POLES:
        raise InputError(f"{len(poles)} poles are chosen; choose 1 to {MOST_POLES}")
    return [_pole(number, one) for number, one in enumerate(poles, start=1)], entry


def _pole(number: int, one: object) -> Pole:
    pair: list[Any] = one if isinstance(one, list) and len(one) == 2 else [None, None]
    if not all(isinstance(value, int | float) and not isinstance(value, bool) and np.isfinite(value) for value in pair):
        raise InputError(f"pole {number} is {one!r}; give a frequency in Hz and a damping ratio")
    frequency, damping = float(pair[0]), float(pair[1])
    if not (frequency > 0 and 0 < damping < 0.5):
        raise InputError(
            f"pole {number}: {frequency:g} Hz with damping {100 * damping:g} %; give a frequency above 0 and a damping "
            "above 0 and below 50 %"
        )
    return frequency, damping


def as_poles(chosen: Sequence[Pole]) -> NDArray[np.complex128]:
    """Poles in rad/s of frequencies and damping ratios.

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
    """Entries to look at: all, or those that the automatic fit meets worst."""
    every = [(p, q) for q in range(len(session.frf.excitations)) for p in range(len(session.frf.responses))]
    if len(every) <= MOST_ENTRIES:
        return every
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
    """A model's entry, in the quantity and under the exponential window of the measured one."""
    tau = session.frf.exponential_time_constant
    s = np.asarray(2j * np.pi * _grid(session) + (0.0 if tau is None else 1 / tau), dtype=np.complex128)
    made = np.asarray(model.at(s)[:, p, q])
    order = {"receptance": 0, "mobility": 1, "accelerance": 2}
    same = model.quantity == session.frf.quantity or session.frf.quantity not in order
    return made if same else made * s ** (order[session.frf.quantity] - order[model.quantity])


def _chart_poles(session: PickSession) -> list[list[float]]:
    """Frequency (Hz), damping ratio and order of every pole of the chart that can be picked."""
    chart = session.automatic.chart
    zeta = chart.damping_ratios
    good = (zeta > 0) & (zeta < 0.5) & (chart.frequencies >= session.band[0]) & (chart.frequencies <= session.band[1])
    table = np.column_stack([chart.frequencies, zeta, chart.orders])[good]
    return [[round(float(f), 6), round(float(z), 8), float(order)] for f, z, order in table]


def _told(group: CandidateGroup) -> dict[str, Any]:
    return {
        "group": group.number,
        "frequency_hz": group.frequency,
        "damping_ratio": group.damping_ratio,
        "n_orders": group.n_orders,
        "taken": group.taken,
        "reason": group.reason,
    }


def _packed(column: NDArray[np.float64]) -> str:
    return base64.b64encode(np.asarray(column, "<f4").tobytes()).decode("ascii")
