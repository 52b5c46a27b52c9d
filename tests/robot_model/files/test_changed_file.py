"""A robot's file with changed numbers keeps everything else."""

import difflib
import tomllib
from pathlib import Path

import numpy as np
import pytest

from millfrf.core import FileFormatError, InputError
from millfrf.robot_model import SpatialCase, changed_robot_text, read_robot, read_spatial_robot, robot_names

FOLDER = Path(__file__).resolve().parents[3] / "millfrf" / "robot_model" / "robots"


@pytest.mark.parametrize("name", robot_names())
def test_nothing_changes_where_nothing_is_asked(name: str) -> None:
    assert changed_robot_text(name, {}) == (FOLDER / f"{name}.toml").read_text(encoding="utf-8")


def test_a_serial_robot_whose_numbers_change_is_written_out_as_the_same_robot(tmp_path: Path) -> None:
    place = ("joints", 0, "turning_nm_per_rad")
    case = read_robot("staubli_rx160")
    assert isinstance(case, SpatialCase)
    first = case.robot
    own = tmp_path / "own.toml"
    own.write_text(changed_robot_text("staubli_rx160", {place: 2.5e6}), encoding="utf-8")
    again = read_spatial_robot(own).robot
    assert again.joints[0].stiffness[5] == 2.5e6
    for each, other in zip(first.joints[1:], again.joints[1:], strict=True):
        np.testing.assert_allclose(each.stiffness, other.stiffness, rtol=1e-8)
    assert sum(b.mass for b in again.bodies) == pytest.approx(sum(b.mass for b in first.bodies), rel=1e-9)


def test_only_the_lines_that_are_asked_change(tmp_path: Path) -> None:
    own = tmp_path / "own.toml"
    text = (FOLDER / "kuka_kr90_r3100.toml").read_text(encoding="utf-8")
    first = text.index("turning_nm_per_rad")
    own.write_text(text[:first] + "  # my own remark\n" + text[first:], encoding="utf-8")
    changes = {("joints", 0, "turning_nm_per_rad"): 1234567.891234, ("robot", "repeatability_m"): 6e-5}
    changed = changed_robot_text(own, changes)
    lines = list(difflib.ndiff(own.read_text(encoding="utf-8").splitlines(), changed.splitlines()))
    assert sum(line.startswith("- ") for line in lines) == 1
    assert sum(line.startswith("+ ") for line in lines) == 2
    assert "# my own remark" in changed
    own.write_text(changed, encoding="utf-8")
    case = read_spatial_robot(own)
    assert case.robot.joints[0].stiffness[5] == 1234567.89
    assert case.repeatability == 6e-5
    assert tomllib.loads(changed)["joints"][1] == tomllib.loads(text)["joints"][1]


def test_places_that_are_not_there_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no table joints\[100\]"):
        changed_robot_text("kuka_kr90_r3100", {("joints", 99, "turning_nm_per_rad"): 1.0})
    with pytest.raises(InputError, match="no table springs"):
        changed_robot_text("kuka_kr90_r3100", {("springs", "k"): 1.0})
    (tmp_path / "bad.toml").write_text("[robot\n")
    with pytest.raises(FileFormatError, match="not TOML"):
        changed_robot_text(tmp_path / "bad.toml", {})
