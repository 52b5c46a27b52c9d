"""Complex values and frequencies in Hz from the parts that a file holds them in."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from .frf_mapping import FrfTable

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

_TO_HZ = {"Hz": 1.0, "kHz": 1e3, "rad/s": 1 / (2 * np.pi)}
_SPOKEN_PHASES = {"deg": "deg", "degree": "deg", "degrees": "deg", "°": "deg", "rad": "rad", "radian": "rad"}
_DECIBEL = 20.0


def complex_values(parts: Mapping[str, NDArray[np.generic]], table: FrfTable, where: str) -> Complex:
    """The FRF's numbers, in the file's unit, for ``exp(+i w t)``.

    Parameters
    ----------
    parts
        Arrays of one shape: ``values``, or ``real`` and ``imaginary``, or ``magnitude`` and ``phase``.
    table
        Unit of the phase, decibels, sign convention.
    where
        File, for messages.

    Raises
    ------
    InputError
        No part, shapes that differ, or a phase whose unit is not said.
    """
    shapes = {name: array.shape for name, array in parts.items()}
    if len(set(shapes.values())) > 1:
        said = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise InputError(f"{where}: parts of the FRF have different shapes ({said}); name parts that belong together")
    if "values" in parts:
        values = np.asarray(parts["values"], dtype=np.complex128)
    elif "real" in parts:
        values = np.asarray(parts["real"], dtype=float) + 1j * np.asarray(parts["imaginary"], dtype=float)
    else:
        values = _polar(np.asarray(parts["magnitude"], float), np.asarray(parts["phase"], float), table, where)
    return np.asarray(values.conj() if table.conjugate else values)


def _polar(magnitude: Real, phase: Real, table: FrfTable, where: str) -> Complex:
    if table.phase_unit is None:
        raise InputError(f'{where}: the unit of the phase is not said; write phase_unit = "deg" or "rad" under [frf]')
    size = 10 ** (magnitude / _DECIBEL) if table.decibels else magnitude
    if not table.decibels and (size < 0).any():
        raise InputError(f"{where}: a magnitude is {size.min():g}; if it is in dB, write decibels = true under [frf]")
    angle = np.radians(phase) if table.phase_unit == "deg" else phase
    return np.asarray(size * np.exp(1j * angle))


def hertz(frequencies: NDArray[np.generic], unit: str | None, where: str) -> Real:
    """Frequencies (n_frequencies,) in Hz.

    Raises
    ------
    InputError
        Complex numbers, or values that are not finite or do not increase.
    """
    if np.iscomplexobj(frequencies) and not np.imag(frequencies).any():
        frequencies = np.real(frequencies)  # MATLAB keeps a list of frequencies beside complex values as complex
    if np.iscomplexobj(frequencies):
        raise InputError(f"{where}: the frequencies are complex numbers; name the array or column of frequencies")
    f = np.asarray(frequencies, dtype=float).reshape(-1) * _TO_HZ[unit or "Hz"]
    if not len(f) or not np.isfinite(f).all():
        raise InputError(f"{where}: frequencies are missing or not finite; mend the file")
    if (np.diff(f) <= 0).any():
        line = int(np.argmax(np.diff(f) <= 0))
        raise InputError(
            f"{where}: frequencies do not increase ({f[line]:g} Hz is followed by {f[line + 1]:g} Hz); name the right "
            "column or array, or sort the lines"
        )
    return f


def stated_frequency_unit(text: str) -> str | None:
    """``Hz``, ``kHz`` or ``rad/s`` from a column's unit; None where it says none of them."""
    return next((unit for unit in _TO_HZ if text.strip().lower() == unit.lower()), None)


def stated_phase_unit(text: str) -> str | None:
    """``deg`` or ``rad`` from a column's unit; None where it says neither."""
    return _SPOKEN_PHASES.get(text.strip().lower()) or None
