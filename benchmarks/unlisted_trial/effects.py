"""Hidden effects: laws in the structure and faults of the measuring chain, with the names that describe them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from .rigs import RATE, SECONDS, Real

if TYPE_CHECKING:
    from .cases import Case

Change = Callable[[Real, Real, Real, "Case"], tuple[Real, Real]]  # forces, responses, seconds, case


def _saturated(force: Real, shown: Real, t: Real, case: "Case") -> tuple[Real, Real]:
    """Limit of an amplifier that needs some milliseconds to recover."""
    y, limit = shown.copy(), 0.98 * (1 - case.dial) * case.peak
    until, hold = 0, int((4 + 16 * case.u[0]) * 1e-3 * RATE)
    for i in range(1, len(y)):
        if abs(y[i, 0]) > limit:
            until, y[i, 0] = i + hold, np.clip(y[i, 0], -limit, limit)
        elif i < until:
            y[i, 0] = 0.9 * y[i - 1, 0] + 0.1 * y[i, 0]
    return force, y


def _slew(force: Real, shown: Real, t: Real, case: "Case") -> tuple[Real, Real]:
    y, most = shown.copy(), 0.98 * (1 - case.dial) * case.steepest
    for i in range(1, len(y)):
        y[i, 0] = y[i - 1, 0] + np.clip(y[i, 0] - y[i - 1, 0], -most, most)
    return force, y


def _jitter(force: Real, shown: Real, t: Real, case: "Case") -> tuple[Real, Real]:
    moved = t + 1e-3 * case.dial * case.noise(len(t))
    return force, np.asarray(scipy.interpolate.make_interp_spline(t, shown, k=5)(np.clip(moved, t[0], t[-1])))


def _dropped(force: Real, shown: Real, t: Real, case: "Case") -> tuple[Real, Real]:
    """Lost samples move what follows; the recording's end repeats its last sample."""
    drops = np.sort(case.generator.integers(0, len(t), 3 + int(5 * case.u[0])))
    lost = np.searchsorted(drops, np.arange(len(t))) * max(1, round(20 * case.dial))
    return force, shown[np.minimum(np.arange(len(t)) + lost, len(t) - 1)]


def _rounded(force: Real, shown: Real, t: Real, case: "Case") -> tuple[Real, Real]:
    step, dither = case.dial * case.rms, case.generator.random((2, *shown.shape)).sum(axis=0) - 1
    return force, step * np.round(shown / step + dither)


def _warm_up(force: Real, shown: Real, t: Real, case: "Case") -> tuple[Real, Real]:
    gain = np.ones_like(shown)
    gain[:, 0] += case.dial * np.exp(-(t + SECONDS * case.run) / (10 + 20 * case.u[0]))
    return force, shown * gain


def _intermittent(force: Real, shown: Real, t: Real, case: "Case") -> tuple[Real, Real]:
    gain = np.ones_like(shown)
    for start in case.generator.integers(0, len(t), 15 + int(20 * case.u[0])):
        gain[start : start + int(RATE * case.generator.uniform(0.01, 0.08)), 0] = 1 - case.dial
    return force, shown * gain


def _cross_axis(force: Real, shown: Real, t: Real, case: "Case") -> tuple[Real, Real]:
    low, high = case.rig.band
    corner = low + (high - low) * case.u[0]
    filtered = scipy.signal.lfilter(*scipy.signal.butter(1, corner, "high", fs=RATE), shown[:, 1])
    return force, shown + case.dial * np.column_stack([filtered, *np.zeros((shown.shape[1] - 1, len(t)))])


def _scale(force: Real, shown: Real, t: Real, case: "Case") -> tuple[Real, Real]:
    return force, shown * np.r_[1 + case.dial * (case.run == 1), np.ones(shown.shape[1] - 1)]


def _polarity(force: Real, shown: Real, t: Real, case: "Case") -> tuple[Real, Real]:
    return force, shown * np.r_[1 - 2.0 * (case.run == 1), np.ones(shown.shape[1] - 1)]


def _hum(force: Real, shown: Real, t: Real, case: "Case") -> tuple[Real, Real]:
    low, high = case.rig.band
    wander = np.cumsum(case.noise(len(t))) / np.sqrt(RATE) * 0.6 * (0.3 + case.u[1])
    phase = 2 * np.pi * np.cumsum(low + (high - low) * (0.2 + 0.6 * case.u[0]) + wander) / RATE
    return force, shown + case.dial * case.rms * np.cos(phase)[:, None] * np.linspace(1, 0.5, shown.shape[1])


def _low_pass(force: Real, shown: Real, t: Real, case: "Case") -> tuple[Real, Real]:
    ratio = scipy.signal.butter(2, 900 / (1 + 10 * case.dial), fs=RATE)
    return force, np.asarray(scipy.signal.lfilter(*ratio, shown, axis=0))


def _quadratic(force: Real, shown: Real, t: Real, case: "Case") -> tuple[Real, Real]:
    return force, shown + case.dial * shown**2 / case.rms * np.eye(shown.shape[1])[0]


def _rattle(force: Real, shown: Real, t: Real, case: "Case") -> tuple[Real, Real]:
    """A loose sensor rings each time when its motion exceeds a limit."""
    above = np.abs(shown[:, 0]) > (1 + case.u[0]) * case.rms
    blows = np.diff(above.astype(float), prepend=0.0).clip(0) * shown[:, 0]
    s, hz = np.arange(int(0.1 * RATE)) / RATE, case.rig.band[1] * (0.4 + 0.5 * case.u[1])
    ring = np.exp(-s / 0.015) * np.sin(2 * np.pi * hz * s)
    y = shown.copy()
    y[:, 0] += 2 * case.dial * np.convolve(blows, ring)[: len(y)]
    return force, y


def _feedthrough(force: Real, shown: Real, t: Real, case: "Case") -> tuple[Real, Real]:
    slope = np.gradient(force[:, 0])
    return force, shown + case.dial * case.rms * (slope / slope.std())[:, None] * np.eye(shown.shape[1])[0]


@dataclass(frozen=True)
class Effect:
    """An effect: the number of its law or its change of the signals, and the names that describe the same physics."""

    name: str
    allowed: tuple[str, ...]
    code: int = 0
    change: Change | None = None
    course: str = ""  # what the stiffness or the mass follows
    most: float = 1.0
    needs: tuple[str, ...] = ()  # rig, excitation, "two" responses; empty: any


SOFT, HARD, LINEAR = "stiffness_softening", "stiffness_hardening", ("modal_parameters", "non_proportional_damping")
FRICTION = ("coulomb_friction", "hysteresis")
EFFECTS = (
    Effect("stiffness recovers after warming", ("pose_drift",), 1, course="recovery", most=0.5),
    Effect("parametric excitation", (), 1, course="sine", most=0.6),
    Effect("stiffness follows spindle speed", ("speed_stiffness",), 1, course="speed", most=0.6, needs=("", "teeth")),
    Effect("stiffness follows the rail's position", ("pose_drift",), 1, course="rail", most=0.6, needs=("rail",)),
    Effect("mass grows and is drained (coolant)", (), 2, course="recovery", most=0.4),
    Effect("mass differs between recordings", (), 2, course="run", most=0.5),
    Effect("contact opens beyond a load", (SOFT,), 3, most=0.9),
    Effect("pendulum", (SOFT,), 4),
    Effect("magnets", (SOFT,), 5, most=0.6),
    Effect("air spring", (HARD,), 6),
    Effect("viscoelastic relaxation", LINEAR, 7),
    Effect("stop on one side", (HARD, "backlash"), 8),
    Effect("friction by position", FRICTION, 9, most=0.5),
    Effect("stiffness heated by its own loss", ("pose_drift", SOFT), 10, most=0.7),
    Effect("second structure in a loose coupling", ("missing_mode",), 11, most=0.3),
    Effect("feedback with dead time", LINEAR, 12, most=0.5),
    Effect("drag that falls with speed", (), 13, most=0.5),
    Effect("play beside the working point", ("backlash", SOFT, HARD), 14, most=0.8),
    Effect("geometric coupling of directions", (), 15),
    Effect("friction under the spring force", FRICTION, 16, most=0.5),
    Effect("saturation with recovery", ("clipping",), change=_saturated, most=0.8),
    Effect("slew rate limit", (), change=_slew),
    Effect("sample jitter", (), change=_jitter),
    Effect("dropped samples", ("clock_skew", "channel_delay"), change=_dropped),
    Effect("rounding with dither", ("quantisation",), change=_rounded),
    Effect("amplifier warms up", ("gain_error",), change=_warm_up),
    Effect("intermittent cable", (), change=_intermittent),
    Effect("cross-axis amplifier", ("channel_coupling", "cross_talk"), change=_cross_axis, needs=("arm", "", "two")),
    Effect("wrong scale in one file", ("gain_error",), change=_scale),
    Effect("polarity in one file", ("reversed_channel",), change=_polarity),
    Effect("hum of drifting frequency", ("unmeasured_excitation",), change=_hum),
    Effect("anti-alias filter", ("channel_delay", "transducer_resonance"), change=_low_pass),
    Effect("quadratic error of a sensor", (), change=_quadratic),
    Effect("loose sensor rattles", ("transducer_resonance",), change=_rattle),
    Effect("force amplifier couples into a sensor", (), change=_feedthrough),
)
NOTHING = Effect("nothing", ())
RIGS = ("arm", "beam", "rail", "base", "arm")
DRIVES: dict[str, tuple[str, ...]] = {
    "arm": ("teeth", "random", "multisine", "hammer"),
    "beam": ("sweep", "hammer", "random", "multisine"),
}
DRIVES |= {"rail": ("slow drive", "steps", "random"), "base": ("sweep", "random", "multisine")}
