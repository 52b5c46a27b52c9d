"""`millfrf lobes`: certified by default, counts of what is verified, and words on what a solver cannot see."""

from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest

from estimation import write_frf
from millfrf.command_line import DONE, run
from millfrf.cutting import MillingProcess, write_cutting_process
from millfrf.stability import StabilityLobes, certified_lobes, read_lobes
from millfrf.steps.lobes import lobes_summary, mode_coupling_line
from modal_fit import write_modal_model
from replay_data import table_one_model

HALF_DOWN = MillingProcess(2, 0.0127, pi / 2, 119e6, 0.17, 0.33, pi / 2, pi, 1.5e-4)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_modal_model(tmp_path / "model.json", table_one_model())
    write_frf(tmp_path / "frf.h5", table_one_model().frf(np.arange(2.0, 80.0, 0.25)))
    write_cutting_process(tmp_path / "cut.toml", HALF_DOWN)
    return tmp_path


def _lobes(folder: Path, source: str, *options: str) -> StabilityLobes:
    out = folder / "lobes.csv"
    shared = ["--cutting", str(folder / "cut.toml"), "--speeds", "1000", "1100", "3", "--max-depth", "0.005"]
    assert run(["lobes", str(folder / source), *shared, "--out", str(out), *options]) == DONE
    return read_lobes(out)


def test_limits_of_a_model_are_certified_by_default(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """At 1050 rpm averaged coefficients have 1.8 mm, the cut loses stability by period doubling at 1.36 mm."""
    lobes = _lobes(folder, "model.json")
    assert lobes.depth_limits[1] == pytest.approx(1.356e-3, abs=2e-6)
    assert lobes.bifurcations[1] == "period-doubling"
    assert lobes.status == ("verified",) * 3
    stated = capsys.readouterr().out
    assert "lowest limit 1.36 mm at 1050 rpm; of 3 speeds 3 verified" in stated
    assert "at every spindle speed" not in stated
    assert "mode coupling in a cut without regeneration" in stated


def test_limits_of_an_frf_are_told_to_be_unverified(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lobes = _lobes(folder, "frf.h5")
    assert lobes.numerics == ("not-verified",) * 3
    assert lobes.bifurcations[1] == "period-doubling"
    captured = capsys.readouterr()
    assert "verified," not in captured.out.replace("not verified,", "")
    assert "warning: from an FRF alone, limits are not verified; their stated error is up to" in captured.err


@pytest.mark.parametrize("method", ["zero-order", "nyquist"])
def test_averaged_coefficients_say_what_they_cannot_see(
    folder: Path, capsys: pytest.CaptureFixture[str], method: str
) -> None:
    lobes = _lobes(folder, "model.json", "--method", method)
    assert lobes.depth_limits[1] > 1.7e-3
    assert "period doubling is not seen" in capsys.readouterr().err


def test_the_summary_never_tells_nan_or_inf_as_the_lowest_limit() -> None:
    speeds = np.array([60.0, 80.0, 90.0])
    depths = np.array([np.nan, np.inf, 2e-3])
    status = ("unresolved", "verified", "lower-bound")
    nothing = np.full(3, np.nan)
    single = StabilityLobes(speeds, depths, nothing, ("none",) * 3, "collocation", status=status)
    assert lobes_summary(single, 5e-3) == (
        "lowest limit 2 mm at 859 rpm (a lower bound); of 3 speeds 1 verified, 1 a lower bound only, 1 unresolved"
    )
    free = StabilityLobes(speeds, np.full(3, np.inf), nothing, ("none",) * 3, "collocation", status=("verified",) * 3)
    assert lobes_summary(free, 5e-3) == "no limit up to 5 mm; of 3 speeds 3 verified"
    beyond = replace(free, status=("unmeasured",) * 3, band=("unmeasured",) * 3)
    assert lobes_summary(beyond, 5e-3) == (
        "no limit up to 5 mm of the modes that were measured; of 3 speeds 3 resting on dynamics that were not measured"
    )
    lost = StabilityLobes(speeds, nothing, nothing, ("none",) * 3, "collocation", status=("unresolved",) * 3)
    assert lobes_summary(lost, 5e-3) == "no limit known; of 3 speeds 3 unresolved"


def test_mode_coupling_does_not_contradict_verified_limits() -> None:
    """It holds for cuts without regeneration: the limits beside it lie on either side of it."""
    slot = MillingProcess(4, 0.0127, pi / 2, 700e6, 0.17, 0.33, 0.0, pi, 1e-4)
    line = mode_coupling_line(table_one_model(), slot, 0.05)
    alone = 1e-3 * float(line.split("from ")[1].split(" mm")[0])
    limits = certified_lobes(table_one_model(), slot, np.array([540.0, 6000.0]) * pi / 30, 0.05).depth_limits
    assert limits[0] < alone < limits[1]
    assert "without regeneration" in line
    assert "where a tooth cuts into the waves of the one before" in line
