"""How recordings of hammer tests are turned into an FRF."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from millfrf.core import Band, InputError

AUTO, NONE = "auto", "none"


@dataclass(frozen=True)
class TapOptions:
    """How recordings of hammer tests are turned into an FRF.

    Parameters
    ----------
    segment
        Duration of a segment, s; None: the time between the taps.
    pre_trigger
        Time before a tap's peak, s; None: twice the longest contact.
    force_window
        ``auto`` (twice the longest contact after the peak), ``none``, or the time after the peak in s.
    exponential
        ``auto`` (where an answer has not died out), ``none``, or the time constant in s.
    point
        Point hit in all recordings, ``node:direction``; empty: as the files say.
    points
        Table that says which point was hit in which file; None: as the files say.
    excitations, responses
        Channel names; empty: chosen by quantity.
    band
        Lines to keep, Hz; None: all that are driven.
    stream
        Sample clock; None: the only one.

    Raises
    ------
    InputError
        A point and a table of points at once, or a window that is none of those.
    """

    segment: float | None = None
    pre_trigger: float | None = None
    force_window: str = AUTO
    exponential: str = AUTO
    point: str = ""
    points: Path | None = None
    excitations: tuple[str, ...] = ()
    responses: tuple[str, ...] = ()
    band: Band | None = None
    stream: str | None = None

    def __post_init__(self) -> None:
        if self.point and self.points is not None:
            raise InputError(f"both --point {self.point} and --points {self.points} are given; give one of them")
        self.force_window_seconds  # noqa: B018 - refused here and not after the taps were found
        self.time_constant  # noqa: B018

    @property
    def force_window_seconds(self) -> float | None:
        """Time after the peak, s; 0: no force window; None: chosen."""
        return _seconds("--force-window", self.force_window)

    @property
    def time_constant(self) -> float | None:
        """Time constant of the exponential window, s; 0: no such window; None: it is chosen."""
        return _seconds("--exponential", self.exponential)


def _seconds(option: str, text: str) -> float | None:
    if text in (AUTO, NONE):
        return None if text == AUTO else 0.0
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not (np.isfinite(value) and value > 0):
        raise InputError(f"{option} {text} is not understood; give auto, none or a time in s above 0")
    return value
