"""Which true modes a fit can be asked for: those whose own part of the FRFs stands above the noise.

The part of a mode that nothing else can imitate is what is left of its contribution when, on the lines within six
half-power bandwidths, every FRF may change the residues of all other modes and a parabola freely, and the two nearest
modes may move in frequency and damping (the same for all FRFs). Its energy over the noise's variance, summed over lines
and FRFs, is on average 1 for each complex number by which one fits pure noise, and a mode of rank one has
``n_responses + n_excitations`` of them. A mode is demanded where

* that energy is at least 25 for each of these numbers, and
* its contribution peaks at three standard deviations of the noise or more in one FRF of ten (at least in one).

Other modes are neither demanded nor counted as invented.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .structure import Structure

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
ENERGY_PER_NUMBER = 25.0
PEAK_OVER_NOISE = 3.0
SHARE_OF_FRFS = 0.1
_REACH = 6.0  # bandwidths on either side
_NEIGHBOURS = 2
_FEWEST = 40  # lines


@dataclass(frozen=True)
class Visibility:
    """How far a mode stands above the noise.

    Parameters
    ----------
    energy
        Energy of its own part over the noise, for each complex number that a mode of rank one has.
    peak
        Contribution over noise (standard deviation) at the resonance that one FRF of ten reaches.
    """

    energy: float
    peak: float

    @property
    def demanded(self) -> bool:
        """Whether a fit is asked for this mode."""
        return self.energy >= ENERGY_PER_NUMBER and self.peak >= PEAK_OVER_NOISE


def visibility(
    structure: Structure, mode: int, frequencies: Real, inside: NDArray[np.bool_], variance: Real, derivative: int
) -> Visibility:
    """Compute how far one mode stands above the noise on the band's lines.

    Parameters
    ----------
    frequencies : (n_lines,), Hz
        Frequencies of the lines.
    inside : (n_lines,), bool
        Whether a line lies in the band.
    variance : (n_lines, n_responses, n_excitations)
        Variance of the noise on the quantity that is ``derivative`` times differentiated.
    """
    lines = _window(frequencies, inside, structure.frequencies[mode], structure.bandwidths[mode])
    s, poles = 2j * np.pi * frequencies[lines], structure.poles
    others = [k for k in range(len(poles)) if k != mode]
    scale = (s / poles[mode]) ** derivative * poles[mode] ** derivative
    smooth = np.polynomial.polynomial.polyvander(np.linspace(-1, 1, len(s)), 2)
    local = np.column_stack([*(scale / (s - poles[k]) for k in others), smooth])
    nearest = sorted(others, key=lambda k: abs(poles[k] - poles[mode]))[:_NEIGHBOURS]
    moving = np.column_stack([scale / (s - poles[mode]), *(scale / (s - poles[k]) ** 2 for k in nearest)])
    sizes = np.stack([structure.residues(k).ravel() for k in (mode, *nearest)])
    noise = variance[lines].reshape(len(s), -1)
    flat = bool(np.all(noise == noise[0]))
    if flat:
        left = _residual(moving, local)
        gram = (left.conj().T @ left) * (sizes.conj() @ (sizes / noise[0]).T)
    else:
        gram = sum(
            _weighted_gram(moving * size, local, 1 / np.sqrt(v)) for size, v in zip(sizes.T, noise.T, strict=True)
        )
    energy = _left_over(np.asarray(gram))
    peak = np.abs(sizes[0] * (2j * np.pi * structure.frequencies[mode]) ** derivative) / abs(poles[mode].real)
    at = int(np.argmin(np.abs(frequencies[lines] - structure.frequencies[mode])))
    ratio = np.sort(peak / np.sqrt(noise[at]))[::-1]
    reached = max(1, round(SHARE_OF_FRFS * len(ratio)))
    numbers = structure.right.shape[1] + structure.left.shape[1]
    return Visibility(energy / numbers, float(ratio[reached - 1]))


def _window(frequencies: Real, inside: NDArray[np.bool_], centre: float, bandwidth: float) -> NDArray[np.int64]:
    """Lines of the band near the mode, at least :data:`_FEWEST`."""
    chosen = np.flatnonzero(inside)
    distance = np.abs(frequencies[chosen] - centre)
    near = chosen[distance <= _REACH * bandwidth]
    if len(near) < _FEWEST:
        near = np.sort(chosen[np.argsort(distance)[:_FEWEST]])
    return near


def _residual(columns: Complex, basis: Complex) -> Complex:
    """Part of the columns outside the span of the basis."""
    basis = basis / np.linalg.norm(basis, axis=0)
    left, sizes, _ = np.linalg.svd(basis, full_matrices=False)
    span = left[:, sizes > 1e-10 * sizes[0]]
    for _ in range(2):  # the second round takes what rounding left
        columns = columns - span @ (span.conj().T @ columns)
    return np.asarray(columns)


def _weighted_gram(columns: Complex, basis: Complex, weights: Real) -> Complex:
    left = _residual(columns * weights[:, None], basis * weights[:, None])
    return np.asarray(left.conj().T @ left)


def _left_over(gram: Complex) -> float:
    """Squared norm of the first vector outside the span of the others, from their products."""
    if len(gram) == 1:
        return float(gram[0, 0].real)
    size = np.sqrt(np.maximum(np.diag(gram).real, 1e-300))
    scaled = gram / np.outer(size, size)
    solved = np.linalg.lstsq(scaled[1:, 1:], scaled[1:, 0], rcond=1e-10)[0]
    return float(size[0] ** 2 * max(0.0, (scaled[0, 0] - scaled[0, 1:] @ solved).real))
