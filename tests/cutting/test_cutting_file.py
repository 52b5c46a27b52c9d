"""Cutting files: what is written reads back."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from millfrf.cutting import MillingProcess, read_cutting_process, write_cutting_process

CUTTER = MillingProcess(
    3, 0.012, math.radians(70), 6e8, 0.3, 0.1, 0.3, 2.6, 1e-4, kte=2e4, kre=1e4, kae=3e3, runout=8e-6
)  # fmt: skip


def test_a_written_cutting_file_reads_back(tmp_path: Path) -> None:
    for process in (
        replace(CUTTER, process_damping=2.5e5),
        replace(CUTTER, helix_angle=0.5, pitch_angles=(2.0, 2.2, 2 * math.pi - 4.2)),
    ):
        write_cutting_process(tmp_path / "cut.toml", process, ["made for a test"])
        again = read_cutting_process(tmp_path / "cut.toml")
        for name in MillingProcess.__dataclass_fields__:
            assert getattr(again, name) == pytest.approx(getattr(process, name), rel=1e-9), name
