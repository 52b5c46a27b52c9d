"""Tool paths: axes of the cut, frames from tool axes, files."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from millfrf.core import FileFormatError, InputError
from millfrf.robot_model import RotaryTable, attitudes_along, cut_path, path_segments, read_cut_path, tool_down


def test_axes_are_those_of_a_vertical_tool() -> None:
    for feed in (0.0, 0.7, 2.5):
        steps = np.outer(np.linspace(0, 0.2, 4), [np.cos(feed), np.sin(feed), 0.0])
        path = cut_path(np.array([1.5, 0.1, 0.7]) + steps, attitudes_along(np.tile([0.0, 0, -1], (4, 1))))
        for place in path.places:
            assert place.axes == pytest.approx(tool_down([1.5, 0.1, 0.7], feed).axes, abs=1e-12)
        assert not path.plunges.any()


def test_plunging_takes_the_feed_of_its_neighbour_and_is_told() -> None:
    points = np.array([[1.5, 0, 0.8], [1.5, 0, 0.7], [1.6, 0, 0.7], [1.6, 0, 0.7], [1.7, 0, 0.7]])
    path = cut_path(points, attitudes_along(np.tile([0.0, 0, -1], (5, 1))))
    assert path.plunges.tolist() == [True, False, False, False, False]
    assert path.places[0].axes[:, 0] == pytest.approx([1, 0, 0])
    with pytest.raises(InputError, match="plunges"):
        cut_path(points[:2], attitudes_along(np.tile([0.0, 0, -1], (2, 1))))


def test_frames_do_not_turn_about_the_tool() -> None:
    tilt = np.linspace(0, 1.2, 30)
    axes = np.column_stack([np.sin(tilt), 0.3 * np.sin(2 * tilt), -np.cos(tilt)])
    frames = attitudes_along(axes)
    assert np.linalg.det(frames) == pytest.approx(np.ones(30))
    assert frames[:, :, 2] == pytest.approx(axes / np.linalg.norm(axes, axis=1)[:, None])
    turns = [Rotation.from_matrix(b @ a.T).as_rotvec() @ a[:, 2] for a, b in itertools.pairwise(frames)]
    assert np.abs(turns).max() < 1e-3


def test_both_kinds_of_columns_are_one_path(tmp_path: Path) -> None:
    file, other = tmp_path / "axes.csv", tmp_path / "vectors.csv"
    file.write_text("x_m,y_m,z_m,i,j,k\n1.5,0,0.7,0,0,1\n1.6,0,0.7,0,0,1\n", encoding="utf-8")
    down = Rotation.from_matrix(np.diag([1.0, -1, -1])).as_rotvec()
    row = ",".join(f"{v:.12g}" for v in down)
    other.write_text(f"x_m,y_m,z_m,rx_rad,ry_rad,rz_rad\n1.5,0,0.7,{row}\n1.6,0,0.7,{row}\n", encoding="utf-8")
    first, second = read_cut_path(file), read_cut_path(other)
    for a, b in zip(first.places, second.places, strict=True):
        assert a.attitude == pytest.approx(b.attitude, abs=1e-9)
        assert a.axes == pytest.approx(b.axes, abs=1e-9)
    assert first.wrenches is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x_m,y_m,i,j,k\n1,0,0,0,1\n1,1,0,0,1\n", "lacks the columns z_m"),
        ("x_m,y_m,z_m,i,j,k\n1500,0,700,0,0,1\n1600,0,700,0,0,1\n", "give metres"),
        ("x_m,y_m,z_m,i,j,k\n1,0,0,0,0,2\n1,1,0,0,0,2\n", "unit vector"),
        ("x_m,y_m,z_m,i,j,k\n1,0,0,0,0,1\n1,a,0,0,0,1\n", "y_m = 'a' in line 3"),
        ("x_m,y_m,z_m,i,j,k\n1,0,0,0,0,1\n", "two points"),
    ],
)
def test_bad_files_are_told_in_one_line(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "path.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(FileFormatError, match=words):
        read_cut_path(file)


def test_a_table_through_the_tip_along_the_feed_turns_the_attitude_alone() -> None:
    place = tool_down([1.2, 0.0, 0.8], 0.4)
    table = RotaryTable(place.position, place.axes[:, 0])
    turned = table.turned(place, 0.6)
    assert turned.position == pytest.approx(place.position)
    assert turned.axes[:, 0] == pytest.approx(place.axes[:, 0])
    assert turned.attitude[:, 2] @ place.attitude[:, 2] == pytest.approx(np.cos(0.6))
    elsewhere = RotaryTable(np.array([1.2, 0.0, 0.5]), place.axes[:, 0]).turned(place, 0.6)
    assert np.linalg.norm(elsewhere.position - [1.2, 0, 0.5]) == pytest.approx(0.3)


def test_segments_have_the_feed_inside_them_on_both_sides_of_a_corner() -> None:
    points = np.array([[1.5, 0, 0.7], [1.6, 0, 0.7], [1.6, 0, 0.7], [1.6, 0.3, 0.7]])
    path = cut_path(points, attitudes_along(np.tile([0.0, 0, -1], (4, 1))))
    first, second = path_segments(path)
    assert [*first.lengths, *second.lengths] == pytest.approx([0, 0.1, 0.1, 0.4])
    for place in first.places:
        assert place.axes[:, 0] == pytest.approx([1, 0, 0])
    for place in second.places:
        assert place.axes[:, 0] == pytest.approx([0, 1, 0])
    assert second.places[1].position == pytest.approx([1.6, 0.15, 0.7])
    assert first.feed_turn == pytest.approx(0, abs=1e-6)


def test_equal_segments_cover_the_path_and_tell_the_feed_that_they_miss() -> None:
    angles = np.radians(np.linspace(0, 90, 46))
    points = np.column_stack([1.5 + 0.2 * np.sin(angles), -0.2 * np.cos(angles), np.full(46, 0.7)])
    path = cut_path(points, attitudes_along(np.tile([0.0, 0, -1], (46, 1))))
    parts = path_segments(path, 3)
    assert [each.lengths[0] for each in parts] == pytest.approx(np.arange(3) * path.lengths[-1] / 3)
    assert parts[-1].lengths[1] == pytest.approx(path.lengths[-1])
    # begin, middle and end of 30 degrees: the feed between them turns by a quarter of that, up to one step of 2 degrees
    assert all(np.radians(5) < each.feed_turn < np.radians(10) for each in parts)


def test_the_tool_turns_evenly_between_two_points() -> None:
    tilts = np.array([[0.0, 0, -1], [np.sin(0.4), 0, -np.cos(0.4)]])
    path = cut_path(np.array([[1.5, 0, 0.7], [1.6, 0, 0.7]]), attitudes_along(tilts))
    begin, middle, end = path_segments(path)[0].places
    assert middle.attitude[:, 2] == pytest.approx([np.sin(0.2), 0, -np.cos(0.2)])
    assert end.attitude == pytest.approx(path.places[1].attitude)
    assert begin.axes == pytest.approx(path.places[0].axes)
    assert middle.axes[:, 2] == pytest.approx(-middle.attitude[:, 2])
