"""Judge an answer against the truth: modes matched one to one, missed, invented; errors, and error bars that hold.

A found mode may stand for a true one where their frequencies differ by 0.5 % or by half a half-power bandwidth
(``zeta f``), whichever is more. Of all one-to-one assignments the one is taken that matches the most demanded modes,
then the most others, then has the smallest distance between poles. A true mode that is not demanded (below the noise or
out of band) is not missed where it is not found, nor invented where it is.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from .problem import Answer, FoundMode

LEAST_TOLERANCE = 0.005


@dataclass(frozen=True)
class Match:
    """A demanded mode that was found.

    Parameters
    ----------
    frequency, damping
        Relative errors, signed.
    frequency_ratio, damping_ratio
        Errors over their stated standard errors, or None where none is stated.
    assurance
        Modal assurance (MAC) of the vectors over the responses, or None.
    """

    frequency: float
    damping: float
    frequency_ratio: float | None
    damping_ratio: float | None
    assurance: float | None
    in_pair: bool


@dataclass(frozen=True)
class Score:
    """One case.

    Parameters
    ----------
    missed
        Demanded modes that were not found.
    invented
        Found modes that stand for no true one.
    by_hand
        Demanded modes that stand among the candidates, for a user who knows which to pick; None: nobody picks.
    """

    truth: dict[str, Any]
    answer: Answer
    matches: tuple[Match, ...]
    missed: tuple[dict[str, Any], ...]
    invented: tuple[FoundMode, ...]
    by_hand: int | None

    @property
    def demanded(self) -> int:
        """Number of modes that were asked for."""
        return len(self.matches) + len(self.missed)


def score(truth: dict[str, Any], answer: Answer) -> Score:
    """Judge one answer."""
    modes, result = truth["modes"], answer.modes
    pairs = _assign(modes, result)
    demanded = [k for k, mode in enumerate(modes) if mode["demanded"]]
    matches = tuple(_match(modes[k], result[pairs[k]]) for k in demanded if k in pairs)
    missed = tuple(modes[k] for k in demanded if k not in pairs)
    used = set(pairs.values())
    invented = tuple(mode for number, mode in enumerate(result) if number not in used)
    picked = set(_assign(modes, answer.candidates)) & set(demanded)
    return Score(truth, answer, matches, missed, invented, len(picked) if answer.candidates else None)


def partners(one: Score) -> dict[int, FoundMode]:
    """Number of each true mode that was found, and the mode that stands for it."""
    result = _assign(one.truth["modes"], one.answer.modes)
    return {number: one.answer.modes[k] for number, k in result.items()}


def _assign(modes: list[dict[str, Any]], found: tuple[FoundMode, ...]) -> dict[int, int]:
    """Number of the true mode to number of the found one."""
    if not modes or not found:
        return {}
    f, zeta = _columns(modes), np.array([[m.frequency_hz, m.damping_ratio] for m in found]).T
    reach = np.maximum(LEAST_TOLERANCE, f[1]) * f[0]
    reach = np.maximum(reach, [mode.get("uncertain_hz", 0.0) for mode in modes])
    near = np.abs(f[0][:, None] - zeta[0]) <= reach[:, None]
    apart = np.abs(_poles(*f)[:, None] - _poles(*zeta)) / reach[:, None]
    worth = np.where([mode["demanded"] for mode in modes], 1e6, 1e3)[:, None]
    gain = np.where(near, worth - np.minimum(apart, 100.0), 0.0)
    rows, columns = linear_sum_assignment(-gain)
    return {int(row): int(column) for row, column in zip(rows, columns, strict=True) if near[row, column]}


def _columns(modes: list[dict[str, Any]]) -> NDArray[np.float64]:
    """Frequencies and dampings; a damping that is not known counts as none."""
    return np.array([[m["frequency_hz"], m.get("damping_ratio") or 0.0] for m in modes]).T


def _poles(frequency: NDArray[np.float64], zeta: NDArray[np.float64]) -> NDArray[np.complex128]:
    """In Hz; far-off dampings are cut to what a pole can have."""
    zeta = np.clip(zeta, -0.99, 0.99)
    return np.asarray(frequency * (-zeta + 1j * np.sqrt(1 - zeta**2)))


def _match(mode: dict[str, Any], found: FoundMode) -> Match:
    true_f, true_zeta = mode["frequency_hz"], mode.get("damping_ratio")
    off = found.damping_ratio - true_zeta if true_zeta else float("nan")
    return Match(
        found.frequency_hz / true_f - 1,
        off / true_zeta if true_zeta else float("nan"),
        _ratio(found.frequency_hz - true_f, found.frequency_error),
        _ratio(off, found.damping_error) if true_zeta else None,
        _assurance(mode.get("shape"), found.shape),
        bool(mode.get("in_pair", False)),
    )


def _ratio(error: float, standard_error: float | None) -> float | None:
    """None where no error bar is stated; infinite where it has no width."""
    if standard_error is None or not np.isfinite(standard_error):
        return None
    return abs(error) / standard_error if standard_error > 0 else float("inf")


def _assurance(true: Any, found: Any) -> float | None:
    if true is None or found is None or len(true) != len(found):
        return None
    a, b = (np.array(shape) @ np.array([1, 1j]) for shape in (true, found))
    size = np.vdot(a, a).real * np.vdot(b, b).real
    return float(abs(np.vdot(a, b)) ** 2 / size) if size > 0 else None
