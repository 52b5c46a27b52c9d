"""Turning example of T. L. Schmitz & K. S. Smith, Machining Dynamics, 2nd ed., Springer 2019, chapter 3; its damping.

Two modes at angles to the surface, printed critical depth 1.3 mm, and four cuts that a simulation in time judges; data,
printed value and cuts were read in the repository hafeztrimukti29/stability-lobe-diagram-for-turning-and-milling-
application, ``Turning Stability Lobe.ipynb`` (Exercise 3.2 and Example 3.6). The law of process damping, Eq. 3.44, was
read in the repository kadders/tap-testing, ``docs/REFERENCE_ALIGNMENT_ANALYSIS.md``.
"""

import math
from pathlib import Path

import numpy as np
import pytest
from benchmarks_of_literature import RPM, Mode, oscillators
from scipy.optimize import brentq

from millfrf.cutting import MillingProcess, read_cutting_process, turning_process
from millfrf.stability import certified_lobes

PRESSURE, FORCE_ANGLE = 2e9, math.radians(65.0)
FIRST, SECOND = math.radians(35.0), math.radians(55.0)  # from the surface's normal, to either side


def _mode(damping: float, stiffness: float, angle: float) -> Mode:
    """A mass of 1 kg that moves at an angle (rad) from the outward normal, here -X, towards the cutting speed, Y."""
    omega = math.sqrt(stiffness)
    return omega / (2 * math.pi), damping / (2 * omega), stiffness, (-math.cos(angle), math.sin(angle), 0.0)


BAR = oscillators([_mode(450.0, 2e7, FIRST), _mode(650.0, 3e7, -SECOND)])


@pytest.fixture
def process(tmp_path: Path) -> MillingProcess:
    """The cut, from a file as users write it."""
    file = tmp_path / "turn.toml"
    file.write_text(
        f"[turning]\ndiameter_m = 0.05\nktc_pa = {PRESSURE * math.sin(FORCE_ANGLE)}\n"
        f"krc = {1 / math.tan(FORCE_ANGLE)}\nedge_angle_deg = 90.0\n"
    )
    return read_cutting_process(file)


def test_the_critical_depth(process: MillingProcess) -> None:
    """Printed with two digits: 1.3 mm. The book's equation gives 1.2547 mm on lines of 1 Hz, and so does the search."""
    lobes = certified_lobes(BAR, process, np.linspace(15000, 35000, 120) * RPM, 0.02)
    assert round(float(lobes.depth_limits.min()) * 1e3, 1) == 1.3
    assert float(lobes.depth_limits.min()) == pytest.approx(1.2547e-3, rel=5e-4)
    assert lobes.chatter_frequencies[lobes.depth_limits.argmin()] == pytest.approx(748, abs=2)


@pytest.mark.parametrize(
    ("rpm", "depth", "stable"), [(44490, 5.0, True), (44490, 6.0, False), (26140, 2.0, False), (26140, 1.0, True)]
)
def test_four_cuts(process: MillingProcess, rpm: float, depth: float, stable: bool) -> None:
    """Limits are 5.95 mm at 44 490 rpm, where 5 mm is called near the limit, and 1.255 mm at 26 140 rpm."""
    lobes = certified_lobes(BAR, process, np.array([rpm * RPM]), 0.02)
    assert lobes.numerics == ("verified",)
    assert (depth * 1e-3 < lobes.depth_limits[0]) is np.bool_(stable)


FREQUENCY, DAMPING, STIFFNESS = 250.0, 0.02, 2e7  # Hz, ratio, N/m; along the normal of the surface
DIAMETER, NORMAL_PRESSURE, FLANK = 0.05, 1e9, 6e5  # m, Pa, N/m


def flank_damping(speed: float) -> float:
    """Damping ratio per depth (1/m) that the force ``C b v / V`` adds: ``C / (2 V sqrt(k m))`` (Eq. 3.44)."""
    return FLANK / (speed * DIAMETER * STIFFNESS / (2 * math.pi * FREQUENCY))


def worst_depth(speed: float) -> float:
    """Depth (m) at which the mode chatters at the worst phase, ``K b = 2 k z (1 + z)`` with z = DAMPING + share b.

    Without process damping this is Tlusty's limit (Altintas, Manufacturing Automation, section 4.2). Infinite: the
    flank damps more than the chip excites at any depth.
    """
    share = flank_damping(speed)
    linear = NORMAL_PRESSURE / (2 * STIFFNESS) - share * (1 + 2 * DAMPING)
    discriminant = linear**2 - 4 * share**2 * DAMPING * (1 + DAMPING)
    return math.inf if linear < 0 or discriminant < 0 else (linear - math.sqrt(discriminant)) / (2 * share**2)


def phase_error(speed: float, lobe: int) -> float:
    """Revolutions of the worst chatter by which a lobe's phase is missed at a speed (rad/s)."""
    ratio = DAMPING + flank_damping(speed) * worst_depth(speed)
    chatter = math.sqrt(1 + 2 * ratio)
    receptance = 1 / (1 - chatter**2 + 2j * ratio * chatter)
    phase = (3 * math.pi + 2 * math.atan2(receptance.imag, receptance.real)) % (2 * math.pi)
    return 2 * math.pi * FREQUENCY * chatter / speed - lobe - phase / (2 * math.pi)


def test_low_speeds_are_stable_by_process_damping() -> None:
    """Lobes touch the closed form at the worst phase and lie above it elsewhere; below 477 rpm no depth chatters."""
    model = oscillators([(FREQUENCY, DAMPING, STIFFNESS, (1.0, 0.0, 0.0))])
    process = turning_process(DIAMETER, math.pi / 2, 2e9, NORMAL_PRESSURE / 2e9, process_damping=FLANK)
    lowest = brentq(lambda speed: 1.0 if math.isinf(worst_depth(speed)) else -1.0, 1.0, 1e4)
    assert lowest / RPM == pytest.approx(477, abs=1)
    worst = [brentq(phase_error, 1.02 * lowest, 1e4, args=(lobe,)) for lobe in (2, 4, 6)]
    limits = certified_lobes(model, process, np.array(worst), 0.02).depth_limits
    np.testing.assert_allclose(limits, [worst_depth(speed) for speed in worst], rtol=1e-5)
    others = np.linspace(1.02, 3.0, 7) * lowest
    limits = certified_lobes(model, process, others, 0.02).depth_limits
    assert (limits >= [0.9999 * worst_depth(speed) for speed in others]).all()
    assert np.isinf(certified_lobes(model, process, np.array([0.98 * lowest]), 0.02).depth_limits).all()
