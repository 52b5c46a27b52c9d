"""Derivatives of the lines of a ringing recording by the modes' numbers and by the first motion.

Such lines leak: a derivative is computed over the whole padded recording, then cut and windowed like the measurement.
The derivatives by all numbers of a mode are combinations of few real signals (:func:`.modal_lines.driven_basis`), so
that these are transformed and not every derivative of every response.
"""

import numpy as np
from numpy.typing import NDArray

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real
from modal_fit import ModalModel

from .hypothesis import start_pulse
from .modal_lines import driven_basis
from .model_shape import ModelShape


def decay_lines(model: ModalModel, lines: WindowedSpectrum, ringing: NDArray[np.int64]) -> Complex:
    """Return the windowed free decays of modes, (n_lines, n_responses, 2 n_ringing).

    They begin with a modal coordinate of 1 in each of the modes ``ringing``, and then of i.
    """
    s = np.asarray(2j * np.pi * lines.padded_frequencies, dtype=complex)
    pulse = (start_pulse(lines) * np.exp(-s * model.delay))[:, None]
    up, down = pulse / (s[:, None] - model.poles[ringing]), pulse / (s[:, None] - model.poles[ringing].conj())
    signals = np.hstack([up + down, 1j * (up - down)])
    decays = np.empty((*lines.measured.shape, 2 * len(ringing)), dtype=complex)
    for responses, cut in _cut_by_quantity(signals, lines):
        even, odd = cut[:, None, : len(ringing)], cut[:, None, len(ringing) :]
        vectors = model.right[ringing][:, responses].T
        decays[:, responses, : len(ringing)] = vectors.real * even + vectors.imag * odd
        decays[:, responses, len(ringing) :] = vectors.real * odd - vectors.imag * even
    return decays


def write_modal_changes(
    shape: ModelShape, model: ModalModel, force: Complex, lines: WindowedSpectrum, out: Real
) -> None:
    """Write the derivative of the windowed lines by u.

    Parameters
    ----------
    model
        Modal model with all excitations, including those of joints and of the first motion.
    force : (n_padded_lines, n_excitations), N
        Total force on these excitations.
    out : (2, n_lines, n_responses, shape.size or more)
        Receives real and imaginary parts.
    """
    s = np.asarray(2j * np.pi * lines.padded_frequencies, dtype=complex)
    modes, m = len(model.poles), force.shape[1]
    signals = np.empty((len(s), modes * (2 + 2 * m)), dtype=complex)
    driven_basis(s, np.ascontiguousarray(force), (model.poles, model.left, np.ones(modes, dtype=complex)), m, signals)
    of_modes, of_terms = slice(0, signals.shape[1]), slice(signals.shape[1], None)
    if shape.outside is not None:
        fitted = force[:, : shape.nominal.left.shape[1]]
        signals = np.hstack([signals, *(function[:, None] * fitted for function in shape.outside.basis(s))])
    for responses, cut in _cut_by_quantity(signals, lines):
        for side, strided in zip(out, (cut.real, cut.imag), strict=True):
            part = np.ascontiguousarray(strided)  # BLAS multiplies no real part of a complex array
            for response in responses:
                _write_modes(shape, model, part[:, of_modes], int(response), side[:, response])
                if shape.outside is not None:
                    _write_terms(shape, shape.outside.units, part[:, of_terms], int(response), side[:, response])


def _write_modes(shape: ModelShape, model: ModalModel, signals: Real, response: int, out: Real) -> None:
    """Write the derivative of a response by the numbers of the modes into the first columns of ``out``."""
    width, per_mode = signals.shape[1] // len(model.poles), shape.per_mode
    for mode in range(len(model.poles)):
        own = signals[:, mode * width : (mode + 1) * width]
        out[:, mode * per_mode : (mode + 1) * per_mode] = own @ _mode_mix(shape, model, mode, response)


def _write_terms(shape: ModelShape, units: Real, signals: Real, response: int, out: Real) -> None:
    """Write the derivative of a response by the numbers of modes outside the band, of ``units`` (n_terms, n, m)."""
    n_terms, n, m = units.shape
    terms = out[:, shape.modal_size : shape.size]
    terms[:] = 0.0
    for t in range(n_terms):
        first = (t * n + response) * m
        terms[:, first : first + m] = units[t, response] * signals[:, t * m : (t + 1) * m]


def _mode_mix(shape: ModelShape, model: ModalModel, mode: int, response: int) -> Real:
    """Return the matrix (2 + 2 n_forces, per_mode) from the signals of a mode to the derivative of a response."""
    n, m = shape.nominal.right.shape[1], shape.nominal.left.shape[1]
    count = model.left.shape[1]
    vector, left = model.right[mode, response], model.left[mode]
    right_unit, left_unit = (units[mode] for units in shape.scales())
    mix = np.zeros((2 + 2 * count, shape.per_mode))
    for column, unit in enumerate(shape.pole_units(model)):
        change = unit[mode] * vector
        mix[:2, column] = change.real, change.imag
    even, odd = mix[2 : 2 + count], mix[2 + count :]
    own = 2 + response
    even[:, own], odd[:, own] = right_unit * left.real, right_unit * left.imag
    even[:, own + n], odd[:, own + n] = -right_unit * left.imag, right_unit * left.real
    for q in range(m):
        own = 2 + 2 * n + q
        even[q, own], odd[q, own] = left_unit * vector.real, left_unit * vector.imag
        even[q, own + m], odd[q, own + m] = -left_unit * vector.imag, left_unit * vector.real
    return mix


def _cut_by_quantity(signals: Complex, lines: WindowedSpectrum) -> list[tuple[NDArray[np.int64], Complex]]:
    """Return responses that measure one quantity, and the windowed lines of padded spectra as this quantity."""
    kinematic = lines.padded_kinematic
    first_alike = [
        next(first for first in range(p + 1) if np.array_equal(kinematic[:, first], kinematic[:, p]))
        for p in range(kinematic.shape[1])
    ]
    groups = [np.flatnonzero(np.array(first_alike) == first) for first in sorted(set(first_alike))]
    return [(group, lines.cut(lines.signal(signals * kinematic[:, group[:1]]))) for group in groups]
