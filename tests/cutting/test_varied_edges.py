"""Helix, pitch and immersion: closed forms against quadrature, invariants, cutting files."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from millfrf.core import FileFormatError, InputError
from millfrf.cutting import (
    MillingProcess,
    average_directional_matrix,
    damping_harmonics,
    damping_matrices,
    directional_matrix,
    edge_matrices,
    force_harmonics,
    immersion_angles,
    read_cutting_process,
    turn_harmonics,
)
from millfrf.cutting.tooth import rigid_force


def _cutter(**changes: object) -> MillingProcess:
    values: dict[str, object] = {
        "teeth": 3,
        "diameter": 0.01,
        "edge_angle": 1.3,
        "ktc": 2e8,
        "krc": 0.3,
        "kac": 0.1,
        "start_angle": 0.4,
        "exit_angle": 2.5,
        "feed_per_tooth": 1e-4,
    }
    return MillingProcess(**(values | changes))  # type: ignore[arg-type]


PITCHES = tuple(np.radians([100.0, 125.0, 135.0]))


@given(angle=st.floats(0, 7), depth=st.floats(1e-3, 0.05), helix=st.floats(0.05, 1.2))
def test_helical_edge_is_the_mean_of_straight_slices(angle: float, depth: float, helix: float) -> None:
    process = _cutter(helix_angle=helix, pitch_angles=PITCHES)
    slices = 4000
    heights = (np.arange(slices) + 0.5) / slices
    mean = directional_matrix(process, angle - process.lag(depth) * heights).mean(axis=0)
    whole = edge_matrices(process, np.array([angle]), depth).sum(axis=0)[0]
    np.testing.assert_allclose(whole, mean, atol=12 * process.teeth / slices)


@given(depth=st.floats(1e-4, 0.03), helix=st.floats(0.0, 1.2))
def test_a_helix_does_not_change_the_mean_over_a_turn(depth: float, helix: float) -> None:
    process = _cutter(helix_angle=helix, pitch_angles=PITCHES)
    angles = (np.arange(6000) + 0.5) * 2 * np.pi / 6000
    mean = edge_matrices(process, angles, depth).sum(axis=0).mean(axis=0)
    np.testing.assert_allclose(mean, average_directional_matrix(process), atol=3e-3)


def test_turn_harmonics_add_up_to_the_matrix_of_all_teeth() -> None:
    process = _cutter(pitch_angles=PITCHES)
    orders, count = np.array([-2, 0, 1, 5]), 40_000
    angles = (np.arange(count) + 0.5) * 2 * np.pi / count
    expected = np.einsum(
        "kn,nij->kij", np.exp(-1j * np.outer(orders, angles)) / count, directional_matrix(process, angles)
    )
    np.testing.assert_allclose(turn_harmonics(process, orders).sum(axis=0), expected, atol=3e-4)
    normals = damping_matrices(process, angles, 0.0)
    expected = np.einsum("kn,nij->kij", np.exp(-1j * np.outer(orders, angles)) / count, normals)
    np.testing.assert_allclose(damping_harmonics(process, orders), expected, atol=3e-4)


def test_each_tooth_follows_its_predecessor_by_its_pitch() -> None:
    process = _cutter(pitch_angles=PITCHES)
    ahead = np.array(process.tooth_angles)
    np.testing.assert_allclose(np.append(np.diff(ahead), 2 * np.pi - ahead[-1]), PITCHES)


@given(share=st.floats(0.01, 1.0))
def test_up_and_down_milling_are_mirror_images_and_full_immersion_is_a_slot(share: float) -> None:
    up, down = immersion_angles("up", share * 0.02, 0.02), immersion_angles("down", share * 0.02, 0.02)
    np.testing.assert_allclose(np.pi - np.array(down)[::-1], up)
    start, leave = immersion_angles("central", share * 0.02, 0.02)
    assert np.sin(leave - np.pi / 2) - np.sin(start - np.pi / 2) == pytest.approx(2 * share)
    np.testing.assert_allclose(immersion_angles("up", 0.02, 0.02), immersion_angles("slot", 0.0, 0.02))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"helix_angle": 2.0}, "helix angle 114"),
        ({"pitch_angles": (1.0, 2.0)}, "2 pitch angles for 3 teeth"),
        ({"pitch_angles": (1.0, 2.0, 3.0)}, "add up to 360"),
        ({"process_damping": -1.0}, r"process_damping = -1\.0"),
    ],
)
def test_absurd_edges_are_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        _cutter(**changes)


def test_forces_of_a_rigid_tool_refuse_what_they_would_get_wrong() -> None:
    for process, words in ((_cutter(helix_angle=0.5), "helical"), (_cutter(pitch_angles=PITCHES), "unequal")):
        with pytest.raises(InputError, match=words):
            rigid_force(process, 1e-3, np.zeros(1))
        with pytest.raises(InputError, match=words):
            force_harmonics(process, 2)


HEAD = "[cutting]\nteeth = 3\ndiameter_m = 0.01\nktc_pa = 2e8\nkrc = 0.3\n"


def test_cutting_file_takes_immersion_helix_pitch_and_damping(tmp_path: Path) -> None:
    path = tmp_path / "cut.toml"
    path.write_text(
        HEAD + 'immersion = "down"\nradial_depth_m = 0.005\nhelix_angle_deg = 30.0\n'
        "pitch_angles_deg = [100.0, 120.0, 140.0]\nprocess_damping_n_per_m = 2e4\n"
    )
    process = read_cutting_process(path)
    assert np.degrees([process.start_angle, process.exit_angle]) == pytest.approx([90, 180])
    assert np.degrees([process.helix_angle, *process.pitches]) == pytest.approx([30, 100, 120, 140])
    assert process.process_damping == 2e4


@pytest.mark.parametrize(
    ("line", "error", "message"),
    [
        ('immersion = "down"', InputError, "needs radial_depth_m"),
        ('immersion = "sideways"\nradial_depth_m = 0.001', InputError, "'sideways' is not known"),
        ('immersion = "up"\nradial_depth_m = 0.02', InputError, "at most the diameter"),
        ('immersion = "slot"\nstart_angle_deg = 0.0', InputError, "not both"),
        ("start_angle_deg = 0.0", FileFormatError, "exit_angle_deg is missing"),
    ],
)
def test_engagement_that_does_not_add_up_is_refused(
    tmp_path: Path, line: str, error: type[Exception], message: str
) -> None:
    path = tmp_path / "cut.toml"
    path.write_text(HEAD + line + "\n")
    with pytest.raises(error, match=message):
        read_cutting_process(path)
