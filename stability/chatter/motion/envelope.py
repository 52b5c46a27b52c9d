"""How lines that belong together vary in time, all of them taken as one."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .families import Family
from .lines import Line, Spectrum
from .orders import Revolutions

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

_PASSES = 8  # tooth periods a value
_BEGIN = 8  # share of the recording, one over this, in which the entry may still die out


@dataclass(frozen=True)
class Envelope:
    """Size and phase, over time, of lines that belong together.

    Parameters
    ----------
    fluctuation
        Standard deviation of the power over its mean: 1 for noise through a mode, whose envelope is normally
        distributed, small for a limit cycle.
    coherence
        Coherence, 0 to 1, of the strongest line with all others together: side lines that the teeth make vary with it;
        a foreign tone among lines of noise has no such side lines.
    """

    fluctuation: float
    coherence: float


def envelope_of(revolutions: Revolutions, family: Family, spectrum: Spectrum) -> Envelope:
    """Demodulate the lines of a family, each channel over its noise floor, and take what they share.

    The teeth make of one motion ``a(t) exp(i w t)`` lines at ``+-w + k w_tooth``, all with the same a(t), or its
    conjugate for those mirrored. The first singular vector of all lines and channels is a(t) at the best ratio of
    signal to noise (Golub & Van Loan, Matrix Computations, section 2.4).

    Parameters
    ----------
    revolutions
        The whole recording, cut into revolutions.
    family
        Family of two lines or more.
    spectrum
        Spectrum of the residual, with its noise floor.
    """
    teeth = revolutions.teeth
    power = np.array([float((line.amplitude**2).sum()) for line in family.lines])
    places = np.array([abs(_signed(line.order, teeth)) for line in family.lines])
    place = float(np.average(places, weights=power))
    rest = revolutions.residual
    columns = [_demodulated(rest, revolutions, line, place, spectrum) for line in family.lines]
    columns = [column[len(column) // _BEGIN :] for column in columns]
    strongest, others = _shared(columns[0]), _shared(np.concatenate(columns[1:], axis=1))
    size = np.abs(_shared(np.concatenate(columns, axis=1))) ** 2
    alike = abs(np.vdot(strongest, others)) ** 2 / max(
        float(np.sum(np.abs(strongest) ** 2) * np.sum(np.abs(others) ** 2)), 1e-300
    )
    return Envelope(float(size.std() / max(size.mean(), 1e-300)), float(alike))


def _signed(order: float, teeth: int) -> float:
    """Distance from the nearest multiple of the number of teeth, with its sign."""
    return (order + teeth / 2) % teeth - teeth / 2


def _demodulated(rest: Real, revolutions: Revolutions, line: Line, place: float, spectrum: Spectrum) -> Complex:
    """The line over time, (n_values, n_channels), conjugated where it is mirrored, over the noise at its frequency."""
    teeth, n_places = revolutions.teeth, revolutions.samples.shape[1]
    away = _signed(line.order, teeth)
    sign = 1.0 if away >= 0 else -1.0
    order = round((line.order - away) / teeth) * teeth + sign * place
    length = _PASSES * n_places // teeth
    count = len(rest) // length
    wave = np.exp(-2j * np.pi * order * np.arange(count * length) / n_places)
    window = np.hanning(length + 2)[1:-1]
    parts = (rest[: count * length] * wave[:, None]).reshape(count, length, -1)
    values = np.einsum("ktc,t->kc", parts, window) / window.sum()
    floor = spectrum.floor[min(round(line.order / spectrum.resolution), len(spectrum.floor) - 1)]
    return np.asarray((values if sign > 0 else values.conj()) / np.sqrt(floor))


def _shared(columns: Complex) -> Complex:
    left, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, 0] * sizes[0])
