"""Restoring force of a joint over deflection, velocity, time and memory, and its simulation on a modal model."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real
from modal_fit import ModalModel

from .coupled_loops import free_runs
from .time_loops import Columns, driven_run, free_run

POINTS = 8193  # points of a table over deflection or velocity


def _none() -> Real:
    return np.zeros(0)


@dataclass(frozen=True)
class JointLaw:
    """Force g of a joint beyond its linear stiffness and damping, ``g = S(x) + D(v) + r(tau) x + sum_i w_i``.

    Two tables hold the functions S of the deflection x and D of the velocity v. Memory is a sum of parallel
    elastic-plastic elements, ``w_i' = k_i v`` within ``|w_i| <= k_i y_i`` (Iwan, J. Applied Mechanics 33, 1966).
    Several elements give a smooth hysteresis; one stiff element gives dry friction with presliding.

    Parameters
    ----------
    reach
        Deflection x at the ends of its table, m; the table continues as a straight line.
    stiffness : (POINTS,), N
        Force S at evenly spaced x from -reach to reach; empty for none.
    speed
        Velocity at the ends of its table, m/s.
    damping : (POINTS,), N
        Force D at evenly spaced v from -speed to speed; empty for none.
    ramp
        Change of the stiffness r from the start to the end of a recording, N/m; tau runs from -1/2 to 1/2.
    bend
        Stiffness b by which the middle of a curved change lies below the linear one, N/m: ``r tau + b (4 tau^2 - 1)``.
    springs : (n,), N/m
        Stiffness k of each elastic-plastic element.
    yields : (n,), m
        Deflection y at which each elastic-plastic element yields.
    """

    reach: float = 1.0
    stiffness: Real = field(default_factory=_none)
    speed: float = 1.0
    damping: Real = field(default_factory=_none)
    ramp: float = 0.0
    bend: float = 0.0
    springs: Real = field(default_factory=_none)
    yields: Real = field(default_factory=_none)

    @property
    def loses_energy(self) -> bool:
        """Whether the force depends on velocity or has a memory, unlike the force of a spring."""
        return bool(len(self.damping) or len(self.springs))

    def times(self, factor: float) -> "JointLaw":
        """Return the law with its force multiplied by a factor.

        >>> JointLaw(springs=np.array([2.0]), yields=np.array([0.5])).times(3.0).springs
        array([6.])
        """
        forces = {name: getattr(self, name) * factor for name in ("stiffness", "damping", "ramp", "bend", "springs")}
        return replace(self, **forces)

    def tables(self) -> tuple[Real, Real]:
        """Return both tables; an empty table is replaced by three zeros."""
        zero = np.zeros(3)
        return (self.stiffness if len(self.stiffness) else zero, self.damping if len(self.damping) else zero)


@dataclass(frozen=True)
class JointMotion:
    """Size of a joint's motion in the recordings, from which the numbers of a law start."""

    # standard deviations of deflection (m) and velocity (m/s) in the strongest recording
    deflection: float
    velocity: float
    # ends of the law's tables: two and a half times the largest deflection (m) and velocity (m/s) of all recordings
    reach: float
    speed: float
    stiffness: float  # static stiffness of the structure along the joint's direction, N/m
    # frequency of the force's line that sweeps, Hz, at the beginning and at the end of a recording; without a recording
    # its least and its largest frequency in all of them. None where no line sweeps
    swept_line: tuple[float, float] | None = None
    durations: tuple[float, float] | None = None  # of the shortest and the longest recording, s

    @property
    def deflections(self) -> Real:
        """Points of the table over deflection, m."""
        return np.linspace(-self.reach, self.reach, POINTS)

    @property
    def velocities(self) -> Real:
        """Points of the table over velocity, m/s."""
        return np.linspace(-self.speed, self.speed, POINTS)


@dataclass(frozen=True)
class Saturation:
    """Saturating characteristic ``y = x / (1 + |x / l|^n)^(1 / n)``; a sharp limit has n = infinity.

    ``limit`` l is in the channel's unit, with the standard error ``error``; ``sharpness`` is n.
    """

    limit: float
    error: float
    sharpness: float = np.inf
    sharpness_error: float = 0.0


def saturated(signal: Real, limit: float, sharpness: float = np.inf) -> Real:
    """Return the output of the characteristic of :class:`Saturation` for a signal.

    >>> saturated(np.array([0.5, 3.0]), 2.0)
    array([0.5, 2. ])
    >>> saturated(np.array([0.5, 2.0]), 2.0, 1.0)
    array([0.4, 1. ])
    """
    if np.isinf(sharpness):
        return np.asarray(np.clip(signal, -limit, limit))
    ratio = np.abs(signal) / limit
    # far beyond the limit a power of the ratio may overflow, but a power of its reciprocal stays finite
    large = np.maximum(ratio, 1.0)
    small = np.minimum(ratio, 1.0) ** sharpness
    return np.asarray(signal / large * (large**-sharpness + small) ** (-1 / sharpness))


def rounded(measured: Real, predicted: Real, sharp: Saturation) -> Saturation:
    """Fit a rounded limit to a channel for which a sharp limit is known, and return the better of both.

    ``measured`` and ``predicted`` (n,) are the samples of the channel, predicted without a limit.
    """
    softest, sharpest = 4.0, 60.0  # a softer limit bends far below the limit, a sharper one is practically a corner
    near = np.abs(predicted) > 0.5 * sharp.limit
    due, seen = predicted[near], measured[near]

    def misfit(numbers: Real) -> float:
        inverse = float(np.clip(numbers[1], 0.0, 1 / softest))
        sharpness = 1 / inverse if inverse > 1 / sharpest else np.inf
        return float(np.sum((seen - saturated(due, sharp.limit * float(numbers[0]), sharpness)) ** 2))

    start = np.array([[1.0, 0.02], [1.01, 0.06], [1.02, 0.2]])
    best = scipy.optimize.minimize(
        misfit, start[1], method="Nelder-Mead", options={"initial_simplex": start, "maxiter": 80, "xatol": 1e-4}
    )
    inverse = float(np.clip(best.x[1], 0.0, 1 / softest))
    gain = len(seen) * float(np.log(misfit(np.array([1.0, 0.0])) / max(float(best.fun), 1e-300)))
    if inverse <= 1 / sharpest or gain < 20.0:  # twice the gain in log likelihood that the sharpness must bring
        return sharp
    fitted = Saturation(sharp.limit * float(best.x[0]), sharp.error, 1 / inverse)
    return _with_errors(fitted, due, float(best.fun) / len(seen))


def _with_errors(fitted: Saturation, due: Real, variance: float) -> Saturation:
    """Add first-order standard errors of limit and sharpness, for noise of this variance on the output for ``due``."""
    numbers = np.array([fitted.limit, fitted.sharpness])
    steps = 1e-4 * numbers
    slopes = []
    for k in range(2):
        above, below = (numbers + sign * steps * np.eye(2)[k] for sign in (1, -1))
        slopes.append((saturated(due, *above) - saturated(due, *below)) / (2 * steps[k]))
    slope = np.array(slopes)
    spread = np.sqrt(variance * np.diag(np.linalg.pinv(slope @ slope.T)))
    return replace(fitted, error=float(spread[0]), sharpness_error=float(spread[1]))


@dataclass(frozen=True)
class LawSlopes:
    """Derivative of a law by the coordinate of each of its numbers.

    The force is linear in tables and springs, so that their derivatives give the derivative of the force. A yield
    changes the force only through the last slip of its element. The law is thus evaluated along a motion only once.
    """

    # derivatives of the tables at their points, (n_points, n_numbers), N; no rows if no number changes the table
    stiffness: Columns
    damping: Columns
    ramp: Columns  # derivatives of ramp and bend, (2, n_numbers), N/m
    springs: Columns  # derivatives of the springs, (n_elements, n_numbers), N/m
    # derivative of the force of each element that has yielded, due to the change of its yield, (n_elements, n_numbers),
    # N
    yields: Columns

    @property
    def parts(self) -> tuple[tuple[Columns, Columns], Columns, tuple[Columns, Columns]]:
        """Return the derivatives of tables, ramp and elements as arguments of the compiled loops."""
        return (self.stiffness, self.damping), self.ramp, (self.springs, self.yields)


def law_slopes(law: JointLaw, changes: Sequence[JointLaw]) -> LawSlopes:
    """Collect the derivatives of a law by its numbers.

    Each of ``changes`` is the derivative of the law by one coordinate. Its tables have the same ends as the law's
    tables or are empty, and its elements hold the derivatives of springs and yields.
    """
    ramp = [[change.ramp for change in changes], [change.bend for change in changes]]
    springs, yields = (
        [getattr(change, name) for change in changes] if len(law.springs) else np.zeros((len(changes), 0))
        for name in ("springs", "yields")
    )
    return LawSlopes(
        _as_columns([change.stiffness for change in changes]),
        _as_columns([change.damping for change in changes]),
        np.array(ramp, dtype=np.float32),
        np.array(springs, dtype=np.float32).T.copy(),
        (np.array(yields).T * law.springs[:, None]).astype(np.float32),
    )


def no_slopes(elements: int) -> LawSlopes:
    """Return the derivatives of a law with so many elements by no number."""
    return LawSlopes(*(np.zeros((rows, 0), dtype=np.float32) for rows in (0, 0, 2, elements, elements)))


def law_quotient(law: JointLaw, perturbed: JointLaw, step: float) -> JointLaw:
    """Return the difference quotient of two laws with equally many elements; tables have the ends of the first law."""
    return JointLaw(
        law.reach,
        _table_quotient((law.stiffness, law.reach), (perturbed.stiffness, perturbed.reach), step),
        law.speed,
        _table_quotient((law.damping, law.speed), (perturbed.damping, perturbed.speed), step),
        (perturbed.ramp - law.ramp) / step,
        (perturbed.bend - law.bend) / step,
        (perturbed.springs - law.springs) / step,
        (perturbed.yields - law.yields) / step,
    )


def _table_quotient(first: tuple[Real, float], second: tuple[Real, float], step: float) -> Real:
    """Return the difference quotient of two tables, each given with the end of its axis; empty if they are equal."""
    table, end = first
    other, other_end = second
    if np.array_equal(table, other) and end == other_end:
        return np.zeros(0)
    if len(other) != len(table) or other_end != end:
        other = np.interp(np.linspace(-end, end, len(table)), np.linspace(-other_end, other_end, len(other)), other)
    return np.asarray((other - table) / step)


def _as_columns(tables: Sequence[Real]) -> Columns:
    """Return tables as columns, (n_points, n_numbers), with zeros for an empty table; no rows if all are empty."""
    points = max((len(table) for table in tables), default=0)
    result = np.zeros((points, len(tables)), dtype=np.float32)
    for k, table in enumerate(tables):
        if len(table):
            result[:, k] = table
    return result


STEPS_PER_PERIOD = 20.0  # steps of the simulation in a period of the highest mode

# Most steps per sample. A fit may try a mode beyond the sampling rate, which the recording does not contain. Such a
# mode needs no finer steps: it follows the joint's force without delay, and a step is exact for a linear force.
MOST_STEPS = 20


@dataclass(frozen=True)
class JointResponse:
    """Force and motion of a joint in a simulation."""

    force: Complex  # spectrum of the joint's force at the lines of the padded recording, (n_padded_lines,), N
    # deflection (m) and velocity (m/s) at the k instants of each sample of :func:`steps_per_sample`, (k n_padded,)
    deflection: Real
    velocity: Real

    def at_fewest_instants(self, model: ModalModel, lines: WindowedSpectrum) -> "JointResponse":
        """Return the motion at no more instants than resolve the highest mode of a model."""
        steps = max(1, len(self.deflection) // lines.padded)
        every = slice(None, None, steps // fewest_steps(model, lines.recording.rate, steps))
        return replace(self, deflection=self.deflection[every].copy(), velocity=self.velocity[every].copy())


def steps_per_sample(model: ModalModel, rate: float) -> int:
    """Return the number of steps of the simulation in each sample of the recording."""
    needed = STEPS_PER_PERIOD * float(model.natural_frequencies.max()) / rate
    return int(np.clip(np.ceil(min(needed, MOST_STEPS)), 4, MOST_STEPS))


def fewest_steps(model: ModalModel, rate: float, steps: int) -> int:
    """Return the number of instants in each sample that resolve the highest mode: a divisor of ``steps``."""
    needed = STEPS_PER_PERIOD * float(model.natural_frequencies.max()) / rate
    return next((k for k in range(1, steps) if steps % k == 0 and k >= needed), steps)


Ends = tuple[Real, Real]


def joint_responses(
    model: ModalModel, lines: WindowedSpectrum, free: Complex, ends: Sequence[Ends], laws: Sequence[JointLaw]
) -> list[JointResponse]:
    """Simulate the structure under the outer force and the forces of all joints; return force and motion of each joint.

    Parameters
    ----------
    model
        Structure on which the joints act.
    lines
        Windowed spectrum of the recording.
    free : (n_padded_lines, n_joints), m
        Spectrum of the deflection of each joint under the outer force alone.
    ends
        For each joint: the weights of the responses whose sum is its deflection, (n_responses,), and the forces on the
        excitations per unit of its force, (n_excitations,).
    laws
        Law of each joint.
    """
    rate, n_record = lines.recording.rate, len(lines.recording.force)
    steps = steps_per_sample(model, rate)
    n, last, step = steps * lines.padded, steps * n_record, 1.0 / (steps * rate)
    spectrum = steps * np.ascontiguousarray(free.T)
    # after the recording the force of a joint changes nothing that is compared: it fades out
    end = min(n, last + last // 20)
    driven = np.ascontiguousarray(scipy.fft.irfft(spectrum, n=n)[:, :end])
    speed = np.ascontiguousarray(scipy.fft.irfft(2j * np.pi * lines.padded_frequencies * spectrum, n=n)[:, :end])
    written = (np.empty_like(driven), np.empty_like(driven), np.empty_like(driven))
    ramps = np.stack([stiffness_ramp(law, end, step, lines.recording.duration) for law in laws])
    _run(driven, speed, [joint_dynamics(model, way, step) for way in ends], (laws, ramps), written)
    fading = np.ones(end)
    fading[last:] = 0.5 + 0.5 * np.cos(np.pi * np.arange(end - last) / max(end - last, 1))
    spectra = scipy.fft.rfft(fading * written[0], n=n)[:, : len(free)] / steps
    motions = (np.pad(each, ((0, 0), (0, n - end))) for each in written[1:])
    return [JointResponse(force, x, v) for force, x, v in zip(spectra, *motions, strict=True)]


def _run(
    driven: Real,
    speed: Real,
    dynamics: Sequence[tuple[Complex, Complex, Complex, Complex, Complex]],
    laws: tuple[Sequence[JointLaw], Real],
    written: tuple[Real, Real, Real],
) -> None:
    """Simulate one joint, or several together, and write force, deflection and velocity, each (n_joints, n)."""
    (first, *others), ramps = laws
    if others:
        start, end, to_x, to_v = (np.stack([each[k] for each in dynamics]) for k in range(1, 5))
        free_runs(driven, speed, (dynamics[0][0], start, end, to_x, to_v), *_joined(laws[0], ramps), written)
        return
    spans, elements = (first.reach, first.speed), (first.springs, first.yields)
    force, x, v = written
    free_run(driven[0], speed[0], dynamics[0], first.tables(), spans, ramps[0], elements, (force[0], x[0], v[0]))


def _joined(laws: Sequence[JointLaw], ramps: Real) -> tuple[Any, Real, Any]:
    """Return tables, ramps and elements of several laws as the arguments of the compiled loop."""
    tables = [law.tables() for law in laws]
    first = np.cumsum([[0, 0], *([len(part) for part in both] for both in tables)], axis=0)
    joined = tuple(np.concatenate([both[side] for both in tables]) for side in range(2))
    spans = np.array([[law.reach, law.speed] for law in laws])
    elements = tuple(np.concatenate([getattr(law, name) for law in laws]) for name in ("springs", "yields"))
    return (joined, spans, first), ramps, (elements, np.cumsum([0, *(len(law.springs) for law in laws)]))


def driven_force(lines: WindowedSpectrum, deflection: Real, velocity: Real, law: JointLaw, *, often: int = 1) -> Real:
    """Return the joint's force (n,), N, for a prescribed motion, sampled at ``often`` times the recording's rate."""
    force = np.empty(len(deflection))
    ramp = stiffness_ramp(law, len(deflection), 1 / (often * lines.recording.rate), lines.recording.duration)
    driven_run(deflection, velocity, law.tables(), (law.reach, law.speed), ramp, (law.springs, law.yields), force)
    return force


def stiffness_ramp(law: JointLaw, n: int, step: float, duration: float) -> Real:
    """Return the change of stiffness (n,), N/m, at instants ``step`` s apart."""
    if law.ramp == 0.0 and law.bend == 0.0:
        return np.zeros(n)
    tau = np.minimum(np.arange(n) * step / duration, 1.0) - 0.5
    return np.asarray(law.ramp * tau + law.bend * (4 * tau**2 - 1))


def joint_dynamics(
    model: ModalModel, ends: tuple[Real, Real], step: float
) -> tuple[Complex, Complex, Complex, Complex, Complex]:
    """Return the factors of one time step of the modal coordinates, ``q' = p q + left.b g``, under a joint force g.

    The step of ``step`` s is exact if g changes linearly within it. ``ends`` are those of one joint in
    :func:`joint_responses`. The result is the argument ``dynamics`` of
    :func:`millfrf.mismatch.joints.time_loops.free_run`.
    """
    poles = model.poles
    z = poles * step
    decay = np.exp(z)
    total = (decay - 1) / poles
    end = (decay - 1 - z) / (poles * z)
    to_x, push = model.right @ ends[0], model.left @ ends[1]
    return decay, (total - end) * push, end * push, to_x, to_x * poles
