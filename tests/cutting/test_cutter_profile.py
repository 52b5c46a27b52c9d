"""Profiles of cutters, the table ``[cutter]`` and the sliced edges: geometry, closed forms, round trips."""

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
    ball_profile,
    bull_nose_profile,
    edge_matrices,
    edge_slices,
    read_cutting_process,
    straight_profile,
    write_cutting_process,
)


def _cutter(**changes: object) -> MillingProcess:
    values: dict[str, object] = {
        "teeth": 3,
        "diameter": 0.01,
        "edge_angle": math.pi / 2,
        "ktc": 2e8,
        "krc": 0.3,
        "kac": 0.1,
        "start_angle": 0.4,
        "exit_angle": 2.5,
        "feed_per_tooth": 1e-4,
    }
    return MillingProcess(**(values | changes))  # type: ignore[arg-type]


def _summed(process: MillingProcess, angles: np.ndarray, depth: float) -> tuple[np.ndarray, np.ndarray]:
    forces = EdgeForces(
        np.array(process.tooth_angles),
        np.array(process.pitches),
        process.ktc * np.array([1.0, process.krc, process.kac]),
        0.0,
    )
    nodes = PieceNodes(np.zeros(1), np.ones(1), 1.0, np.zeros(1), np.ones(1))
    empty = np.zeros(0, dtype=np.int64)
    cutting, normals = np.zeros((len(angles), 3, 3)), np.zeros((len(angles), 3, 3))
    none = EarlierMotions(empty, empty, np.zeros((0, 3, 1, 3)))
    add_edge_forces(angles, edge_slices(process, depth), forces, nodes, cutting, normals, none)
    return cutting, normals


@given(angle=st.floats(0, 7), depth=st.floats(1e-3, 0.03), helix=st.floats(0.05, 1.2))
def test_slices_of_a_helical_edge_add_up_to_its_closed_form(angle: float, depth: float, helix: float) -> None:
    process = _cutter(helix_angle=helix, edge_angle=1.3)
    expected = depth * process.ktc * edge_matrices(process, np.array([angle]), depth).sum(axis=0)
    np.testing.assert_allclose(_summed(process, np.array([angle]), depth)[0], expected, atol=1e-8 * depth * process.ktc)


@given(share=st.floats(0.05, 1.0))
def test_the_edge_of_a_ball_is_as_long_as_its_arc(share: float) -> None:
    process = _cutter(profile=ball_profile(0.01), start_angle=0.0, exit_angle=math.pi)
    depth = share * 5e-3
    assert edge_slices(process, depth).widths.sum() == pytest.approx(5e-3 * math.acos(1 - share), rel=1e-9)


def test_the_mean_force_of_a_ball_in_a_slot_is_that_of_the_closed_form() -> None:
    """With kac = 0 the mean of alpha_xy over a turn is ``- int sin(kappa) / 4 ds`` per tooth: the depth over 4."""
    process = _cutter(profile=ball_profile(0.01), start_angle=0.0, exit_angle=math.pi, kac=0.0)
    angles = (np.arange(3600) + 0.5) * 2 * np.pi / 3600
    mean = _summed(process, angles, 2e-3)[0].mean(axis=0)
    assert mean[0, 1] == pytest.approx(-process.ktc * 3 * 2e-3 / 4, rel=2e-3)


def test_a_slice_of_smaller_radius_enters_later() -> None:
    """The workpiece ends at ``y = R cos(start)``; on a disc of radius r this is ``acos(R cos(start) / r)``."""
    process = _cutter(profile=ball_profile(0.01), start_angle=1.0, exit_angle=2.5)
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
    write_cutting_process(path, _cutter())
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
    process = _cutter(**shape)
    write_cutting_process(tmp_path / "cut.toml", process)
    again = read_cutting_process(tmp_path / "cut.toml")
    np.testing.assert_allclose(edge_slices(again, 4e-3).lags, edge_slices(process, 4e-3).lags, atol=1e-9)
    np.testing.assert_allclose(edge_slices(again, 4e-3).radii, edge_slices(process, 4e-3).radii, atol=1e-12)
    assert again.serration_amplitude == process.serration_amplitude


def test_elements_that_do_not_join_are_refused() -> None:
    with pytest.raises(InputError, match="begins at the radius 4 mm"):
        _cutter(profile=(ProfileElement(3e-3, 1.0, 1e-3), ProfileElement(4e-3, math.pi / 2)))


def test_a_depth_above_the_last_element_is_refused() -> None:
    process = _cutter(profile=(ProfileElement(5e-3, math.pi / 2, 3e-3),))
    with pytest.raises(InputError, match="above the cutter's last element"):
        edge_slices(process, 4e-3)


def test_runout_takes_the_tooth_behind_the_highest_out_of_the_cut() -> None:
    """Three teeth at 0, 120 and 240 deg have the offsets 1, -1/2 and -1/2 times the runout."""
    shares = _cutter(runout=8e-5).missed_shares
    assert shares[2] == 1.0
    assert shares[0] == shares[1] == 0.0
    assert _cutter(runout=8e-5).runout_decides
    assert not _cutter(runout=1e-5).runout_decides
