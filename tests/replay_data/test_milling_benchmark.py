"""Growth per tooth in the time domain against converged stability limits of the one-degree-of-freedom benchmark."""

import math

import numpy as np
import pytest

from millfrf.core import TIP
from millfrf.cutting import MillingProcess, tooth_offsets
from modal_fit import ModalModel
from replay_data.milling_loop import empty_memory, material_named, mill, prepare_cut
from replay_data.modal_integrator import discretise

STEPS_PER_TOOTH = 512


def benchmark_structure() -> ModalModel:
    """922 Hz, 1.1 %, 0.03993 kg in the feed direction (Insperger & Stepan's milling benchmark)."""
    natural, zeta, mass = 2 * math.pi * 922, 0.011, 0.03993
    damped = natural * math.sqrt(1 - zeta**2)
    right = np.array([[1 / (2j * mass * damped), 0, 0]])
    left = np.array([[1, 0, 0]], dtype=complex)
    return ModalModel(np.array([-zeta * natural + 1j * damped]), right, left, TIP, TIP)


def growth_per_tooth(start: float, leave: float, speed_rpm: float, depth: float) -> float:
    """Growth from tooth to tooth of the difference of two runs that begin a hair apart; no tooth leaves the cut."""
    process = MillingProcess(2, 12.7e-3, math.pi / 2, 6e8, 1 / 3, 0.0, start, leave, 1.0)
    step = 60 / speed_rpm / 2 / STEPS_PER_TOOTH
    angles = np.arange(STEPS_PER_TOOTH * 400) * math.pi / STEPS_PER_TOOTH
    histories = []
    for offset in (0.0, 1e-9):
        memory = empty_memory(1, 2, STEPS_PER_TOOTH + 1)
        memory.modal[0] = offset
        force, history = np.empty((len(angles), 3)), np.empty((len(angles), 2))
        cut = prepare_cut(process, depth, material_named("homogeneous"), 0)
        dynamics = discretise(benchmark_structure(), step)
        mill(angles, angles[1], dynamics, cut, tooth_offsets(process), memory, force, history)
        histories.append(history)
    difference = np.linalg.norm((histories[1] - histories[0])[::STEPS_PER_TOOTH], axis=1)
    return float((difference[-1] / difference[200]) ** (1 / 199))


@pytest.mark.parametrize(
    ("start", "leave", "speed_rpm", "limit_mm"),
    [
        (0.0, math.pi, 6000, 0.35322),
        (0.0, math.pi, 8000, 0.67639),
        (0.0, math.pi, 10000, 0.32238),
        (0.0, math.pi / 2, 6000, 0.22789),
        (0.0, math.pi / 2, 15000, 0.25887),
    ],
)
def test_growth_turns_at_the_converged_limit(start: float, leave: float, speed_rpm: float, limit_mm: float) -> None:
    """Limits by collocation split at entry and exit, five digits; growth changes by 0.1 to 0.3 per relative depth, so
    that 3e-4 stands for 0.3 % of the limit."""
    assert growth_per_tooth(start, leave, speed_rpm, limit_mm * 1e-3) == pytest.approx(1.0, abs=3e-4)
    assert growth_per_tooth(start, leave, speed_rpm, 0.97 * limit_mm * 1e-3) < 0.998
    assert growth_per_tooth(start, leave, speed_rpm, 1.03 * limit_mm * 1e-3) > 1.002
