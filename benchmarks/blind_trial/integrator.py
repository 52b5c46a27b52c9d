"""The trial's own integrator: classical Runge-Kutta of fourth order at 8192 Hz, far finer than the recordings.

``q_r' = p_r q_r + left_r . (F(t) - sum_e act_e g_e)``; the elements' deflection is ``sense_e . x``, their force acts
along ``act_e`` at the tip. Forces are interpolated by Fourier (exact, for they are band-limited), accelerations
low-passed without phase and decimated.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.signal import resample

from .compiled import compiled
from .excitation import RATE
from .laws import IWAN, N_MEMORY, N_PARAMETERS, drag_sliders, law_force, memory_rate
from .structures import Structure


@dataclass(frozen=True)
class Element:
    """One force law at the tip, or inside the structure.

    Parameters
    ----------
    code
        Number of the law, see :mod:`laws`.
    parameters
        Up to six, in the law's order.
    sense, act : (3,) or (4,)
        Direction of the deflection it feels, and of the force it gives; a fourth axis is the structure's inner joint.
    schedule : (n,) at 512 Hz, or None
        Course of laws that change with time.
    """

    code: int
    parameters: tuple[float, ...]
    sense: NDArray[np.float64]
    act: NDArray[np.float64]
    schedule: NDArray[np.float64] | None = field(default=None)


def respond(
    structure: Structure, force: NDArray[np.float64], elements: Sequence[Element] = (), factor: int = 16
) -> NDArray[np.float64]:
    """Accelerations (n, 3) at 512 Hz, from rest, of forces (n, 3) that begin and end at zero.

    Parameters
    ----------
    factor
        Steps a sample: 16 gives 8192 Hz. Doubled, up to three times, where a law is too stiff for it.
    """
    for steps in (factor, 2 * factor, 4 * factor, 8 * factor):
        accelerations = _attempt(structure, force, elements, steps)
        if np.isfinite(accelerations).all() and np.abs(accelerations).max() < 1e6:
            break
    return accelerations


def _attempt(
    structure: Structure, force: NDArray[np.float64], elements: Sequence[Element], factor: int
) -> NDArray[np.float64]:
    """With a given number of steps a sample; not finite where a law is too stiff for them."""
    fine = np.ascontiguousarray(resample(force, len(force) * factor, axis=0))
    codes = np.array([e.code for e in elements], dtype=np.int64)
    parameters = np.zeros((len(elements), N_PARAMETERS))
    schedules = np.zeros((len(elements), len(force) + 1))
    for row, element in enumerate(elements):
        parameters[row, : len(element.parameters)] = element.parameters
        if element.schedule is not None:
            schedules[row, :-1], schedules[row, -1] = element.schedule, element.schedule[-1]
    sense = np.array([structure.seen @ e.sense for e in elements], dtype=complex).reshape(-1, len(structure.poles))
    act = np.array([structure.pushed @ e.act for e in elements], dtype=complex).reshape(-1, len(structure.poles))
    push = _half_steps(fine @ structure.left.T)
    places = (structure.poles, sense, act)
    modal, resisted = march(push, 1 / (RATE * factor), places, codes, parameters, schedules, factor)
    with np.errstate(invalid="ignore", over="ignore"):
        accelerations = 2 * np.real(modal @ (structure.poles[:, None] ** 2 * structure.sensor))
        direct = 2 * np.real(np.einsum("rp,r,rq->pq", structure.sensor, structure.poles, structure.left))
        accelerations += fine @ direct.T
        accelerations -= resisted @ (2 * np.real((act * structure.poles) @ structure.sensor))
        return _decimated(accelerations, factor)


def linear_response(structure: Structure, force: NDArray[np.float64]) -> NDArray[np.float64]:
    """Accelerations (n, 3) at 512 Hz of the structure without elements: ``s^2 H(s) F(s)``, zero-padded to 128 s.

    Exact for forces that are band-limited, begin and end at zero; agrees with :func:`respond` (see the tests).
    """
    n = 1 << 16
    s = np.asarray(2j * np.pi * np.fft.rfftfreq(n, 1 / RATE), dtype=np.complex128)
    spectrum = (structure.accelerance(s) @ np.fft.rfft(force, n, axis=0)[:, :, None])[:, :, 0]
    return np.asarray(np.fft.irfft(spectrum, n, axis=0)[: len(force)])


def tip_motion(
    structure: Structure, force: NDArray[np.float64], direction: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Deflection (m) and speed (m/s) along a direction of a joint, each (n,) at 512 Hz, of the linear structure."""
    n = 1 << 16
    s = np.asarray(2j * np.pi * np.fft.rfftfreq(n, 1 / RATE), dtype=np.complex128)
    push = np.fft.rfft(force, n, axis=0)
    spectrum = np.zeros(len(s), dtype=complex)
    for pole, seen, left in zip(structure.poles, structure.seen @ direction, structure.left, strict=True):
        spectrum += push @ left * (seen / (s - pole)) + push @ left.conj() * (seen.conj() / (s - pole.conj()))
    deflection, speed = (np.fft.irfft(values, n)[: len(force)] for values in (spectrum, spectrum * s))
    return deflection, speed


def _decimated(fine: NDArray[np.float64], factor: int) -> NDArray[np.float64]:
    """Zero-phase low-pass (flat to 225 Hz, nothing above 255 Hz), then every ``factor``-th row."""
    spectrum = np.fft.rfft(fine, axis=0)
    frequencies = np.fft.rfftfreq(len(fine), 1 / (RATE * factor))
    keep = len(fine) // factor // 2 + 1
    gain = np.cos(np.pi / 2 * np.clip((frequencies[:keep] - 225) / 30, 0, 1)) ** 2
    return np.asarray(np.fft.irfft(spectrum[:keep] * gain[:, None] / factor, len(fine) // factor, axis=0))


def _half_steps(values: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Rows (n, m) and, between them, cubic interpolation ``(-1, 9, 9, -1)/16``: shape (2 n + 1, m)."""
    padded = np.vstack([values[:1], values, values[-1:], values[-1:]])
    both = np.empty((2 * len(values) + 1, values.shape[1]), dtype=complex)
    both[::2] = padded[1:-1]
    both[1::2] = (9 * (padded[1:-2] + padded[2:-1]) - padded[:-3] - padded[3:]) / 16
    return both


@compiled
def march(
    push: NDArray[np.complex128],
    h: float,
    structure: tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.complex128]],
    codes: NDArray[np.int64],
    p: NDArray[np.float64],
    schedules: NDArray[np.float64],
    factor: int,
) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Modal coordinates (n, n_modes) and elements' forces (n, n_elements) at every step.

    ``push`` (2 n + 1, n_modes) is the modal force at the steps and half-way between.
    """
    n, n_modes, n_elements = push.shape[0] // 2, push.shape[1], len(codes)
    history, resisted = np.zeros((n, n_modes), np.complex128), np.zeros((n, n_elements))
    q, rate = np.zeros(n_modes, np.complex128), np.zeros(n_modes, np.complex128)
    total, stage = np.zeros(n_modes, np.complex128), np.zeros(n_modes, np.complex128)
    z, memory, given = np.zeros((n_elements, N_MEMORY)), np.zeros((3, n_elements)), np.zeros(n_elements)
    for i in range(n):
        history[i] = q
        total[:] = 0
        memory[1] = 0
        for k in range(4):
            ahead = 0.5 * ((k + 1) // 2)
            for r in range(n_modes):
                stage[r] = q[r] + ahead * h * rate[r] if k else q[r]
            memory[2] = z[:, 0] + ahead * h * memory[0]
            sample = (i + ahead) / factor
            _stage(stage, push[2 * i + (k + 1) // 2], structure, codes, p, schedules, sample, z, memory, given, rate)
            weight = h / 6 if k in (0, 3) else h / 3
            for r in range(n_modes):
                total[r] += weight * rate[r]
            memory[1] += weight * memory[0]
            if k == 0:
                resisted[i] = given
        for r in range(n_modes):
            q[r] += total[r]
        _remember(q, structure[1], codes, p, z, memory)
    return history, resisted


@compiled
def _stage(
    q: NDArray[np.complex128],
    push: NDArray[np.complex128],
    structure: tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.complex128]],
    codes: NDArray[np.int64],
    p: NDArray[np.float64],
    schedules: NDArray[np.float64],
    sample: float,
    z: NDArray[np.float64],
    memory: NDArray[np.float64],
    given: NDArray[np.float64],
    rate: NDArray[np.complex128],
) -> None:
    """One evaluation of the right-hand side: fills ``rate``, ``memory[0]`` and ``given``."""
    poles, sense, act = structure
    for r in range(len(q)):
        rate[r] = poles[r] * q[r] + push[r]
    before = min(int(sample), schedules.shape[1] - 2)
    for e in range(len(codes)):
        u, v = 0.0, 0.0
        for r in range(len(q)):
            seen = sense[e, r] * q[r]
            u += 2 * seen.real
            v += 2 * (poles[r] * seen).real
        share = sample - before
        schedule = (1 - share) * schedules[e, before] + share * schedules[e, before + 1]
        slip = memory_rate(codes[e], p[e], v, memory[2, e])
        given[e] = law_force(codes[e], p[e], (u, v, schedule), z[e], memory[2, e], slip)
        memory[0, e] = slip
    for e in range(len(codes)):
        for r in range(len(q)):
            rate[r] -= act[e, r] * given[e]


@compiled
def _remember(
    q: NDArray[np.complex128],
    sense: NDArray[np.complex128],
    codes: NDArray[np.int64],
    p: NDArray[np.float64],
    z: NDArray[np.float64],
    memory: NDArray[np.float64],
) -> None:
    """Take over the memory at the end of a step."""
    for e in range(len(codes)):
        if codes[e] == IWAN:
            u = 0.0
            for r in range(len(q)):
                u += 2 * (sense[e, r] * q[r]).real
            drag_sliders(p[e], u, z[e])
        else:
            z[e, 0] += memory[1, e]
