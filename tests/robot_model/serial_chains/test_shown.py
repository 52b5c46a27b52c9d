"""`robot show`, and pictures and tables of FRFs and stiffness."""

import csv
from pathlib import Path

import numpy as np
import pytest

from estimation import read_frf
from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.core import read_csv
from millfrf.robot_model import in_posture, named_posture, read_robot

ROBOT = "abb_irb1200_5_90"


def numbers(path: Path) -> tuple[list[str], list[list[str]]]:
    with path.open(newline="") as stream:
        rows = list(csv.reader(stream))
    return rows[0], rows[1:]


@pytest.mark.parametrize("robot", [ROBOT, "fanuc_s420if"])
def test_the_page_needs_no_network_and_tells_the_joints(tmp_path: Path, robot: str) -> None:
    page = tmp_path / "r.html"
    assert run(["robot", "show", robot, "--out", str(page)]) == DONE
    text = page.read_text()
    assert "http://" not in text
    assert "https://" not in text
    assert "stiffness along its motion" in text
    assert ('class="warnings"' in text) == bool(in_posture(*_case(robot)).warnings)


def _case(robot: str):  # type: ignore[no-untyped-def]
    case = read_robot(robot)
    return case, named_posture(case, None)


def test_frf_as_picture_and_table(tmp_path: Path) -> None:
    frf, picture, table = tmp_path / "f.h5", tmp_path / "f.png", tmp_path / "f.csv"
    drawn = ["--picture", str(picture), "--table", str(table)]
    assert run(["robot", "frf", ROBOT, "--out", str(frf), "--lines", "40", *drawn]) == DONE
    assert picture.stat().st_size > 5000
    names, rows = numbers(table)
    stored = read_frf(frf)
    column = names.index("re_X_Y_m_per_n")
    got = np.array([float(row[column]) + 1j * float(row[column + 1]) for row in rows])
    assert got == pytest.approx(stored.values[:, 0, 1], rel=1e-5, abs=1e-12)
    assert "is assumed" in " ".join(read_csv(table).warnings)
    assert run(["robot", "frf", ROBOT, "--out", str(frf), "--picture", str(tmp_path / "f.doc")]) == BAD_INPUT


def test_stiffness_as_picture_and_table(tmp_path: Path) -> None:
    picture, table = tmp_path / "s.png", tmp_path / "s.csv"
    assert run(["robot", "stiffness", ROBOT, "--picture", str(picture), "--table", str(table)]) == DONE
    assert picture.stat().st_size > 5000
    rows = numbers(table)[1]
    got = np.array([[float(cell) for cell in row[2:]] for row in rows])
    assert got == pytest.approx(in_posture(*_case(ROBOT)).compliance, rel=1e-6, abs=1e-15)
