"""Milling examples of T. L. Schmitz & K. S. Smith, Machining Dynamics, 2nd ed., Springer 2019, chapters 4, 6.

Cuts, coefficients and outcomes of Examples 4.1, 4.2, 4.11, 4.12, 4.14 and 6.2 were read in summaries of the book
(repository kadders/tap-testing, ``tap_testing/docs/milling_dynamics.py``); stiffness and damping of the structures of
Examples 4.11 and 4.12 in a calculation of Examples 4.3 and 4.7 (repository hafeztrimukti29/stability-lobe-diagram-for-
turning-and-milling-application, ``Milling Stability Lobe.ipynb``). The book judges its cuts by a simulation in time.
"""

import math
from pathlib import Path

import numpy as np
import pytest
from benchmarks_of_literature import RPM, oscillators
from scipy.optimize import brentq

from millfrf.cutting import MillingProcess, directional_harmonics, read_cutting_process
from millfrf.stability import ChatterVerdict, JudgedCut, certified_lobes, simulate_cut
from modal_fit import ModalModel

X, Y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
SLOT = oscillators([(500.0, 0.02, 8e6, X), (500.0, 0.02, 8e6, Y)])
DOWN = oscillators([(900.0, 0.02, 9e6, X), (950.0, 0.01, 1e7, Y)])


def cut(folder: Path, pressure: float, force_angle: float, engagement: str, **keys: float) -> MillingProcess:
    """Read a cutting file with the book's specific force (Pa) and force angle (deg) from the chip's normal."""
    angle = math.radians(force_angle)
    lines = {"diameter_m": 0.019, "ktc_pa": pressure * math.sin(angle), "krc": 1 / math.tan(angle), "kac": 0.0} | keys
    file = folder / "cut.toml"
    file.write_text("[cutting]\n" + engagement + "".join(f"{key} = {value}\n" for key, value in lines.items()))
    return read_cutting_process(file)


def limit(model: ModalModel, process: MillingProcess, rpm: float) -> float:
    """Verified depth limit, mm."""
    lobes = certified_lobes(model, process, np.array([rpm * RPM]), 0.02)
    assert lobes.numerics == ("verified",)
    return float(lobes.depth_limits[0]) * 1e3


@pytest.mark.parametrize(
    ("side", "radial", "start", "leave"), [("up", 1.9, 0, 37), ("up", 4.75, 0, 60), ("down", 4.75, 120, 180)]
)
def test_examples_4_1_and_4_2_angles_and_coefficients(
    tmp_path: Path, side: str, radial: float, start: float, leave: float
) -> None:
    """Radial depths of a tenth and a quarter of 19 mm; 791 MPa at 71.6 deg are 750 and 250 MPa."""
    process = cut(tmp_path, 791e6, 71.6, f'immersion = "{side}"\nradial_depth_m = {radial * 1e-3}\n', teeth=4)
    np.testing.assert_allclose(np.degrees([process.start_angle, process.exit_angle]), [start, leave], atol=0.5)
    np.testing.assert_allclose([process.ktc, process.ktc * process.krc], [750e6, 250e6], atol=1e6)


@pytest.mark.parametrize(
    ("rpm", "depth", "stable"), [(7500, 3.0, True), (7500, 5.0, False), (5000, 0.1, True), (5000, 0.5, False)]
)
def test_example_4_11_slotting_with_four_teeth(tmp_path: Path, rpm: float, depth: float, stable: bool) -> None:
    """Limits are 3.80 mm at 7500 rpm and 0.229 mm at 5000 rpm."""
    process = cut(tmp_path, 750e6, 68.0, 'immersion = "slot"\n', teeth=4, feed_per_tooth_m=0.15e-3)
    np.testing.assert_allclose([process.ktc, process.ktc * process.krc], [695e6, 281e6], atol=1e6)
    assert (depth < limit(SLOT, process, rpm)) is stable
    assert simulate_cut(SLOT, process, rpm * RPM, depth * 1e-3, turns=60).repeats is stable


@pytest.mark.parametrize(("rpm", "stable"), [(17000, True), (13000, False)])
def test_example_4_12_down_milling_of_a_fifth_of_the_diameter(tmp_path: Path, rpm: float, stable: bool) -> None:
    """4 mm; limits are 10.35 mm at 17 000 rpm, and 2.60 mm, a period doubling, at 13 000 rpm."""
    engagement = f'immersion = "down"\nradial_depth_m = {0.2 * 0.019}\n'
    process = cut(tmp_path, 2250e6, 75.0, engagement, teeth=3, feed_per_tooth_m=0.2e-3)
    assert math.degrees(process.start_angle) == pytest.approx(126.9, abs=0.05)
    assert (limit(DOWN, process, rpm) > 4) is stable
    assert simulate_cut(DOWN, process, rpm * RPM, 4e-3, turns=60).repeats is stable


def test_example_4_14_a_depth_of_constant_force(tmp_path: Path) -> None:
    """Edges of 45 deg lag by 30.2 deg at 5 mm, and by one pitch at 14.9 mm: then the force no longer varies."""
    engagement = f'immersion = "up"\nradial_depth_m = {0.3 * 0.019}\n'
    process = cut(tmp_path, 600e6, 60.0, engagement, teeth=4, feed_per_tooth_m=0.15e-3, helix_angle_deg=45.0)
    assert math.degrees(process.lag(5e-3)) == pytest.approx(30.2, abs=0.05)
    constant = brentq(lambda depth: process.lag(depth) - 2 * math.pi / process.teeth, 5e-3, 30e-3)
    assert constant * 1e3 == pytest.approx(14.9, abs=0.05)
    mean, *varying = np.abs(directional_harmonics(process, np.arange(4), constant)).max(axis=(1, 2))
    assert max(varying) < 1e-12 * mean
    assert np.abs(directional_harmonics(process, np.array([1]), 5e-3)).max() > 0.1 * mean


def test_example_6_2_speeds_from_the_frequency_of_chatter() -> None:
    """Four teeth; chatter at 919 Hz at 20 000 rpm, then at 804 Hz at 13 785 rpm; 12 060 rpm is stable."""
    rpm = 20000.0
    for frequency, proposed in ((919.0, 13785.0), (804.0, 12060.0)):
        [rpm] = JudgedCut("cut", rpm, ChatterVerdict("hopf", 0.5, 1.0, frequency)).proposed_rpm(4)
        assert rpm == pytest.approx(proposed, abs=0.5)
