"""The direction in which a joint acts, and what force it exerts, from the residual of a linear fit."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, rfft
from scipy.optimize import minimize

from ..joints import JointAxis, JointMotion, tip_axes
from ..models import Hypothesis, predict_lines, receptance_at
from .axis_bands import AxisBands, axis_bands, gain_along, reached_by
from .whitened_residual import Floor, FloorRecord

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@dataclass(frozen=True)
class JointSighting:
    """Where the residual's force points.

    Parameters
    ----------
    axis
        Direction at the tip; its largest entry is positive.
    gain
        Twice the log likelihood that one force along it explains, its spectrum free, beyond what noise gains.
    share
        Gain as a share of what a force in any direction would explain.
    """

    axis: JointAxis
    gain: float
    share: float


def find_direction(floor: Floor, hypothesis: Hypothesis) -> JointSighting:
    """Most likely direction of a single force of unknown spectrum.

    For each narrow band the residual ``r = G d u + noise`` has the statistic
    ``z = mean |h^H V^-1 r|^2 / (h^H V^-1 h)``, h = G d, one under noise alone; the likelihood gained is
    ``2 n (z - 1 - ln z)`` where z > 1. The start is the first eigenvector of the force that the residual asks for,
    ``sum w Re(F F^H)``, ``F = G^-1 r``.
    """
    columns = tip_axes(hypothesis.model)[1]
    reaches = [record.through @ columns for record in floor.records]
    bands = [axis_bands(record, reach) for record, reach in zip(floor.records, reaches, strict=True)]
    n = columns.shape[1]

    def gain(direction: Real) -> float:
        return sum(gain_along(parts, direction / np.linalg.norm(direction)) for parts in bands)

    tries = np.random.default_rng(0).normal(size=(60 * n, n))
    tries = np.vstack([tries, np.eye(n), *map(_eigenvectors, floor.records, reaches)])
    best = max(tries, key=gain)
    if n > 1:
        answer = minimize(lambda d: -gain(d), best / np.linalg.norm(best), method="Nelder-Mead")
        best = answer.x
    direction = best / np.linalg.norm(best)
    direction = direction * np.sign(direction[np.argmax(np.abs(direction))])
    # noise alone gains half a unit a band on average where z > 1
    chance = 0.5 * sum(len(parts.starts) for parts in bands)
    everything = sum(_gain_of_all(parts) for parts in bands) - n * chance
    found = gain(direction) - chance
    return JointSighting(JointAxis(direction), found, found / max(everything, 1e-12))


def _gain_of_all(bands: AxisBands) -> float:
    """Gain of a force that is free in every direction, counted as that many separate forces."""
    inverse = np.linalg.pinv(bands.weight, hermitian=True)
    power = np.real(np.einsum("ki,kij,kj->k", bands.pull.conj(), inverse, bands.pull))
    n = bands.pull.shape[1]
    z = np.maximum(np.add.reduceat(power, bands.starts) / bands.counts / n, 1.0)
    return float(2 * n * np.sum(bands.counts * (z - 1 - np.log(z))))


def _eigenvectors(record: FloorRecord, reached: Complex) -> Real:
    back = np.linalg.pinv(reached)
    force = np.einsum("kqp,kp->kq", back, record.residual)
    spread = back @ np.linalg.inv(record.white)
    weight = 1 / np.maximum(np.sum(np.abs(spread) ** 2, axis=(1, 2)), 1e-300)
    return np.asarray(np.linalg.eigh(np.real((force * weight[:, None]).T @ force.conj()))[1].T)


@dataclass(frozen=True)
class SeenMotion:
    """Best estimate of a joint's motion and force in one recording.

    Parameters
    ----------
    deflection, velocity : (n_samples,), m, m/s
        Most likely motion along the joint's axis.
    force : (n_samples,), N
        Most likely force along the axis given its spectrum.
    """

    deflection: Real
    velocity: Real
    force: Real


def seen_motion(record: FloorRecord, hypothesis: Hypothesis, axis: JointAxis) -> SeenMotion:
    """Motion along a joint's axis: the model's, corrected by the force that the residual asks for.

    The force is the posterior mean ``u = lambda h^H (V + lambda h h^H)^-1 r`` with lambda from the residual's power in
    each band (Wiener's filter), so that noise is not integrated where nothing is seen.
    """
    lines = record.lines
    reach = hypothesis.reach_with(axis)
    path = reach.paths[-1]
    predicted = predict_lines(hypothesis, lines)
    n = len(lines.recording.force)
    frequencies = lines.padded_frequencies
    whole = np.zeros((lines.padded, lines.measured.shape[1]))
    whole[:n] = lines.recording.response - irfft(predicted.spectrum, n=lines.padded, axis=0)[:n]
    run_in = np.ones(n)
    run_in[: lines.start] = np.linspace(0, 1, lines.start) ** 4
    whole[:n] *= run_in[:, None]
    rest = rfft(whole, axis=0)
    filtered = _wiener(record, reached_by(record, hypothesis, axis) @ axis.entries)
    inside = (frequencies >= lines.frequencies[0]) & (frequencies <= lines.frequencies[-1])
    gains = np.zeros((len(frequencies), filtered.shape[1]), dtype=complex)
    for p in range(filtered.shape[1]):
        gains[inside, p] = np.interp(frequencies[inside], lines.frequencies, filtered[:, p].real)
        gains[inside, p] += 1j * np.interp(frequencies[inside], lines.frequencies, filtered[:, p].imag)
    force = np.einsum("kp,kp->k", gains, rest)
    compliance = path.along @ receptance_at(reach.model, frequencies)
    felt = reach.forces(lines.force_lines) - reach.forces(predicted.joint)
    displacement = np.einsum("kq,kq->k", compliance, felt) + (compliance @ path.push) * force
    deflection = irfft(displacement, n=lines.padded)[:n]
    velocity = irfft(2j * np.pi * frequencies * displacement, n=lines.padded)[:n]
    return SeenMotion(deflection, velocity, -irfft(force, n=lines.padded)[:n])


def _wiener(record: FloorRecord, reached: Complex) -> Complex:
    """Row ``lambda h^H (V + lambda h h^H)^-1`` at the lines for responses h (n_lines, n_responses) to the force."""
    bands = axis_bands(record, reached[:, :, None])
    power = np.abs(bands.pull[:, 0]) ** 2
    size = np.maximum(np.real(bands.weight[:, 0, 0]), 1e-300)
    z = np.add.reduceat(power / size, bands.starts) / bands.counts
    typical = np.add.reduceat(size, bands.starts) / bands.counts
    excess = np.maximum(z - 1, 0) / typical
    centres = bands.starts + bands.counts / 2
    variance = np.interp(np.arange(len(size)), centres, excess)
    reach = record.white @ reached[:, :, None]
    row = np.einsum("kij,ki->kj", record.white, reach[:, :, 0].conj())
    return np.asarray((variance / (1 + variance * size))[:, None] * row)


class MovingJoint(Protocol):
    """Motion of a joint in one recording, as it was seen or as a hypothesis predicts it."""

    @property
    def deflection(self) -> Real:
        """Deflection of the joint at each instant, m."""

    @property
    def velocity(self) -> Real:
        """Velocity of the joint at each instant, m/s."""


def motion_of(seen: Sequence[MovingJoint], stiffness: float) -> JointMotion:
    """Sizes of a joint's motion over all recordings.

    The reach counts from zero and not from the mean, as play and knees lie where the joint stands.

    Parameters
    ----------
    seen
        The joint's motion in each recording.
    stiffness
        Static stiffness of the structure along the joint's direction, N/m.
    """
    deflections = np.concatenate([one.deflection for one in seen])
    velocities = np.concatenate([one.velocity for one in seen])
    strongest = max(seen, key=lambda one: float(np.std(one.deflection)))
    return JointMotion(
        float(np.std(strongest.deflection)),
        float(np.std(strongest.velocity)),
        2.5 * float(np.abs(deflections).max()),
        2.5 * float(np.abs(velocities).max()),
        stiffness,
    )
