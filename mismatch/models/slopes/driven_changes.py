"""What changes of the modes' numbers do to a joint's driven deflection: few signals, and how they are mixed."""

import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel

from ..lines import driven_basis
from ..model_shape import ModelShape

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


def driven_signals(
    shape: ModelShape, model: ModalModel, frequencies: Real, forces: tuple[Complex, Complex], along: Real
) -> Complex:
    """Spectra (n, n_signals) whose real combinations are all changes of a deflection by u.

    A mode of n responses and m excitations has ``2 + 2 n + 2 m`` numbers, and ``2 + 2 m`` signals; the terms that
    stand for modes outside the band have m signals each. The joint's own force moves it through the modes alone, as in
    the free simulation, and so these terms see the outer force alone.

    Parameters
    ----------
    shape
        What u stands for.
    model
        The modal model at which the derivative is taken, or one widened by joints.
    frequencies : (n,), Hz
        Frequencies of the lines.
    forces
        Force spectra at the lines, each (n, n_excitations), N: what the modes feel, and that without the joint's own.
    along : (n_responses,)
        The combination of responses that is the deflection.
    """
    force, outer = forces
    s = np.asarray(2j * np.pi * frequencies, dtype=complex)
    m = shape.nominal.left.shape[1]
    signals = np.empty((len(s), len(model.poles) * (2 + 2 * m)), dtype=complex)
    driven_basis(s, np.ascontiguousarray(force), (model.poles, model.left, model.right @ along), m, signals)
    if shape.outside is None:
        return signals
    basis = shape.outside.basis(s)
    return np.concatenate([signals, *(one[:, None] * outer[:, :m] for one in basis)], axis=1)


def driven_mix(shape: ModelShape, model: ModalModel, along: Real) -> Real:
    """How the signals of :func:`driven_signals` make up the changes by u, (n_signals, size)."""
    n, m = shape.nominal.right.shape[1], shape.nominal.left.shape[1]
    each, per = 2 + 2 * m, 2 + 2 * n + 2 * m
    poles = shape.pole_units(model)
    units = shape.scales()
    ahead = model.right @ along
    mix = np.zeros((len(model.poles) * each, len(model.poles) * per))
    for r in range(len(model.poles)):
        own = mix[r * each : (r + 1) * each, r * per : (r + 1) * per]
        own[:2, :2] = [[unit[r].real for unit in poles], [unit[r].imag for unit in poles]]
        even, odd = np.arange(2, 2 + m), np.arange(2 + m, each)
        left, rho = model.left[r, :m], ahead[r]
        for p in range(n):
            share = units[0][r] * along[p]
            own[even, 2 + p], own[odd, 2 + p] = share * left.real, share * left.imag
            own[even, 2 + n + p], own[odd, 2 + n + p] = -share * left.imag, share * left.real
        first = 2 + 2 * n + np.arange(m)
        own[even, first], own[odd, first] = units[1][r] * rho.real, units[1][r] * rho.imag
        own[even, first + m], own[odd, first + m] = -units[1][r] * rho.imag, units[1][r] * rho.real
    if shape.outside is None:
        return mix
    terms = shape.outside.units * along[:n, None]
    beyond = np.zeros((len(terms) * m, shape.size - mix.shape[1]))
    for t, q in np.ndindex(len(terms), m):
        beyond[t * m + q, (t * n + np.arange(n)) * m + q] = terms[t, :, q]
    whole = np.zeros((len(mix) + len(beyond), shape.size))
    whole[: len(mix), : mix.shape[1]] = mix
    whole[len(mix) :, mix.shape[1] :] = beyond
    return whole
