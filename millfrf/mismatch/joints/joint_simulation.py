"""Free simulation of a joint's law on a modal model, recording by recording."""

from dataclasses import dataclass

import numpy as np
import scipy

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real
from modal_fit import ModalModel

from .joint_law import JointLaw
from .time_loops import driven_run, free_run

INSTANTS_PER_PERIOD = 20.0
"""Instants of the simulation in one period of the highest mode."""

FINEST = 20
"""Instants for each sample at most: of a mode beyond the sampling rate, which a fit may try, nothing is recorded. It
follows the joint's force without delay, and each step of the simulation is exact for a force that runs straight."""


@dataclass(frozen=True)
class JointResponse:
    """A joint in a simulation.

    Parameters
    ----------
    force : (n_padded_lines,), N
        Spectrum of the joint's force at the lines of the padded record.
    deflection, velocity : (k n_padded,), m and m/s
        Motion of the joint at the recording's samples, or k times as often (:func:`substeps`).
    """

    force: Complex
    deflection: Real
    velocity: Real


def fineness(model: ModalModel, rate: float) -> int:
    """Instants of the simulation for each sample of the recording."""
    wanted = INSTANTS_PER_PERIOD * float(model.natural_frequencies.max()) / rate
    return int(np.clip(np.ceil(min(wanted, FINEST)), 4, FINEST))


def substeps(model: ModalModel, rate: float, fine: int) -> int:
    """Instants for each sample at which a motion is kept: a divisor of ``fine`` that follows the highest mode."""
    wanted = INSTANTS_PER_PERIOD * float(model.natural_frequencies.max()) / rate
    return next((k for k in range(1, fine) if fine % k == 0 and k >= wanted), fine)


def joint_response(
    model: ModalModel, lines: WindowedSpectrum, free: Complex, ends: tuple[Real, Real], law: JointLaw
) -> JointResponse:
    """Force and motion of a joint, the structure simulated freely under the outer force and the joint's.

    Parameters
    ----------
    model
        Modal model of the linear structure.
    lines
        Windowed spectrum of the recording.
    free : (n_padded_lines,), m
        Spectrum of the joint's deflection under the outer force alone.
    ends : (n_responses,) and (n_excitations,)
        The combination of responses that is the joint's deflection, and the excitations by a unit of its force.
    law
        Force law of the joint.
    """
    frequencies = lines.padded_frequencies
    fine = fineness(model, lines.recording.rate)
    n = fine * lines.padded
    finer = fine * free
    deflection = scipy.fft.irfft(finer, n=n)
    velocity = scipy.fft.irfft(2j * np.pi * frequencies * finer, n=n)
    step = 1.0 / (fine * lines.recording.rate)
    written = (np.empty(n), np.empty(n), np.empty(n))
    free_run(
        deflection,
        velocity,
        joint_dynamics(model, ends, step),
        law.tables(),
        (law.reach, law.speed),
        stiffness_ramp(law, n, step, lines.recording.duration),
        (law.springs, law.yields),
        written,
    )
    force_lines = np.asarray(scipy.fft.rfft(written[0])[: len(frequencies)] / fine)
    every = fine // substeps(model, lines.recording.rate, fine)
    return JointResponse(force_lines, written[1][::every].copy(), written[2][::every].copy())


def driven_force(lines: WindowedSpectrum, deflection: Real, velocity: Real, law: JointLaw, *, often: int = 1) -> Real:
    """The joint's force (n,), N, for a motion sampled at the recording's rate, or ``often`` times it."""
    result = np.empty(len(deflection))
    ramp = stiffness_ramp(law, len(deflection), 1 / (often * lines.recording.rate), lines.recording.duration)
    driven_run(deflection, velocity, law.tables(), (law.reach, law.speed), ramp, (law.springs, law.yields), result)
    return result


def stiffness_ramp(law: JointLaw, n: int, step: float, duration: float) -> Real:
    """Change of stiffness (n,), N/m, at instants ``step`` s apart."""
    if law.ramp == 0.0 and law.bend == 0.0:
        return np.zeros(n)
    tau = np.minimum(np.arange(n) * step / duration, 1.0) - 0.5
    return np.asarray(law.ramp * tau + law.bend * (4 * tau**2 - 1))


def joint_dynamics(
    model: ModalModel, ends: tuple[Real, Real], step: float
) -> tuple[Complex, Complex, Complex, Complex, Complex]:
    """Exact step of ``q' = p q + left.b g`` for g straight between instants; ``ends`` as for :func:`joint_response`.

    Returns
    -------
    turn, early, late, to_x, to_v : (n_modes,)
        As :func:`millfrf.mismatch.joints.time_loops.free_run` takes them.
    """
    poles = model.poles
    z = poles * step
    turn = np.exp(z)
    whole = (turn - 1) / poles
    late = (turn - 1 - z) / (poles * z)
    to_x, push = model.right @ ends[0], model.left @ ends[1]
    return turn, (whole - late) * push, late * push, to_x, to_x * poles
