"""The series `devices` of a recording: what happened to auxiliary devices, and when."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .events import EventAxis, Events

DEVICES = "devices"
"""Name of the series."""

DEVICES_AXIS = EventAxis("host", texts=True)
"""Its times are those of the host's monotonic clock."""

LOST, BACK, NOTE, FAULT, CLEARED = 0.0, 1.0, 2.0, 3.0, 4.0
"""Values of the series: a device was lost, it is back; something was noticed; an input is at fault (an overload, an
open loop), it is well again."""


def device_event(time: float, value: float, text: str, series: str = DEVICES) -> Events:
    """One line of the log at a host's time (s), with its text."""
    return Events(series, np.array([time]), np.array([value]), None, (text,))


@dataclass(frozen=True)
class DeviceStory:
    """What happened to auxiliary devices during a recording, one sentence each.

    Parameters
    ----------
    losses
        Devices that were lost and inputs that were at fault, with time and reason, and when it was over.
    notices
        Whatever else was noticed: a clock that was set, packets that were lost.
    """

    losses: tuple[str, ...] = ()
    notices: tuple[str, ...] = ()


def device_story(times: NDArray[np.float64], values: NDArray[np.float64], texts: Sequence[str]) -> DeviceStory:
    """Tell the log in sentences.

    Parameters
    ----------
    times : (n,), s
        Times of the log's lines, on any one axis.
    values : (n,)
        `LOST`, `BACK`, `NOTE`, `FAULT` or `CLEARED`.
    texts
        Text of each line, which begins with the device and a colon.

    Examples
    --------
    >>> log = ("CAN bus can0: lost (silent)", "CAN bus can0: back")
    >>> device_story(np.array([2.0, 5.5]), np.array([LOST, BACK]), log).losses
    ('CAN bus can0: lost (silent) at 2.00 s, back after 3.50 s',)
    """
    standing: dict[str, tuple[float, int]] = {}
    losses: list[str] = []
    notices: list[str] = []
    for time, value, text in zip(times, values, texts, strict=True):
        subject = text.split(": lost")[0].split(": back")[0]
        if value in (LOST, FAULT):
            standing[subject] = (float(time), len(losses))
            losses.append(f"{text} at {time:.2f} s")
        elif value in (BACK, CLEARED):
            begun, line = standing.pop(subject, (float(time), -1))
            if line >= 0:
                losses[line] += f", {'back' if value == BACK else 'over'} after {time - begun:.2f} s"
        else:
            notices.append(f"{text} ({time:.2f} s)")
    for _, line in standing.values():
        losses[line] += ", until the end" if ": lost" not in losses[line] else ", not back until the end"
    return DeviceStory(tuple(losses), tuple(notices))
