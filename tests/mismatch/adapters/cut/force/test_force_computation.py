"""The computed force against the rigid one, and against the matrices of stability theory."""

import math
from dataclasses import replace

import numpy as np

from millfrf.cutting import MillingProcess, chip_direction, directional_matrix
from millfrf.cutting.tooth import rigid_force
from millfrf.mismatch import CutPhysics
from millfrf.mismatch.cut.hypothesis import computed_force, view_of
from millfrf.mismatch.cut.motion import SpindleLaw, TipMotion
from millfrf.mismatch.cut.physics import cut_library
from millfrf.mismatch.cut.recordings import CutRecording

CUTTER = MillingProcess(
    3, 0.012, math.radians(70), 6e8, 0.3, 0.1, 0.3, 2.6, 1e-4, kte=2e4, kre=1e4, kae=3e3, runout=8e-6
)  # fmt: skip
LAW = SpindleLaw(0.5, 0.2, 90.0)
RATE, DEPTH = 20000.0, 1e-3


def _recording(motion: TipMotion | None = None) -> CutRecording:
    return CutRecording("r", RATE, np.zeros((20000, 3)), (0, 1, 2), motion, LAW, 0.1)


def _acting(process: MillingProcess, **numbers: float) -> list[tuple[CutPhysics, np.ndarray]]:
    causes = cut_library()
    stated = {name: cause.stated(process) for name, cause in causes.items()}
    return [(cause, np.array([numbers[name]]) if name in numbers else stated[name]) for name, cause in causes.items()]


def test_without_motion_the_force_is_the_rigid_one_with_runout() -> None:
    view = view_of(_recording(), CUTTER, LAW, 1)
    times = np.arange(20000) / RATE
    inside = np.ones(20000, dtype=bool)
    for tooth in view.teeth:  # apart from entry and exit, which the rigid force does not share out
        inside[tooth.index[tooth.share < 1 - 1e-9]] = False
    got = computed_force(CUTTER, DEPTH, view, _acting(CUTTER))
    expected = rigid_force(CUTTER, DEPTH, LAW.angles(times))
    np.testing.assert_allclose(got[inside], expected[inside], atol=1e-9 * np.abs(expected).max())
    assert inside.mean() > 0.9


def test_small_motion_gives_the_matrices_of_stability_theory() -> None:
    """Delayed feedback is ``a Ktc alpha (x - x_tau)``, process damping ``-a (C / V) P x'``, as lobes are made of."""
    rng = np.random.default_rng(3)
    times = np.arange(20000) / RATE
    waves = 2 * np.pi * np.array([31.0, 47.0, 83.0])
    size, phase = 1e-8 * rng.standard_normal(3), rng.uniform(0, 6, 3)
    moved = size * np.sin(waves * times[:, None] + phase)
    speed = size * waves * np.cos(waves * times[:, None] + phase)
    plain = replace(CUTTER, runout=0.0)
    view = view_of(_recording(TipMotion(moved, speed, "measured")), plain, LAW, 1)
    rigid = computed_force(plain, DEPTH, view, _acting(plain))
    feedback = computed_force(plain, DEPTH, view, _acting(plain, regenerative_feedback=1.0)) - rigid
    rubbing = computed_force(plain, DEPTH, view, _acting(plain, process_damping=3e5)) - rigid
    angles = LAW.angles(times)
    earlier = size * np.sin(waves * (times - 2 * np.pi / 3 / LAW.speed)[:, None] + phase)
    alpha = directional_matrix(plain, angles)
    theory = DEPTH * plain.ktc * np.einsum("npq,nq->np", alpha, moved - earlier)
    cutting_speed = LAW.speed * plain.diameter / 2
    rub = np.zeros_like(speed)
    for ahead in plain.tooth_angles:
        phi = np.mod(angles + ahead, 2 * np.pi)
        normal = chip_direction(plain, phi) * ((phi >= plain.start_angle) & (phi < plain.exit_angle))[:, None]
        rub -= DEPTH * 3e5 / cutting_speed * normal * (normal * speed).sum(axis=1)[:, None]
    inside = np.ones(20000, dtype=bool)
    inside[:2000] = False
    for tooth in view.teeth:
        inside[tooth.index[tooth.share < 1 - 1e-9]] = False
    np.testing.assert_allclose(feedback[inside], theory[inside], atol=2e-3 * np.abs(theory).max())
    np.testing.assert_allclose(rubbing[inside], rub[inside], atol=1e-6 * np.abs(rub).max())


def test_a_tooth_that_misses_leaves_the_next_one_a_double_chip() -> None:
    jumping = replace(CUTTER, teeth=2, runout=1e-3)  # one tooth is out of the cut altogether
    view = view_of(_recording(), jumping, LAW, 1)
    once = computed_force(replace(jumping, teeth=1, feed_per_tooth=2e-4), DEPTH, view_of(
        _recording(), replace(jumping, teeth=1, feed_per_tooth=2e-4), LAW, 1), ())  # fmt: skip
    both = computed_force(jumping, DEPTH, view, _acting(jumping))
    np.testing.assert_allclose(both, once, atol=1e-9 * np.abs(once).max())
