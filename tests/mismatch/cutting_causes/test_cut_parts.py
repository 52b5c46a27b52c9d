"""Parts of the comparison of cutting forces, each against a truth of its own."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from cutting import MillingProcess, damping_matrices, edge_matrices, read_cutting_process, write_cutting_process
from cutting.one_tooth import rigid_force
from foundation import InputError
from mismatch.adapters.cut import CutRecording, SpindleLaw
from mismatch.adapters.cut import physics as physics_folder
from mismatch.adapters.cut.force.computed_force import computed_force
from mismatch.adapters.cut.force.cut_view import view_of
from mismatch.adapters.cut.recordings.spindle_law import found_law
from mismatch.adapters.cut.recordings.tip_motion import TipMotion, integrated
from mismatch.inference.bounded_steps import least_squares_within

CUTTER = MillingProcess(
    3, 0.012, math.radians(70), 6e8, 0.3, 0.1, 0.3, 2.6, 1e-4, kte=2e4, kre=1e4, kae=3e3, runout=8e-6
)  # fmt: skip
LAW = SpindleLaw(0.5, 0.2, 90.0)
RATE, DEPTH = 20000.0, 1e-3


def _recording(motion: TipMotion | None = None) -> CutRecording:
    return CutRecording("r", RATE, np.zeros((20000, 3)), (0, 1, 2), motion, LAW, 0.1)


def _acting(process: MillingProcess, **numbers: float) -> list[tuple[physics_folder.CutPhysics, np.ndarray]]:
    library = physics_folder.library()
    stated = {name: cause.stated(process) for name, cause in library.items()}
    return [(cause, np.array([numbers[name]]) if name in numbers else stated[name]) for name, cause in library.items()]


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
    alpha = edge_matrices(plain, angles, DEPTH).sum(axis=0)
    theory = DEPTH * plain.ktc * np.einsum("npq,nq->np", alpha, moved - earlier)
    cutting_speed = LAW.speed * plain.diameter / 2
    rub = -DEPTH * 3e5 / cutting_speed * np.einsum("npq,nq->np", damping_matrices(plain, angles, DEPTH), speed)
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


def test_the_speed_is_found_from_the_forces_through_noise_and_sweep() -> None:
    rng = np.random.default_rng(5)
    times = np.arange(40000) / 4000.0
    for change in (0.0, 1.5):
        law = SpindleLaw(float(times[-1]) / 2, 1.0, 84.0, change)
        angles = law.angles(times)
        force = np.stack([np.cos(2 * angles) + 0.4 * np.cos(4 * angles), np.sin(2 * angles)], axis=1)
        noisy = force + 0.5 * rng.standard_normal(force.shape)
        stated = SpindleLaw(0.0, 0.0, 0.99 * float(law.speeds(np.zeros(1))[0]), change)
        found = found_law(noisy, 4000.0, stated, 2)
        assert found.speed == pytest.approx(law.speed, abs=0.05)
        assert found.change == pytest.approx(change, abs=0.02)
    with pytest.raises(InputError, match="no tooth passing within 2 % of 802"):
        found_law(rng.standard_normal((40000, 2)), 4000.0, SpindleLaw(0.0, 0.0, 84.0), 2)


def test_the_delay_of_a_sweep_turns_the_spindle_by_one_pitch() -> None:
    law, times = SpindleLaw(2.0, 0.3, 80.0, -4.0), np.linspace(0.5, 4.0, 9)
    lag = law.lag(times, math.pi)
    np.testing.assert_allclose(law.angles(times) - law.angles(times - lag), math.pi, rtol=1e-12)


def test_acceleration_is_integrated_to_displacement_and_velocity() -> None:
    times = np.arange(20000) / 2000.0
    wave = 2 * np.pi * 19.3
    acceleration = -(wave**2) * 1e-5 * np.sin(wave * times)[:, None]
    noisy = acceleration + 0.02 * acceleration.std() * np.random.default_rng(1).standard_normal(acceleration.shape)
    moved, speed = integrated(noisy, 2, 2000.0, 1.5)
    kept = slice(2000, 18000)
    np.testing.assert_allclose(moved[kept, 0], 1e-5 * np.sin(wave * times)[kept], atol=3e-7)
    np.testing.assert_allclose(speed[kept, 0], wave * 1e-5 * np.cos(wave * times)[kept], atol=3e-5)


def test_bounded_least_squares_agree_with_another_solver() -> None:
    rng = np.random.default_rng(7)
    for _ in range(20):
        matrix, aim = rng.standard_normal((30, 5)), rng.standard_normal(30)
        low, high = -0.1 * np.ones(5), 0.15 * np.ones(5)
        fit = least_squares_within(
            lambda x, m=matrix, b=aim: m @ x - b, lambda x, r, m=matrix: m, np.zeros(5), (low, high), gain=1e-10
        )
        expected = lsq_linear(matrix, aim, (low, high), tol=1e-12)
        assert fit.cost == pytest.approx(2 * expected.cost, rel=1e-6)


TOY = """
import numpy as np
from mismatch.cutting_causes.physics import CutPhysics
from mismatch.physics import Parameter


class Toy(CutPhysics):
    name = "toy_drag"

    def parameters(self, process):
        return (Parameter("drag_n_per_m", "N/m", 1e3),)

    def force(self, values, tooth):
        return np.array([values[0], 0.0, 0.0])


PHYSICS = Toy()
"""


def test_a_new_cause_is_one_file_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "toy_drag.py").write_text(TOY)
    monkeypatch.setattr(physics_folder, "__path__", [*physics_folder.__path__, str(tmp_path)])
    toy = physics_folder.library()["toy_drag"]
    view = view_of(_recording(), CUTTER, LAW, 1)
    added = computed_force(CUTTER, DEPTH, view, [(toy, np.array([5e3]))]) - computed_force(CUTTER, DEPTH, view, ())
    assert added[:, 0].max() >= 5.0 - 1e-9
    assert toy.told(np.array([1.0]), np.eye(1), CUTTER) == ({"drag_n_per_m": 1.0}, {"drag_n_per_m": 1.0})


def test_a_written_cutting_file_reads_back(tmp_path: Path) -> None:
    for process in (
        replace(CUTTER, process_damping=2.5e5),
        replace(CUTTER, helix_angle=0.5, pitch_angles=(2.0, 2.2, 2 * math.pi - 4.2)),
    ):
        write_cutting_process(tmp_path / "cut.toml", process, ["made for a test"])
        again = read_cutting_process(tmp_path / "cut.toml")
        for name in MillingProcess.__dataclass_fields__:
            assert getattr(again, name) == pytest.approx(getattr(process, name), rel=1e-9), name
