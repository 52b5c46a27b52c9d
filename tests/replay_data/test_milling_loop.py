"""The regenerative loop against its linear equation, published cuts, and its own refinement."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from millfrf.cutting import MillingProcess, tooth_force, tooth_offsets
from millfrf.cutting.tooth import rigid_force
from modal_fit import ModalModel
from replay_data import ConstantSpeed, LinearSweep, SpeedProfile, default_structure, table_one_model, tip_model
from replay_data.milling_loop import empty_memory, material_named, mill, prepare_cut
from replay_data.modal_integrator import discretise

RPM = math.pi / 30
DOWN_MILLING = MillingProcess(2, 12.7e-3, math.pi / 2, 119e6, 0.17, 0.33, math.pi / 2, math.pi, 0.15e-3)
TABLE_ONE = table_one_model()


def simulate(
    structure: ModalModel,
    process: MillingProcess,
    depth: float,
    profile: SpeedProfile,
    duration: float,
    step: float,
    material: str = "homogeneous",
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Spindle angle (n,), force (n, 3) and displacement of the tip (n, 3)."""
    angles = profile.angle(np.arange(round(duration / step)) * step)
    delay = math.ceil(2 * math.pi / process.teeth / (profile.slowest * step))
    memory = empty_memory(len(structure.poles), process.teeth, delay)
    force, history = np.empty((len(angles), 3)), np.empty((len(angles), 2 * len(structure.poles)))
    cut = prepare_cut(process, depth, material_named(material), 1)
    mill(angles, angles[1], discretise(structure, step), cut, tooth_offsets(process), memory, force, history)
    displacement = 2 * np.real(history.view(complex) @ tip_model(structure).right)
    return angles, force, displacement


def regenerative_force(
    process: MillingProcess, depth: float, angle: float, moved: NDArray[np.float64]
) -> NDArray[np.float64]:
    """``a Ktc [alpha(t)] (X - X_tau)``, Mohammadi & Ahmadi, Eqs. 1 and 2, tooth by tooth."""
    sine_edge, cosine_edge = math.sin(process.edge_angle), math.cos(process.edge_angle)
    total = np.zeros(3)
    for tooth in range(process.teeth):
        phi = (angle + 2 * math.pi * tooth / process.teeth) % (2 * math.pi)
        if process.start_angle < phi < process.exit_angle:
            thickness = (moved[0] * math.sin(phi) + moved[1] * math.cos(phi)) * sine_edge - moved[2] * cosine_edge
            unit = (1.0, process.krc, process.kac)
            direction = tooth_force(math.sin(phi), math.cos(phi), sine_edge, cosine_edge, *unit)
            total += depth * process.ktc * thickness * np.array(direction)
    return total


@pytest.mark.parametrize("edge_degrees", [90.0, 60.0])
@pytest.mark.parametrize(
    "profile", [ConstantSpeed(837 * RPM), LinearSweep(600 * RPM, 900 * RPM, 0.5)], ids=["constant", "sweep"]
)
def test_the_force_is_the_rigid_force_and_the_regenerative_one(profile: SpeedProfile, edge_degrees: float) -> None:
    """Eq. 1 with tau taken on the angle axis. 837 rpm: the delay is not a whole number of steps."""
    process = replace(DOWN_MILLING, start_angle=0.3, exit_angle=2.5, edge_angle=math.radians(edge_degrees))
    angles, force, displacement = simulate(default_structure(), process, 0.4e-3, profile, 0.5, 1 / 20480)
    rigid = rigid_force(process, 0.4e-3, angles)
    edges = np.array([process.start_angle, process.exit_angle])
    compared, largest = 0, 0.0
    for index in range(3000, 10000, 7):  # while the start still rings
        phi = angles[index] % math.pi
        if np.abs(phi - edges).min() < 0.02:
            continue
        earlier = [np.interp(angles[index] - math.pi, angles, displacement[:, d]) for d in range(3)]
        expected = regenerative_force(process, 0.4e-3, angles[index], displacement[index] - earlier)
        np.testing.assert_allclose(force[index] - rigid[index], expected, atol=2e-5 * np.abs(rigid).max())
        compared += 1
        largest = max(largest, np.abs(expected).max())
    assert compared > 300
    assert largest > 0.01 * np.abs(rigid).max()


def test_a_stiff_structure_feels_the_rigid_force_with_runout() -> None:
    """Teeth that run large and a tooth that no longer touches: the mean is that of the rigid tool."""
    stiff = replace(TABLE_ONE, right=TABLE_ONE.right * 1e-6)
    for runout in (10e-6, 120e-6):
        process = replace(DOWN_MILLING, runout=runout, kte=2000.0)
        angles, force, _ = simulate(stiff, process, 1e-3, ConstantSpeed(900 * RPM), 1.0, 1 / 20480)
        turns = force[angles > 2 * math.pi]
        turns = turns[: len(turns) // (20480 // 15) * (20480 // 15)]
        expected = rigid_force(process, 1e-3, np.linspace(0, 2 * np.pi, 20000, endpoint=False)).mean(axis=0)
        np.testing.assert_allclose(turns.mean(axis=0), expected, rtol=2e-3)


def refinement_errors(process: MillingProcess) -> NDArray[np.float64]:
    """Displacement at the same instants for steps of 1/2560 ... 1/20480 s, against 1/163840 s, relative."""
    profile, structure = ConstantSpeed(823 * RPM), default_structure()
    results = []
    for refinement in (1, 2, 4, 8, 64):
        _, _, displacement = simulate(structure, process, 1e-3, profile, 1.0, 1 / (2560 * refinement))
        results.append(displacement[::refinement])
    errors = [np.sqrt(np.mean((result - results[-1]) ** 2)) for result in results[:-1]]
    return np.array(errors) / results[-1].std()


def test_refining_the_step_converges_to_second_order() -> None:
    """Although teeth enter and leave the cut between instants."""
    errors = refinement_errors(replace(DOWN_MILLING, start_angle=0.5, exit_angle=2.0))
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), 2.0, atol=0.1)


def test_teeth_that_leave_with_vanishing_chip_cost_an_order_but_little_accuracy() -> None:
    """Half immersion with runout: contact is lost just before the exit, at an instant that no step hits."""
    errors = refinement_errors(replace(DOWN_MILLING, runout=5e-6))
    assert np.polyfit([0, 1, 2, 3], -np.log2(errors), 1)[0] > 1
    assert errors[-1] < 1e-3


def per_tooth(angles: NDArray[np.float64], displacement: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacement in Y once a tooth, um, over the last 100 teeth."""
    passes = np.arange(1, int(angles[-1] / math.pi)) * math.pi
    return np.asarray(1e6 * np.interp(passes, angles, displacement[:, 1])[-100:])


@pytest.mark.parametrize(
    ("speed", "depth", "kind"),
    [
        (800, 1.5, "stable"),
        (800, 2.0, "hopf"),
        (900, 1.5, "stable"),
        (900, 2.0, "hopf"),
        (1100, 0.5, "stable"),
        (1200, 1.8, "stable"),
        (1200, 2.3, "hopf"),
        (1600, 2.7, "stable"),
        (1600, 3.4, "hopf"),
        (1050, 1.2, "stable"),
        (1050, 1.6, "period-doubling"),
    ],
)
def test_published_cuts_are_stable_or_chatter_as_published(speed: float, depth: float, kind: str) -> None:
    """Table 1, half-immersion down-milling (Mohammadi & Ahmadi, Fig. 16; semi-discretization: limit 2.04 mm at
    1200 rpm, and at 1050 rpm a period-doubling notch down to 1.36 mm, below the 1.8 mm of the Hopf limit)."""
    profile = ConstantSpeed(speed * RPM)
    angles, _, displacement = simulate(TABLE_ONE, DOWN_MILLING, depth * 1e-3, profile, 25.0, 1 / 5120)
    sampled = per_tooth(angles, displacement)
    alternation = abs(np.mean(sampled[::2]) - np.mean(sampled[1::2]))
    if kind == "stable":
        assert sampled.std() < 0.1
        return
    assert sampled.std() > 5
    within_branch = max(sampled[::2].std(), sampled[1::2].std())
    assert (alternation > 20 * within_branch) == (kind == "period-doubling")


def test_hopf_chatter_vibrates_at_the_published_frequency_and_stays_finite() -> None:
    """800 rpm: 17.2 Hz at the limit (zero-order). Teeth leave the cut, so that the amplitude settles."""
    step, duration = 1 / 5120, 40.0
    angles, force, displacement = simulate(TABLE_ONE, DOWN_MILLING, 2e-3, ConstantSpeed(800 * RPM), duration, step)
    tail = displacement[len(angles) // 2 :, 1]
    spectrum = np.abs(np.fft.rfft((tail - tail.mean()) * np.hanning(len(tail)), 8 * len(tail)))
    frequencies = np.fft.rfftfreq(8 * len(tail), step)
    away = np.abs(frequencies - np.rint(frequencies / (800 / 60)) * 800 / 60) > 0.5
    assert frequencies[np.where(away, spectrum, 0).argmax()] == pytest.approx(17.3, abs=0.3)
    first, second = np.array_split(tail, 2)
    assert second.std() == pytest.approx(first.std(), rel=0.02)
    in_cut = (angles % math.pi > math.pi / 2 + 0.05) & (angles % math.pi < math.pi - 0.05)
    assert (np.abs(force[in_cut]).max(axis=1) == 0).any()


def test_pores_keep_the_mean_force_and_are_the_same_for_any_step() -> None:
    stiff = replace(TABLE_ONE, right=TABLE_ONE.right * 1e-6)
    slot = replace(DOWN_MILLING, start_angle=0.0)
    profile = ConstantSpeed(820 * RPM)
    _, coarse, _ = simulate(stiff, slot, 2e-3, profile, 60.0, 1 / 5120, "porous")
    _, fine, _ = simulate(stiff, slot, 2e-3, profile, 2.0, 1 / 20480, "porous")
    _, solid, _ = simulate(stiff, slot, 2e-3, profile, 60.0, 1 / 5120)
    # 1640 passes of about 13 cells, each of relative spread 0.9: 0.6 % of the mean of |force|, one sigma
    np.testing.assert_allclose(coarse.mean(axis=0), solid.mean(axis=0), atol=4 * 0.0062 * np.abs(solid).mean())
    same = np.abs(coarse[: 2 * 5120] - fine[::4])
    assert np.median(same) < 1e-9 * np.abs(fine).max()
    assert (same.max(axis=1) > 0.01 * np.abs(fine).max()).mean() < 0.02  # only where an instant straddles a border
