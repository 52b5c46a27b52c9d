"""Spindle orders of the forces of a recording: their mean over the revolutions, its error, and the drift of zero."""

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy

from millfrf.core import Complex, Index, InputError, Real

from ..motion import SpindleLaw, found_law

LEAST_REVOLUTIONS = 20  # fewer give neither a mean force nor its scatter
BLOCKS = 16  # most blocks of revolutions whose scatter is the noise
LEAST_IN_AIR = 4  # revolutions in air from which the zero of the sensors is taken
AIR = 0.1  # of the same level: revolutions below it are in air
RIPPLE = 0.1  # of the mean force: with less, a force that teeth keep constant has no lines
CHANCE = 1e-3  # probability of as large orders at a wrong speed
CUTTING = 0.5  # of the median level of the loudest half: revolutions below it are cut in part, or in air


@dataclass(frozen=True)
class TurnSpectra:
    """Fourier coefficients of the forces over a revolution.

    Parameters
    ----------
    name
        Name of the recording.
    law
        Angle of the spindle over time.
    mean : (n_orders, n_axes), N
        ``F(angle) = c_0 + 2 Re sum_k c_k exp(i k angle)``, orders 0, 1, 2 ...
    error : (n_orders, n_axes), N
        Standard error of ``mean`` from its scatter between blocks of revolutions.
    drift : (n_axes,), N
        Change of the mean force between the recording's beginning and end; zero where chance explains it.
    revolutions
        Number of revolutions in the cut.
    turning : (n_blocks,), Hz
        Spindle frequency in the middle of each block.
    cut : slice
        Samples in the full cut.
    """

    name: str
    law: SpindleLaw
    mean: Complex
    error: Real
    drift: Real
    revolutions: int
    turning: Real
    cut: slice


def turn_spectra(name: str, force: Real, rate: float, stated: SpindleLaw, teeth: int, top: int) -> TurnSpectra:
    """Compute the spindle orders 0 to ``top`` of forces.

    Revolutions in air before and after the cut are left out; their mean, the zero of the sensor, is subtracted. With
    air on both sides the zero is the straight line through both means.

    Parameters
    ----------
    name
        Name of the recording, for messages.
    force : (n, n_axes), N
        Samples.
    rate : Hz
        Samples per second.
    stated
        Spindle speed within 2 %, constant or swept linearly.
    teeth
        Number of teeth.
    top
        Highest spindle order.

    Raises
    ------
    InputError
        Fewer than 20 revolutions in the cut, or forces that do not repeat at this speed.
    """
    first, last, zero = _in_the_cut(force, rate, stated)
    samples = force[first:last] - zero[first:last]
    law = _law(samples, rate, replace(stated.about(first / rate), middle=0.0), teeth)
    angles = law.angles(np.arange(len(samples)) / rate)
    turns = (angles - angles[0]) / (2 * np.pi)
    revolutions = int(turns[-1])
    if revolutions < LEAST_REVOLUTIONS:
        raise InputError(
            f"{name}: {revolutions} revolutions lie in the cut; {LEAST_REVOLUTIONS} are the least, record longer"
        )
    blocks = min(BLOCKS, revolutions // 4)
    edges = np.searchsorted(turns, np.arange(blocks + 1) * (revolutions // blocks))
    parts = np.array([_orders(samples[a:b], angles[a:b], top) for a, b in pairwise(edges)])
    turning = law.speeds((edges[:-1] + edges[1:]) / 2 / rate) / (2 * np.pi)
    error = np.sqrt(np.sum(np.abs(parts - parts.mean(axis=0)) ** 2, axis=0) / (blocks * (blocks - 1)))
    drift = _drift(parts[:, 0].real)
    mean = parts.mean(axis=0)
    if not _repeats(mean, error, blocks) and samples.std() > RIPPLE * np.abs(mean[0]).max():
        raise InputError(_without_lines(name, samples, rate, float(turning.mean()), teeth))
    return TurnSpectra(name, law, mean, error, drift, revolutions, turning, slice(first, last))


def _repeats(mean: Complex, error: Real, blocks: int) -> bool:
    """Return whether orders are more than what random phases leave in the mean of the blocks (F-test)."""
    count = 2 * mean[1:].size
    ratio = np.sum(np.abs(mean[1:]) ** 2) / max(float(np.sum(error[1:] ** 2)), 1e-300)
    return bool(scipy.stats.f.sf(ratio, count, count * (blocks - 1)) < CHANCE)


def _without_lines(name: str, samples: Real, rate: float, turning: float, teeth: int) -> str:
    """State that forces have no lines at the orders of a speed (Hz), and of which speed their strongest line may be."""
    frequencies, power = scipy.signal.welch(
        samples, rate, nperseg=min(len(samples), round(10 * rate / turning)), axis=0
    )
    strongest = float(frequencies[np.argmax(power[1:].sum(axis=1)) + 1])
    return (
        f"{name}: the forces have no lines at orders of {60 * turning:.4g} rpm; their strongest line, {strongest:.4g} "
        f"Hz, would be the tooth passing of {teeth} teeth at {60 * strongest / teeth:.4g} rpm: correct the speed"
    )


def _law(samples: Real, rate: float, stated: SpindleLaw, teeth: int) -> SpindleLaw:
    """Return the spindle's law from the tooth passing, else from runout; the stated one where neither stands out.

    Teeth that follow each other in a slot may sum to a constant force, which has no tooth passing.
    """
    for lines in (teeth, 1):
        try:
            return found_law(samples, rate, stated, lines)
        except InputError:
            continue
    return stated


def _in_the_cut(force: Real, rate: float, stated: SpindleLaw) -> tuple[int, int, Real]:
    """Return the first sample in the full cut, the sample after its last, and the zero of each sample, (n, n_axes)."""
    turn = max(1, round(2 * np.pi * rate / stated.about(len(force) / rate / 2).speed))
    count = len(force) // turn
    none = np.broadcast_to(0.0, force.shape)
    if count < LEAST_REVOLUTIONS:
        return 0, len(force), none
    pieces = force[: count * turn].reshape(count, turn, -1)
    means = pieces.mean(axis=1)
    ripple = np.sqrt(np.mean((pieces - means[:, None]) ** 2, axis=(1, 2)))
    # a cut with many teeth in it has hardly any ripple, but a mean: the quietest revolution is air if there is any
    level = np.sqrt(ripple**2 + np.mean((means - means[np.argmin(ripple)]) ** 2, axis=1))
    full = float(np.median(np.sort(level)[count // 2 :]))
    cutting = np.flatnonzero(level > CUTTING * full)
    longest = max(np.split(cutting, np.flatnonzero(np.diff(cutting) > 1) + 1), key=len)
    # a zero that drifts moves the mean of a revolution in air, but not its ripple
    air = np.flatnonzero((level < AIR * full) | ((ripple < AIR * full) & (level <= CUTTING * full)))
    zero = _zero(means, air, longest, turn, len(force)) if len(air) >= LEAST_IN_AIR else none
    # the first and last revolution of the run may lie in the cut in part
    whole = len(longest) == count
    first, last = (0, len(force)) if whole else ((longest[0] + 1) * turn, longest[-1] * turn)
    return int(first), int(last), zero


def _zero(means: Real, air: Index, cutting: Index, turn: int, length: int) -> Real:
    """Return the zero of the sensors at each sample: a line through the air before and after the cut, or a constant."""
    sides = [air[air < cutting[0]], air[air > cutting[-1]]]
    if min(len(side) for side in sides) < LEAST_IN_AIR:
        return np.broadcast_to(means[air].mean(axis=0), (length, means.shape[1]))
    centres = [(side.mean() + 0.5) * turn for side in sides]
    before, after = (means[side].mean(axis=0) for side in sides)
    share = (np.arange(length) - centres[0]) / (centres[1] - centres[0])
    return np.asarray(before + share[:, None] * (after - before))


def _orders(samples: Real, angles: Real, top: int) -> Complex:
    """Fit the orders 0 to ``top`` to samples at known angles by least squares."""
    waves = np.arange(1, top + 1)[None, :] * angles[:, None]
    design = np.column_stack([np.ones(len(angles)), np.cos(waves), np.sin(waves)])
    fitted = scipy.linalg.lstsq(design, samples, lapack_driver="gelsy")[0]
    cosines, sines = fitted[1 : top + 1], fitted[top + 1 :]
    return np.asarray(np.concatenate([fitted[:1].astype(complex), (cosines - 1j * sines) / 2]))


def _drift(means: Real) -> Real:
    """Return the change of each axis' mean force over the recording; zero unless a t-test at 1 % sees a slope."""
    count = len(means)
    time = np.arange(count) - (count - 1) / 2
    slope = time @ means / float(time @ time)
    scatter = np.sqrt(np.sum((means - means.mean(axis=0) - np.outer(time, slope)) ** 2, axis=0) / max(count - 2, 1))
    error = np.maximum(scatter / math.sqrt(float(time @ time)), 1e-300)
    seen = 2 * scipy.stats.t.sf(np.abs(slope) / error, max(count - 2, 1)) < 0.01
    return np.where(seen, slope * count, 0.0)
