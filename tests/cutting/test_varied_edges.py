"""Helix, pitch and immersion: closed forms against quadrature, invariants, cutting files."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from millfrf.core import FileFormatError, InputError
from millfrf.cutting import (
    EarlierMotions,
    EdgeForces,
    MillingProcess,
    PieceNodes,
    ProfileElement,
    add_edge_forces,
    average_directional_matrix,
    ball_profile,
    bull_nose_profile,
    damping_harmonics,
    directional_matrix,
    edge_slices,
    force_harmonics,
    immersion_angles,
    read_cutting_process,
    straight_profile,
    turn_harmonics,
    write_cutting_process,
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


def _shaped(**changes: object) -> MillingProcess:
    return _cutter(edge_angle=np.pi / 2, **changes)


def _summed(process: MillingProcess, angles: np.ndarray, depth: float) -> tuple[np.ndarray, np.ndarray]:
    forces = EdgeForces.of(process)
    nodes = PieceNodes(np.zeros(1), np.ones(1), 1.0, np.zeros(1), np.ones(1))
    cutting, normals = np.zeros((len(angles), 3, 3)), np.zeros((len(angles), 3, 3))
    none = EarlierMotions.empty(len(angles), 1, 0, np.arange(3), np.arange(3))
    add_edge_forces(angles, edge_slices(process, depth), forces, nodes, cutting, normals, none)
    return cutting, normals


PITCHES = tuple(np.radians([100.0, 125.0, 135.0]))


@given(angle=st.floats(0, 7), depth=st.floats(1e-3, 0.05), helix=st.floats(0.05, 1.2))
def test_helical_edge_is_the_mean_of_straight_slices(angle: float, depth: float, helix: float) -> None:
    process = _cutter(helix_angle=helix, pitch_angles=PITCHES)
    slices = 4000
    heights = (np.arange(slices) + 0.5) / slices
    mean = directional_matrix(process, angle - process.lag(depth) * heights).mean(axis=0)
    whole = _summed(process, np.array([angle]), depth)[0][0] / (depth * process.ktc)
    np.testing.assert_allclose(whole, mean, atol=12 * process.teeth / slices)


@given(depth=st.floats(1e-4, 0.03), helix=st.floats(0.0, 1.2))
def test_a_helix_does_not_change_the_mean_over_a_turn(depth: float, helix: float) -> None:
    process = _cutter(helix_angle=helix, pitch_angles=PITCHES)
    angles = (np.arange(6000) + 0.5) * 2 * np.pi / 6000
    mean = _summed(process, angles, depth)[0].mean(axis=0) / (depth * process.ktc)
    np.testing.assert_allclose(mean, average_directional_matrix(process), atol=3e-3)


def test_turn_harmonics_add_up_to_the_matrix_of_all_teeth() -> None:
    process = _cutter(pitch_angles=PITCHES)
    orders, count = np.array([-2, 0, 1, 5]), 40_000
    angles = (np.arange(count) + 0.5) * 2 * np.pi / count
    expected = np.einsum(
        "kn,nij->kij", np.exp(-1j * np.outer(orders, angles)) / count, directional_matrix(process, angles)
    )
    np.testing.assert_allclose(turn_harmonics(process, orders).sum(axis=0), expected, atol=3e-4)
    normals = _summed(process, angles, 1.0)[1]
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


@given(share=st.floats(0.05, 1.0))
def test_the_edge_of_a_ball_is_as_long_as_its_arc(share: float) -> None:
    process = _shaped(profile=ball_profile(0.01), start_angle=0.0, exit_angle=math.pi)
    depth = share * 5e-3
    assert edge_slices(process, depth).widths.sum() == pytest.approx(5e-3 * math.acos(1 - share), rel=1e-9)


def test_the_mean_force_of_a_ball_in_a_slot_is_that_of_the_closed_form() -> None:
    """With kac = 0 the mean of alpha_xy over a turn is ``- int sin(kappa) / 4 ds`` per tooth: the depth over 4."""
    process = _shaped(profile=ball_profile(0.01), start_angle=0.0, exit_angle=math.pi, kac=0.0)
    angles = (np.arange(3600) + 0.5) * 2 * np.pi / 3600
    mean = _summed(process, angles, 2e-3)[0].mean(axis=0)
    assert mean[0, 1] == pytest.approx(-process.ktc * 3 * 2e-3 / 4, rel=2e-3)


def test_a_slice_of_smaller_radius_enters_later() -> None:
    """The workpiece ends at ``y = R cos(start)``; on a disc of radius r this is ``acos(R cos(start) / r)``."""
    process = _shaped(profile=ball_profile(0.01), start_angle=1.0, exit_angle=2.5)
    slices = edge_slices(process, 5e-3)
    expected = np.arccos(np.clip(5e-3 * math.cos(1.0) / np.maximum(slices.radii, 1e-9), -1, 1))
    np.testing.assert_allclose(slices.starts, expected, atol=1e-9)
    assert slices.starts[0, 0] == 0.0


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ('shape = "bull-nose"', "corner_radius_m is missing"),
        ('shape = "ball"\ncorner_radius_m = 1e-3', "goes with shape = 'bull-nose' only"),
        ('shape = "bull-nose"\ncorner_radius_m = 6e-3', "at most half the diameter"),
        ('shape = "tapered"\ntaper_angle_deg = 95.0', "taper_angle_deg = 95"),
        ('shape = "cone"', "shape"),
        ("helix_angles_deg = [30.0, 35.0]", "give one per tooth"),
        ("serration_amplitude_m = 1e-4", "give both"),
    ],
)
def test_a_cutter_table_that_contradicts_itself_is_refused(tmp_path: Path, lines: str, said: str) -> None:
    path = tmp_path / "cut.toml"
    write_cutting_process(path, _shaped())
    path.write_text(path.read_text(encoding="utf-8") + "\n[cutter]\n" + lines + "\n", encoding="utf-8")
    with pytest.raises((InputError, FileFormatError), match=said):
        read_cutting_process(path)


@pytest.mark.parametrize(
    "shape",
    [
        {"profile": ball_profile(0.01)},
        {"profile": bull_nose_profile(0.01, 1e-3), "helix_angle": 0.5},
        {"profile": straight_profile(0.01, 0.8)},
        {"helix_angles": (0.5, 0.6, 0.7)},
        {"serration_amplitude": 1e-4, "serration_wavelength": 2e-3},
    ],
)
def test_a_shape_survives_its_file(tmp_path: Path, shape: dict[str, object]) -> None:
    process = _shaped(**shape)
    write_cutting_process(tmp_path / "cut.toml", process)
    again = read_cutting_process(tmp_path / "cut.toml")
    np.testing.assert_allclose(edge_slices(again, 4e-3).lags, edge_slices(process, 4e-3).lags, atol=1e-9)
    np.testing.assert_allclose(edge_slices(again, 4e-3).radii, edge_slices(process, 4e-3).radii, atol=1e-12)
    assert again.serration_amplitude == process.serration_amplitude


def test_elements_that_do_not_join_are_refused() -> None:
    with pytest.raises(InputError, match="begins at the radius 4 mm"):
        _shaped(profile=(ProfileElement(3e-3, 1.0, 1e-3), ProfileElement(4e-3, math.pi / 2)))


def test_a_depth_above_the_last_element_is_refused() -> None:
    process = _shaped(profile=(ProfileElement(5e-3, math.pi / 2, 3e-3),))
    with pytest.raises(InputError, match="above the cutter's last element"):
        edge_slices(process, 4e-3)


def test_runout_takes_the_tooth_behind_the_highest_out_of_the_cut() -> None:
    """Three teeth at 0, 120 and 240 deg have the offsets 1, -1/2 and -1/2 times the runout."""
    shares = _shaped(runout=8e-5).missed_shares
    assert shares[2] == 1.0
    assert shares[0] == shares[1] == 0.0
    assert _shaped(runout=8e-5).runout_decides
    assert not _shaped(runout=1e-5).runout_decides
