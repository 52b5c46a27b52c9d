"""How the signals that drive a joint make up what changes of the modes' numbers do to it."""

import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel

from ..model_shape import ModelShape

Real = NDArray[np.float64]


def driven_mix(shape: ModelShape, model: ModalModel, along: Real) -> Real:
    """How signals make up the changes of a deflection by u, (n_signals, size).

    The signals are, for each mode, the two of its pole and 2 m of its shapes, as
    :func:`mismatch.models.lines.driven_basis` writes them; behind those of all modes, the forces through each of the
    terms that stand for modes outside the band.
    """
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
