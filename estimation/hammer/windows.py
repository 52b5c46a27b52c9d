"""Windows of a tap: the force is cut off after the contact, both signals may fall exponentially."""

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

Real = NDArray[np.float64]


def force_window(n_samples: int, sample_rate: float, duration: float) -> Real:
    """1 over the contact, then a cosine fall over a quarter of ``duration`` (s), then 0, shape (n_samples,)."""
    time = np.arange(n_samples) / sample_rate
    fall = np.clip((time - duration) / (0.25 * duration), 0.0, 1.0)
    return np.asarray(0.5 * (1 + np.cos(np.pi * fall)))


def exponential_window(n_samples: int, sample_rate: float, time_constant: float) -> Real:
    """``exp(-t / tau)`` for a response that has not died out at the segment's end, shape (n_samples,).

    Apply it to force and response alike. The transform of ``h(t) exp(-t / tau)`` is ``H(i w + 1/tau)``: the FRF is
    exact, at another place of the Laplace plane, where every pole seems to lie ``1/tau`` further to the left. Nothing
    that is done to the values line by line brings them back to ``i w``: that would be to undo the window, with the
    truncation it was there to prevent. So an FRF carries the time constant
    (``exponential_time_constant``), and the fit, which knows the poles, takes ``1/tau`` from their
    damping (:func:`without_added_damping`).

    Raises
    ------
    InputError
        A time constant that is not positive.
    """
    if not time_constant > 0:
        raise InputError(f"time constant {time_constant:g} s must be positive; leave it out for no window")
    return np.asarray(np.exp(-np.arange(n_samples) / (sample_rate * time_constant)))


def window_correlation(apart: Real, time_constant: float) -> NDArray[np.complex128]:
    """Correlation that the window gives to white noise on lines ``apart`` (Hz): ``1 / (1 + i pi apart tau)``.

    It is the transform of ``exp(-2 t / tau)`` over its value at 0 Hz, for segments of several tau. The variance on each
    line is right without it; a fit that takes lines as independent gives error bars that are too small, since the
    noise is as large as ever where the answer is, at the segment's beginning. A pole with damping ``sigma`` (rad/s),
    fitted on lines ``df`` apart, has ``2 / (tau df) ((sigma + a) / (sigma + 2 a))^3`` times that variance, a = 1/tau.

    Examples
    --------
    >>> bool(abs(window_correlation(np.array([2.0]), 0.1))[0] > 0.8)
    True
    """
    return np.asarray(1 / (1 + 1j * np.pi * np.asarray(apart) * time_constant))


def without_added_damping(poles: NDArray[np.complex128], time_constant: float) -> NDArray[np.complex128]:
    """Poles (rad/s) fitted to exponentially windowed data, freed of the window: ``s + 1/tau`` (Ewins, section 3.7).

    Examples
    --------
    >>> without_added_damping(np.array([-3 + 100j]), 0.5)
    array([-1.+100.j])
    """
    return np.asarray(poles + 1 / time_constant)
