"""A half-immersion cut whose averaged limits are several times too high: what the default and the report make of it.

The issue that asked for certified limits tells of such a cut: zero-order 1.30 mm at its lowest where the truth is
0.505 mm, and 5.41 mm advised at 2400 rpm. It does not give the structure, so that the case here is not that one but
like it: one lightly damped mode, its direction and size chosen so that the three figures are nearly those (1.30, 0.506
and 5.46 mm); the growth of the advised cut is its own.
"""

from pathlib import Path

import numpy as np
import pytest
from drawn_cuts import RPM, TIP, growth

from millfrf.command_line import run
from millfrf.cutting import MillingProcess, write_cutting_process
from millfrf.reports.collection import collect
from millfrf.reports.lobes_check import checked_lobes
from millfrf.reports.recommendation import recommendation
from millfrf.reports.sections.stability import stability_findings
from millfrf.stability import certified_lobes, multi_frequency, read_lobes, semi_discretisation, zero_order
from millfrf.stability.recommendation import recommended_cut
from modal_fit import ModalModel, write_modal_model

CUT = MillingProcess(2, 12.7e-3, np.pi / 2, 119e6, 0.17, 0.33, np.pi / 2, np.pi, 0.15e-3)
"""Half-immersion down-milling with two teeth, acetal of Mohammadi & Ahmadi."""
SPEEDS = np.linspace(1600, 2400, 81) * RPM
MAX_DEPTH = 10e-3
FREQUENCY, DAMPING, COMPLIANCE, DIRECTION = 39.8, 0.011, 1.384e-6, np.radians(61)


def structure() -> ModalModel:
    """One mode in the plane of the cut, frequency known to 0.1 %, damping and size to 2 %."""
    turn = 2 * np.pi * FREQUENCY
    pole = turn * (-DAMPING + 1j * np.sqrt(1 - DAMPING**2))
    shape = np.array([[np.cos(DIRECTION), np.sin(DIRECTION), 0.0]])
    right = COMPLIANCE * turn**2 / (2j * pole.imag) * shape
    sizes = np.concatenate([[0.02 * turn * DAMPING, 0.001 * turn], np.zeros(3), 0.02 * np.abs(right[0]), np.zeros(6)])
    return ModalModel(np.array([pole]), right, shape + 0j, TIP, TIP, covariance=np.diag(sizes**2))


def sixty_turns(depth: float, speed: float) -> float:
    """By what a small deviation has grown after 60 turns, integrated in time with the tests' own force law."""
    return growth(structure(), CUT, depth, speed) ** (60 * CUT.teeth)


def test_the_lowest_limit_is_less_than_half_of_the_averaged_one() -> None:
    averaged = zero_order(structure(), CUT, SPEEDS, MAX_DEPTH)
    certified = certified_lobes(structure(), CUT, SPEEDS, MAX_DEPTH)
    assert averaged.depth_limits.min() == pytest.approx(1.30e-3, rel=0.01)
    assert certified.depth_limits.min() == pytest.approx(0.506e-3, rel=0.01)
    assert set(certified.numerics) == {"verified"}
    lowest = int(certified.depth_limits.argmin())
    assert certified.bifurcations[lowest] == "period-doubling"
    single = SPEEDS[[lowest]]
    assert multi_frequency(structure(), CUT, single, MAX_DEPTH).depth_limits == pytest.approx(
        certified.depth_limits[lowest], rel=2e-3
    )
    semi = semi_discretisation(structure(), CUT, single, 1e-3, steps=120, order=3)
    assert semi.depth_limits == pytest.approx(certified.depth_limits[lowest], rel=2e-3)
    for share, grows in ((0.995, False), (1.005, True)):
        assert (sixty_turns(share * float(certified.depth_limits[lowest]), float(single[0])) > 1) == grows


def test_what_averaged_limits_advise_is_far_from_stable() -> None:
    averaged = zero_order(structure(), CUT, SPEEDS, MAX_DEPTH)
    advised = recommended_cut(averaged, np.zeros(len(SPEEDS)), drift=0.0)
    assert advised.spindle_speed == pytest.approx(2400 * RPM)
    assert advised.depth == pytest.approx(5.46e-3, rel=0.01)
    assert sixty_turns(advised.depth, advised.spindle_speed) > 1e4


@pytest.mark.long
def test_the_command_and_the_report_are_not_fooled(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Limits of ``lobes`` as it comes; then a report that is handed zero-order lobes, whose advice settles in time."""
    model, cut, lobes, averaged = (str(tmp_path / name) for name in ("tip.json", "cut.toml", "lobes.csv", "zero.csv"))
    write_modal_model(model, structure())
    write_cutting_process(cut, CUT)
    asked = ["lobes", model, "--cutting", cut, "--speeds", "1600", "2400", "81", "--max-depth", "0.01"]
    assert run([*asked, "--out", lobes]) == 0
    said = capsys.readouterr().out  # damping and size are known to 2 %, most limits therefore not to 7 %
    assert "lowest limit 0.506 mm at 2400 rpm; of 81 speeds 15 verified, 66 uncertain by the errors" in said
    assert set(read_lobes(lobes).numerics) == {"verified"}
    assert read_lobes(lobes).depth_limits.min() == pytest.approx(0.506e-3, rel=0.01)
    assert run([*asked, "--method", "zero-order", "--out", averaged]) == 0
    assert "warning: " in capsys.readouterr().err
    collected = collect([model, cut, averaged])
    [checked] = checked_lobes(collected)
    assert checked.wrong
    advised = recommendation(checked).cut
    assert advised is not None
    for drift in (-0.02, -0.01, 0.0, 0.01, 0.02):
        assert sixty_turns(advised.depth, advised.spindle_speed * (1 + drift)) < 1
    assert any("not the stability limit" in line for line in stability_findings(collected).warnings)
