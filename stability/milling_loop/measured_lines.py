"""The lines at which a measured receptance is known: inside its band, and not where noise makes it up."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimation import Frf

Real = NDArray[np.float64]

NOISY = 0.1
"""Noise of a line, over the largest receptance, from which lobes cannot use it: a limit is inverse to the receptance,
and would be off by as much."""

UNSEEN = 1 / 3
"""Noise of a line, over its own receptance, from which the line says nothing."""

MOSTLY = 0.7
"""Share of the lines from the lowest on that must be such noise: a coarse resonance looks rough at a few lines."""

ROUGHEST = 1.5
"""Roughness over its median in the band beyond which it is the structure's: a resonance between two lines is rough at
a few lines, noise of a sensor at all."""

WINDOW = 9
"""Lines over which noise and receptance are averaged."""

FEWEST = 8
"""Least number of lines that stay."""


def known_lines(frf: Frf) -> tuple[Frf, tuple[str, ...]]:
    """The receptance without the lines at which it is not known, and a sentence on what was left out.

    A receptance is the accelerance over ``-w^2``: noise of an accelerometer that is flat over the frequency becomes
    a huge flexibility at the lowest lines, and lobes take it for a structure that chatters below 1 Hz. The noise of
    a line is the standard error that the FRF states or, where that is larger, the roughness of the accelerance A,
    ``|A[k-1] - 2 A[k] + A[k+1]| / sqrt(6)``, which is the standard deviation of independent errors of equal size. A
    resonance that few lines resolve is rough as well, and must not be lost: roughness counts up to one and a half
    times its median in the band. Lines are left out up to the highest one below which most are such noise. Lines
    outside the band that the FRF states are left out, too.

    Parameters
    ----------
    frf
        Measured receptance at the tool tip, m/N, with its errors or coherence where they are known.

    Returns
    -------
    Frf
        The FRF with those lines marked as not valid, and with the band that is left; the same one where none is left
        out, or where fewer than eight would stay.
    tuple of str
        A sentence where noise was left out; empty where none was.

    Examples
    --------
    >>> f = np.linspace(0.125, 100, 800)
    >>> w, point = 2 * np.pi * f, ("T:+X",)
    >>> clean = 1e-6 / (1 - (f / 12) ** 2 + 0.08j * f / 12)
    >>> noise = 1e-4 * np.random.default_rng(1).normal(size=f.size)
    >>> frf = Frf(f, (clean - noise / w**2)[:, None, None], point, point, "receptance", "m/N", f > 0)
    >>> used, said = known_lines(frf)
    >>> bool(1 < used.band[0] < 6), float(used.band[1]), len(said)
    (True, 100.0, 1)
    """
    inside = _inside(frf)
    lines = frf.frequencies[inside]
    if len(lines) < FEWEST:
        return frf, ()
    # noise is alike from line to line where it was measured
    squares = (2 * np.pi * lines) ** 2
    accelerance = frf.values[inside] * squares[:, None, None]
    noise = _noise(frf, inside, accelerance, squares)
    first = _first_known(noise, np.linalg.norm(accelerance, axis=(1, 2)), squares)
    if len(lines) - first < FEWEST:
        return frf, ()
    valid = np.zeros_like(frf.valid)
    valid[np.flatnonzero(inside)[first:]] = True
    if np.array_equal(valid, frf.valid & (frf.frequencies > 0)):
        return frf, ()
    used = replace(frf, valid=valid, band=(float(lines[first]), float(lines[-1])))
    return used, (_sentence(lines, first),) if first else ()


def _sentence(lines: Real, first: int) -> str:
    return (
        f"between {lines[0]:.3g} and {lines[first - 1]:.3g} Hz the receptance is noise (an accelerance is divided by "
        "the square of the frequency): these lines are left out, and the structure is taken to be as stiff there as "
        f"at {lines[first]:.3g} Hz"
    )


def _inside(frf: Frf) -> NDArray[np.bool_]:
    """Valid lines above 0 Hz, inside the band that the FRF states."""
    low, high = frf.band or (0.0, np.inf)
    f = frf.frequencies
    return np.asarray(frf.valid & (f > 0) & (f >= low) & (f <= high))


def _noise(frf: Frf, inside: NDArray[np.bool_], values: NDArray[np.complex128], squares: Real) -> Real:
    """Noise of the accelerance at each line, Frobenius norm over the entries."""
    bent = np.linalg.norm(values[:-2] - 2 * values[1:-1] + values[2:], axis=(1, 2)) / np.sqrt(6)
    rough = np.minimum(_averaged(np.concatenate([bent[:1], bent, bent[-1:]])), ROUGHEST * np.median(bent))
    variance = frf.entry_variance()
    if variance is None:
        return np.asarray(rough)
    # an entry without coherence is noise as a whole, and no more than itself; NaN: not known
    size = np.abs(values) / squares[:, None, None]
    stated = np.sqrt(np.minimum(np.nan_to_num(variance[inside], nan=0.0, posinf=np.inf), size**2).sum(axis=(1, 2)))
    return np.asarray(np.maximum(rough, stated * squares))


def _first_known(noise: Real, size: Real, squares: Real) -> int:
    """Place of the lowest line that is known, from noise and size of the accelerance and ``w^2``."""
    size = _averaged(size)
    unseen = noise > UNSEEN * size
    largest = (size / squares)[~unseen].max(initial=0.0)
    bad = unseen & (noise / squares > NOISY * largest)
    mostly = np.cumsum(bad) >= MOSTLY * np.arange(1, len(bad) + 1)
    ends = np.flatnonzero(bad & mostly)
    return int(ends[-1]) + 1 if len(ends) else 0


def _averaged(values: Real) -> Real:
    """Root mean square over some lines around each; fewer at the ends."""
    weights = np.ones(min(WINDOW, len(values)))
    power = np.convolve(values**2, weights, "same") / np.convolve(np.ones(len(values)), weights, "same")
    return np.asarray(np.sqrt(power))
