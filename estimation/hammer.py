"""Hammer tests: find the taps, refuse double hits, window force and response, correct the added damping."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

Real = NDArray[np.float64]
_TAP = 0.2  # of the largest force in the record: a tap
_AGAIN = 0.05  # of a tap's peak: contact
_SECOND = 0.1  # of a tap's peak: a second hit


@dataclass(frozen=True)
class Tap:
    """One tap of the hammer.

    Parameters
    ----------
    time
        Of its peak, s from the record's start.
    peak
        Largest force, with its sign.
    contact
        Duration of the first contact, s.
    second_hit
        Delay of a second contact, s, or None: such a tap must be left out, its force has holes in the spectrum.
    second_share
        Peak of the second contact over the first; 0 without one.
    """

    time: float
    peak: float
    contact: float
    second_hit: float | None
    second_share: float


def find_taps(force: Real, sample_rate: float, *, settle: float = 0.2) -> tuple[Tap, ...]:
    """Find taps and their double hits in a force signal.

    A tap is where the force passes a fifth of its largest magnitude after ``settle`` seconds without. Contacts are
    stretches above a twentieth of the tap's peak; a second one within ``settle`` that reaches a tenth of the peak
    is a double hit.

    Parameters
    ----------
    force : (n_samples,), N
    sample_rate
        Hz.
    settle
        Shortest time between taps, s.

    Raises
    ------
    InputError
        A force that is not one-dimensional, or without any signal.

    Examples
    --------
    >>> force = np.zeros(1000)
    >>> force[100:105] = [20, 80, 100, 80, 20]
    >>> force[130:133] = [10, 20, 10]
    >>> [tap] = find_taps(force, 10_000.0)
    >>> tap.peak, round(tap.second_hit, 4), tap.second_share
    (100.0, 0.0029, 0.2)
    """
    signal = np.asarray(force, dtype=float)
    if signal.ndim != 1:
        raise InputError(f"force of shape {signal.shape}: give one channel")
    signal = signal - np.median(signal)
    size = np.abs(signal)
    if not size.any():
        raise InputError("the force signal is constant; check the hammer's channel")
    gap = max(1, round(settle * sample_rate))
    above = np.flatnonzero(size > _TAP * size.max())
    first = above[np.concatenate([[True], np.diff(above) > gap])]
    return tuple(_tap(signal, size, int(start), gap, sample_rate) for start in first)


def _tap(signal: Real, size: Real, start: int, gap: int, sample_rate: float) -> Tap:
    low = max(0, start - gap // 4)
    part = size[low : start + gap]
    top = int(np.argmax(part))
    touching = np.concatenate([[False], part > _AGAIN * part[top], [False]])
    edges = np.flatnonzero(np.diff(touching.astype(int)))
    contacts = [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    main = next((a, b) for a, b in contacts if a <= top < b)
    others = [(float(part[a:b].max()), a + int(np.argmax(part[a:b]))) for a, b in contacts if (a, b) != main]
    others = [(peak, where) for peak, where in others if peak > _SECOND * part[top]]
    second = max(others, default=None)
    return Tap(
        (low + top) / sample_rate,
        float(signal[low + top]),
        (main[1] - main[0]) / sample_rate,
        None if second is None else abs(second[1] - top) / sample_rate,
        0.0 if second is None else second[0] / float(part[top]),
    )


def force_window(n_samples: int, sample_rate: float, duration: float) -> Real:
    """1 over the contact, then a cosine fall over a quarter of ``duration`` (s), then 0, shape (n_samples,)."""
    time = np.arange(n_samples) / sample_rate
    fall = np.clip((time - duration) / (0.25 * duration), 0.0, 1.0)
    return np.asarray(0.5 * (1 + np.cos(np.pi * fall)))


def exponential_window(n_samples: int, sample_rate: float, time_constant: float) -> Real:
    """``exp(-t / tau)`` for a response that has not died out at the segment's end, shape (n_samples,).

    Apply it to force and response alike; it moves every pole by ``-1/tau``, which :func:`without_added_damping` takes
    back.

    Raises
    ------
    InputError
        A time constant that is not positive.
    """
    if not time_constant > 0:
        raise InputError(f"time constant {time_constant:g} s must be positive")
    return np.asarray(np.exp(-np.arange(n_samples) / (sample_rate * time_constant)))


def without_added_damping(poles: NDArray[np.complex128], time_constant: float) -> NDArray[np.complex128]:
    """Poles (rad/s) fitted to exponentially windowed data, freed of the window: ``s + 1/tau`` (Ewins, section 3.7).

    Examples
    --------
    >>> without_added_damping(np.array([-3 + 100j]), 0.5)
    array([-1.+100.j])
    """
    return np.asarray(poles + 1 / time_constant)
