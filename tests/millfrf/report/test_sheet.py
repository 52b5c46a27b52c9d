"""Sheet for the machine: width, feed and removal rate of the recommended cut, and an error without lobes."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from millfrf.core import InputError
from millfrf.cutting import MillingProcess, write_cutting_process
from millfrf.reports.collection import collect
from millfrf.reports.page import ReportOptions, report_of, write_report
from millfrf.reports.sheet import limit_near, radial_width, sheet_rows
from millfrf.stability import StabilityLobes, certified_lobes, write_lobes
from modal_fit import ModalModel, write_modal_model

DOWN = MillingProcess(2, 0.02, math.pi / 2, 700e6, 0.3, 0.1, math.pi / 2, math.pi, 1e-4)
RPM = math.pi / 30


def _tip() -> ModalModel:
    """A mode of 400 Hz and 3 % in X and one of 500 Hz in Y, with small errors."""
    omega, zeta = 2 * np.pi * np.array([400.0, 500.0]), 0.03
    poles = omega * (-zeta + 1j * math.sqrt(1 - zeta**2))
    shapes = np.eye(2, 3)
    right = shapes / (2j * poles.imag[:, None] * 1.0)
    axes = ("TCP:+X", "TCP:+Y", "TCP:+Z")
    size = 2 * 2 * (1 + 3 + 3)
    return ModalModel(poles, right, shapes.astype(complex), axes, axes, covariance=1e-18 * np.eye(size))


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("cell")
    tip, cut, lobes = (folder / name for name in ("tip.json", "cut.toml", "lobes.csv"))
    write_modal_model(tip, _tip())
    write_cutting_process(cut, DOWN)
    write_lobes(lobes, certified_lobes(_tip(), DOWN, np.linspace(5000.0, 14000.0, 10) * RPM, 0.02))
    return [tip, cut, lobes]


@pytest.mark.parametrize(("start", "leave", "share"), [(0.0, 180.0, 1.0), (90.0, 180.0, 0.5), (120.0, 180.0, 0.25)])
def test_the_width_of_cut_is_the_engaged_part_of_the_diameter(start: float, leave: float, share: float) -> None:
    process = replace(DOWN, start_angle=math.radians(start), exit_angle=math.radians(leave))
    assert radial_width(process) == pytest.approx(share * 0.02)


def test_the_removal_rate_is_that_of_depth_width_and_feed(files: list[Path]) -> None:
    report = report_of(collect(files), ReportOptions())
    rows = dict(sheet_rows(report.stability))
    speed, depth, width, rate = (
        float(re.match(r"[\d.]+", rows[name])[0])  # type: ignore[index]
        for name in ("Spindle speed", "Depth of cut", "Width of cut", "Removal rate")
    )
    assert width == pytest.approx(10.0)
    assert rows["Cutter"] == "2 edges, down milling, 90 to 180°"
    assert rows["Coefficients"] == "ktc 700 MPa, krc 0.3, kac 0.1"
    assert rate == pytest.approx(depth * width * 0.1 * 2 * speed / 1000, rel=0.01)
    assert report.page.verdict[0].startswith(f"Cut {rows['Depth of cut']} deep at {speed:.0f} rpm")


@pytest.mark.parametrize(
    ("depths", "rpm", "stated"),
    [
        ((2e-3, np.inf), 1500.0, "2.00 mm"),
        ((np.nan, 2e-3), 1500.0, "not resolved"),
        ((1e-3, np.inf), 2000.0, "none found"),
    ],
)
def test_the_limit_of_the_sheet_is_the_lower_one_nearby(depths: tuple[float, float], rpm: float, stated: str) -> None:
    speeds = np.array([1000.0, 2000.0]) * RPM
    lobes = StabilityLobes(speeds, np.array(depths), np.full(2, 400.0), ("hopf", "hopf"), "certified")
    assert limit_near(lobes, rpm) == stated


def test_the_sheet_is_one_page_of_a4(files: list[Path], tmp_path: Path) -> None:
    write_report(tmp_path / "report.html", files, ReportOptions(sheet=tmp_path / "sheet.png"))
    width, height = Image.open(tmp_path / "sheet.png").size
    assert height / width == pytest.approx(math.sqrt(2), rel=0.002)
    write_report(tmp_path / "report.html", files, ReportOptions(sheet=tmp_path / "sheet.pdf"))
    assert len(re.findall(rb"/Type /Page\b", (tmp_path / "sheet.pdf").read_bytes())) == 1


def test_without_lobes_there_is_no_sheet_and_nothing_is_written(files: list[Path], tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no sheet without stability lobes: add"):
        write_report(tmp_path / "report.html", files[:1], ReportOptions(sheet=tmp_path / "sheet.png"))
    assert not list(tmp_path.iterdir())


def test_edge_forces_whose_ends_move_are_deducted(files: list[Path], tmp_path: Path) -> None:
    """In down milling the chip ends at zero: a vibration moves the end of the edge force."""
    tip, _, _ = files
    cut, lobes = tmp_path / "cut.toml", tmp_path / "lobes.csv"
    blunt = replace(DOWN, kte=20e3, kre=20e3, helix_angle=math.radians(10.0))
    write_cutting_process(cut, blunt)
    write_lobes(lobes, certified_lobes(_tip(), blunt, np.linspace(5000.0, 14000.0, 10) * RPM, 0.02))
    blunted, sharpened = (report_of(collect(each), ReportOptions()).stability for each in ([tip, cut, lobes], files))
    sentences = " ".join(blunted.answer)
    assert "the end of the edge force" in sentences
    deducted = int(re.search(r"(\d+) % of the depth are deducted", sentences)[1])  # type: ignore[index]
    assert 2 < deducted < 60
    assert "edge force" not in " ".join(sharpened.answer)
    rows = dict(sheet_rows(blunted))
    assert rows["Edge coefficients"] == "kte 20, kre 20, kae 0 N/mm"
    assert "helix 10°" in rows["Cutter"]
