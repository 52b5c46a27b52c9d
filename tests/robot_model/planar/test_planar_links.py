"""The sections of a planar robot's links: said where they are left out, right where they are taken in."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation import Frf
from millfrf.command_line import DONE, run
from millfrf.core import TIP
from millfrf.cutting import read_cutting_process
from millfrf.robot_model import exact_receptance, in_posture, read_planar_robot, rigid_matrices
from millfrf.robot_model.planar import flexible_chain
from millfrf.stability import read_lobes, zero_order

CHEN = read_planar_robot("chen_2026")


def exact_first_frequency(pose: str) -> float:
    """Peak of the nearly undamped exact chain, Hz: beams without elements."""
    undamped = replace(CHEN.robot, damping_ratios=np.full(3, 1e-6))
    lines = np.arange(10.8, 11.8, 2e-4)
    receptance = exact_receptance(undamped, CHEN.poses[pose], lines).values
    return float(lines[np.abs(receptance[:, 1, 1]).argmax()])


@pytest.mark.parametrize("pose", ["P1", "P2", "P3"])
def test_what_is_left_out_is_said_with_its_size(pose: str) -> None:
    """The default is the paper's rigid model (11.96, 11.79, 11.40 Hz); what the sections would change is said."""
    result = in_posture(CHEN, CHEN.poses[pose])
    flexible = in_posture(CHEN, CHEN.poses[pose], links=True)
    assert flexible.frequencies[0] == pytest.approx(exact_first_frequency(pose), rel=1e-4)
    assert flexible.warnings == ()
    assert len(result.warnings) == 1
    assert "3 link sections are left out" in result.warnings[0]
    assert f"{flexible.frequencies[0]:.2f} Hz instead of {result.frequencies[0]:.2f} Hz" in result.warnings[0]


def test_links_taken_in_are_the_exact_chain() -> None:
    """Statics to 1e-7 and the receptance around two modes to 2e-3, against exact dynamic stiffness."""
    angles = CHEN.poses["P2"]
    static = exact_receptance(CHEN.robot, angles, np.array([1e-3])).values[0].real
    chain = flexible_chain(CHEN.robot, angles)
    # the exact chain is damped by a loss factor of 2 zeta, here up to 0.04: 0.04^2 in the real part
    assert chain.compliance() == pytest.approx(static, rel=3e-3, abs=1e-12)
    lines = np.array([5.0, 9.0, 20.0, 35.0])
    exact = exact_receptance(CHEN.robot, angles, lines).values
    result = chain.model().receptance(lines)
    assert np.abs(result - exact).max(axis=0) == pytest.approx(0, abs=0.02 * np.abs(exact).max())


def test_stiff_links_give_the_rigid_robot_and_its_sag() -> None:
    assert CHEN.robot.sections is not None
    stiff = replace(
        CHEN.robot,
        sections=tuple(
            replace(s, **{name: 1e5 * getattr(s, name) for name in ("axial", "bending_z", "shear_y")})
            for s in CHEN.robot.sections
        ),
    )
    angles = CHEN.poses["P1"]
    mass, stiffness = rigid_matrices(CHEN.robot, angles)
    rigid = np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real)) / (2 * np.pi)
    chain = flexible_chain(stiff, angles)
    assert chain.frequencies()[:3] == pytest.approx(rigid, rel=1e-3)
    assert chain.sag() == pytest.approx(in_posture(CHEN, angles).own_weight, rel=1e-4)
    ratios = chain.model().damping_ratios
    assert ratios.min() > 0.0099
    assert ratios.max() < 0.0201


def test_commands_say_it_and_take_links_in(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["robot", "modes", "chen_2026", "--pose", "P1"]) == DONE
    captured = capsys.readouterr()
    assert "11.956" in captured.out
    assert "link sections are left out" in " ".join(captured.err.split())
    assert run(["robot", "modes", "chen_2026", "--pose", "P1", "--links"]) == DONE
    captured = capsys.readouterr()
    assert f"{in_posture(CHEN, CHEN.poses['P1'], links=True).frequencies[0]:.3f}" in captured.out
    assert "left out" not in captured.err
    model = tmp_path / "chen.json"
    assert run(["robot", "frf", "chen_2026", "--out", str(model)]) == DONE
    capsys.readouterr()
    assert "link sections are left out" in model.read_text()
    report = tmp_path / "report.html"
    assert run(["report", str(model), "--out", str(report)]) == DONE
    assert "link sections are left out" in report.read_text()


@pytest.mark.long
def test_lobes_take_links_in(tmp_path: Path) -> None:
    """Slotting at P2 (Chen et al., Fig. 8): limits with links are those of the exact chain."""
    cut, out = tmp_path / "slot.toml", tmp_path / "lobes.csv"
    cut.write_text(
        "[cutting]\nteeth = 4\ndiameter_m = 0.006\nktc_pa = 800e6\nkrc = 0.3\nkac = 0.1\n"
        "start_angle_deg = 0.0\nexit_angle_deg = 180.0\n"
    )
    asked = ["robot", "lobes", "chen_2026", "--pose", "P2", "--cutting", str(cut), "--max-depth", "0.005"]
    asked += ["--speeds", "3000", "5000", "2", "--out", str(out), "--force"]
    limits = []
    for options in ([], ["--links"], ["--links", "--method", "zero-order"]):
        assert run([*asked, *options]) == DONE
        limits.append(1e3 * read_lobes(out).depth_limits)
    assert limits[0] == pytest.approx([1.434, 2.329], abs=0.002)
    assert limits[1] == pytest.approx([1.368, 2.226], abs=0.002)
    lines = np.arange(2.0, 250.0, 0.02)
    exact = exact_receptance(CHEN.robot, CHEN.poses["P2"], lines)
    planar = exact.values[:, :2, :2]
    values = np.zeros((len(lines), 3, 3), dtype=complex)  # X and Z of the plane; Y is rigid
    values[:, ::2, ::2] = planar
    frf = Frf(lines, values, TIP, TIP, "receptance", "m/N", np.ones(len(lines), dtype=bool))
    expected = zero_order(frf, read_cutting_process(cut), np.array([3000.0, 5000.0]) * np.pi / 30, 0.005)
    assert limits[2] == pytest.approx(1e3 * expected.depth_limits, rel=0.01)
    assert limits[0] != pytest.approx(1e3 * expected.depth_limits, rel=0.03)
