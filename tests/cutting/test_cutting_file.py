"""Cutting files: what is written reads back."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from millfrf.core import MillfrfError
from millfrf.cutting import ChipLaw, MillingProcess, read_cutting_process, write_cutting_process

CUTTER = MillingProcess(
    3, 0.012, math.radians(70), 6e8, 0.3, 0.1, 0.3, 2.6, 1e-4, kte=2e4, kre=1e4, kae=3e3, runout=8e-6
)  # fmt: skip


def test_a_written_cutting_file_reads_back(tmp_path: Path) -> None:
    for process in (
        replace(CUTTER, process_damping=2.5e5),
        replace(CUTTER, helix_angle=0.5, pitch_angles=(2.0, 2.2, 2 * math.pi - 4.2)),
        replace(CUTTER, chip_law=ChipLaw((0.25, 0.6, 0.4), 1e-4, 8e-6)),
    ):
        write_cutting_process(tmp_path / "cut.toml", process, ["made for a test"])
        again = read_cutting_process(tmp_path / "cut.toml")
        assert again.chip_law == process.chip_law
        for name in MillingProcess.__dataclass_fields__.keys() - {"chip_law"}:
            assert getattr(again, name) == pytest.approx(getattr(process, name), rel=1e-9), name


def test_a_covariance_is_written_and_read(tmp_path: Path) -> None:
    scale = np.diag([2e6, 0.01, 0.02, 100.0, 150.0, 50.0])
    correlation = np.eye(6)
    correlation[0, 1] = correlation[1, 0] = -0.6
    rows = tuple(tuple(float(value) for value in row) for row in scale @ correlation @ scale)
    process = MillingProcess(
        2, 0.0127, np.pi / 2, 119e6, 0.17, 0.33, 0.0, np.pi, ktc_std=2e6, krc_std=0.01, kac_std=0.02, covariance=rows,
        feed_per_tooth=1e-4,
    )  # fmt: skip
    write_cutting_process(tmp_path / "cut.toml", process)
    read = read_cutting_process(tmp_path / "cut.toml")
    assert read.covariance == rows
    assert read.coefficient_errors == pytest.approx(process.coefficient_errors)
    assert read.coefficient_covariance[0, 1] == pytest.approx(-0.6 * 2e6 * 0.01)


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [((0, 1), 1.0, "not symmetric"), ((0, 0), -1.0, "no errors have this matrix"), ((2, 2), np.nan, "covariance")],
)
def test_a_covariance_that_cannot_be_is_refused(
    tmp_path: Path, place: tuple[int, int], value: float, message: str
) -> None:
    matrix = np.eye(6)
    matrix[place] = value
    rows = ", ".join(str(row.tolist()) for row in matrix)
    text = "[cutting]\nteeth = 2\ndiameter_m = 0.01\nktc_pa = 1e9\nkrc = 0.3\nimmersion = 'slot'\n"
    (tmp_path / "cut.toml").write_text(text + f"covariance = [{rows}]\n", encoding="utf-8")
    with pytest.raises(MillfrfError, match=message):
        read_cutting_process(tmp_path / "cut.toml")
