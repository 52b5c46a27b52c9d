"""Commands that follow one another on one serial robot: what they write, and what they leave unwritten."""

from pathlib import Path

import numpy as np
import pytest

from millfrf.command_line import DONE, run
from millfrf.core import side_file
from millfrf.robot_model import CompensatedPath, ToolPath
from millfrf.steps.robot.pictures import compensation_figure

ROBOT = "staubli_rx160"
CUT = """[cutting]
teeth = 2
diameter_m = 0.01
ktc_pa = 119e6
krc = 0.17
kac = 0.33
start_angle_deg = 90.0
exit_angle_deg = 180.0
"""


def test_a_path_is_compensated_on_a_branch_within_the_limits(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [f"{x},0.1,0.6,3.14159265,0,0,100,50,20" for x in (0.8, 0.9, 1.0)]
    path = tmp_path / "path.csv"
    path.write_text("\n".join(["x_m,y_m,z_m,rx_rad,ry_rad,rz_rad,fx_n,fy_n,fz_n", *rows]))
    assert run(["robot", "compensate", ROBOT, str(path), "--out", str(tmp_path / "corrected.csv")]) == DONE
    assert "is outside" not in capsys.readouterr().err


def test_lobes_and_tables_say_their_posture(tmp_path: Path) -> None:
    cut, lobes, table = tmp_path / "cut.toml", tmp_path / "lobes.csv", tmp_path / "compliance.csv"
    cut.write_text(CUT)
    joints = ["--joints", "10,-30,-90,10,-50,80"]
    asked = ["--speeds", "3000", "4000", "2", "--max-depth", "0.01", "--out", str(lobes)]
    assert run(["robot", "lobes", ROBOT, *joints, "--cutting", str(cut), *asked]) == DONE
    assert run(["robot", "stiffness", ROBOT, *joints, "--table", str(table)]) == DONE
    for written in (lobes, table):
        assert "10.0, -30.0, -90.0, 10.0, -50.0, 80.0 deg" in side_file(written).read_text()


@pytest.mark.long
def test_an_update_with_the_wrong_posture_leaves_no_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    measured, out = tmp_path / "frf.h5", tmp_path / "updated.toml"
    joints = ["--joints", "10,-30,-90,10,-50,80", "--band", "5", "80"]
    assert run(["robot", "frf", ROBOT, *joints, "--out", str(measured)]) == DONE
    asked = ["--pose", "40,-50,-70,40,-30,-60", "--out", str(out)]
    assert run(["robot", "update", ROBOT, str(measured), *asked]) != DONE
    said = capsys.readouterr()
    assert "was not written" in said.out + said.err
    assert "does not foresee" not in said.out + said.err
    assert not out.exists()
    assert [path.name for path in tmp_path.iterdir()] == ["frf.h5"]


def test_tiny_remainders_leave_no_factor_on_the_panels_letter() -> None:
    positions = np.array([[0.8, 0.1, 0.6], [0.9, 0.1, 0.6]])
    path = ToolPath(positions, np.zeros((2, 3)), np.zeros((2, 6)))
    left = np.full((2, 6), 3e-12)
    drawn = compensation_figure(path, CompensatedPath(path, left, left, left, np.zeros((2, 6))))
    drawn.canvas.draw()
    assert drawn.axes[1].yaxis.get_offset_text().get_text() == ""
