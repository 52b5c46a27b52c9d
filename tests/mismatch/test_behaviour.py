"""The behaviour of modes by level is told from signs and errors, whatever law stands behind it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from estimation import BandRecording, windowed_spectrum
from millfrf.figures import behaviour_figure
from millfrf.mismatch import Behaviour, Hypothesis, ModelShape, Settings, behaviour_of, fit

from .one_mode_rig import Rig

Real = NDArray[np.float64]
LEVELS = (20.0, 40.0, 60.0)


@dataclass(frozen=True)
class Joint(Rig):
    """The rig with a force ``law(x, v)`` instead of the cubic, and Jenkins elements of stiffness and limit each."""

    law: Callable[[float, float], float] = lambda x, v: 0.0
    slip_stiffness: float = 0.0
    slip_limits: tuple[float, ...] = ()

    def motion(self, force: Real) -> tuple[Real, Real, Real]:
        """Deflection, velocity and acceleration from rest by the symplectic Euler method in small steps."""
        n, fine, m, k = len(force), 48, self.mass, self.stiffness
        c, h = 2 * self.damping * np.sqrt(k * m), 1 / (fine * self.rate)
        pushed = (np.fft.irfft(np.fft.rfft(force), n=fine * n) * fine).tolist()
        x, v, result, held = 0.0, 0.0, np.empty((n, 3)), [0.0] * len(self.slip_limits)
        for j, push in enumerate(pushed):
            a = (push - c * v - k * x - self.law(x, v) - self.slip_stiffness * sum(held)) / m
            if j % fine == 0:
                result[j // fine] = x, v, a
            v += h * a
            x += h * v
            held = [min(max(z + h * v, -limit), limit) for z, limit in zip(held, self.slip_limits, strict=True)]
        return result[:, 0], result[:, 1], result[:, 2]


RIG = Joint()
SIZE, SPEED = (float(np.std(one)) for one in Rig().motion(Rig().forces(60.0, 20.0, 99))[:2])
DAMPER = 2 * RIG.damping * float(np.sqrt(RIG.stiffness * RIG.mass))


def seen_in(rig: Rig, levels: tuple[float, ...] = LEVELS, believed: Rig | None = None, seed: int = 0) -> Behaviour:
    """Behaviour of the rig's recordings, from the modal model refitted to all of them."""
    recordings = [
        rig.recording(f"level_{k + 1}", rig.forces(level, 30.0, seed + k), seed=seed + k)
        for k, level in enumerate(levels)
    ]
    return told_of(recordings, believed or rig)


def told_of(recordings: list[BandRecording], believed: Rig) -> Behaviour:
    model = believed.model
    decay = float((-model.poles.real).min())
    lines = [windowed_spectrum(each, (3.0, 25.0), decay) for each in recordings]
    shape = ModelShape(model, Settings().lab)
    base = fit(lines, Hypothesis(shape, np.zeros(shape.size)), iterations=30)
    return behaviour_of(base.hypothesis, lines)


def cubic(share: float) -> Callable[[float, float], float]:
    """A cubic spring of a share of the stiffness at the linear motion; it saturates before the rig buckles."""
    k3 = share * RIG.stiffness / (3 * SIZE**2)
    return lambda x, v: k3 * x**3 / (1 + max(-share, 0.0) * x * x / SIZE**2)


@pytest.mark.long
@pytest.mark.parametrize(
    ("family", "law"),
    [
        ("hardening", cubic(0.1)),
        ("softening", cubic(-0.02)),
        ("dry", lambda x, v: 0.5 * DAMPER * SPEED * float(np.tanh(v / (0.05 * SPEED)))),
        ("viscous", lambda x, v: 0.5 * DAMPER / SPEED * v * abs(v)),
    ],
)
def test_families_of_laws_are_told_from_levels(family: str, law: Callable[[float, float], float]) -> None:
    result = seen_in(replace(RIG, law=law))
    assert result.family == family, result.sentence
    behaviour_figure(result)


def test_microslip_softens_and_gains_damping() -> None:
    # five elements that slip one after the other, as in a bolted joint, of a twentieth of the stiffness
    rig = Joint(damping=0.01, slip_stiffness=0.04 * RIG.stiffness)
    size = float(np.std(rig.motion(rig.forces(20.0, 20.0, 99))[0]))
    slips = replace(rig, slip_limits=tuple(size * np.array([1, 2, 4, 8, 16])))
    result = seen_in(slips, (10.0, 20.0, 40.0), Rig(frequency=10 * np.sqrt(1.2), damping=0.01))
    assert result.family in ("slip", "softening or slip"), result.sentence
    mode = result.modes[0]
    assert mode.shift < -4 * mode.shift_error
    assert mode.gain > 3 * mode.gain_error


@pytest.mark.long
def test_a_linear_rig_moves_nowhere() -> None:
    stated = [seen_in(Rig(), seed=10 * seed) for seed in range(12)]
    assert [each.family for each in stated] == ["none"] * 12
    sigmas = [abs(each.modes[0].shift / each.modes[0].shift_error) for each in stated]
    assert 0.2 < float(np.median(sigmas)) < 1.5  # of errors that are neither blown up nor too small


def test_one_level_cannot_tell() -> None:
    result = seen_in(Rig(), (30.0, 30.0, 31.0))
    assert result.family == "cannot tell"
    assert "one level" in result.sentence


@pytest.mark.long
def test_a_drift_at_one_level_is_no_matter_of_the_level() -> None:
    rig = Rig()
    force = rig.forces(30.0, 120.0, 5)
    pieces = [
        replace(rig, frequency=rig.frequency * (1 - 0.004 * k)).recording(f"part_{k}", force, seed=k) for k in range(9)
    ]
    # each ninth of the record belongs to a slightly softer rig
    ends = np.linspace(0, len(force), 10).astype(int)
    response = np.concatenate([each.response[a:b] for each, a, b in zip(pieces, ends[:-1], ends[1:], strict=True)])
    result = told_of([replace(pieces[0], response=response)], rig)
    assert result.family == "drift", result.sentence
    assert result.modes[0].drift == pytest.approx(-0.036, abs=0.015)


def test_numbers_stand_in_the_file_and_nothing_is_raised() -> None:
    rig = Rig()
    result = seen_in(rig)
    assert result.content()["modes"][0]["family"] == result.modes[0].family
    short = rig.recording("short", rig.forces(20.0, 1.0, 3))
    assert told_of([short, replace(short, name="again")], rig).family == "cannot tell"


def test_a_mode_that_no_response_shows_has_wide_errors() -> None:
    """A sensor at a node sees nothing of a mode: only the prior bounds its frequency."""
    linear = RIG.model
    pole = 1.6 * linear.poles[0]
    model = replace(
        linear,
        poles=np.append(linear.poles, pole),
        right=np.vstack([linear.right, np.full((1, 1), 1e-17)]),
        left=np.vstack([linear.left, linear.left]),
    )
    recordings = [RIG.recording(f"level_{k}", RIG.forces(level, 30.0, k), seed=k) for k, level in enumerate(LEVELS)]
    lines = [windowed_spectrum(recording, (3.0, 25.0), -float(linear.poles[0].real)) for recording in recordings]
    shape = ModelShape(model, Settings().lab)
    behaviour = behaviour_of(Hypothesis(shape, np.zeros(shape.size)), lines)
    assert behaviour.family in ("none", "cannot tell"), behaviour.sentence
    seen, unseen = behaviour.modes
    assert unseen.shift_error > 100 * seen.shift_error
