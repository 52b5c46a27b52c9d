"""A cut in time: against a solution of its own, the limits of the lobes, and the wall of forced vibration."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from millfrf.core import InputError
from millfrf.cutting import ChipLaw, MillingProcess, ball_profile
from millfrf.stability import (
    SpeedVariation,
    certified_lobes,
    simulate_cut,
    surface_error,
)
from modal_fit import ModalModel

Real = NDArray[np.float64]
RPM = math.pi / 30
EDGE = 1e-5  # m
FREQUENCIES, DAMPING, STIFFNESS = np.array([922.0, 800.0]), np.array([0.011, 0.02]), np.array([1.34e6, 2e6])


def two_modes(stiffness: Real = STIFFNESS) -> ModalModel:
    """One mode along X and one along Y."""
    natural = 2 * np.pi * FREQUENCIES
    mass, damped = stiffness / natural**2, natural * np.sqrt(1 - DAMPING**2)
    shapes = np.eye(2, dtype=complex)
    points = ("TCP:+X", "TCP:+Y")
    return ModalModel(-DAMPING * natural + 1j * damped, shapes / (2j * mass * damped)[:, None], shapes, points, points)


def half_immersion(kind: str, **changes: object) -> MillingProcess:
    """Up or down milling of an aluminium alloy at half immersion with three teeth."""
    start, leave = (0.0, math.pi / 2) if kind == "up" else (math.pi / 2, math.pi)
    cut = MillingProcess(3, 0.0127, math.pi / 2, 6e8, 1 / 3, 0.1, start, leave, 1e-4, kte=5e3, kre=3e3)
    return replace(cut, **changes)  # type: ignore[arg-type]


def periodic_motion(cut: MillingProcess, speed: float, depth: float, turns: int) -> tuple[Real, Real]:
    """Forced vibration of straight edges at a few angles of the last turn, by SciPy, with the force written out here.

    In stable cuts the chips of equal teeth are those of a rigid tool, so that no delay is needed.
    """
    natural = 2 * np.pi * FREQUENCIES
    mass = STIFFNESS / natural**2

    def force(angle: float) -> Real:
        total = np.zeros(2)
        for tooth in range(cut.teeth):
            phi = (angle + 2 * np.pi * tooth / cut.teeth) % (2 * np.pi)
            if cut.start_angle < phi < cut.exit_angle:
                chip, m = cut.feed_per_tooth * math.sin(phi), cut.chip_law.exponents
                along = depth * (cut.ktc * _hardened(chip, m[0]) + cut.kte)
                inward = depth * (cut.ktc * cut.krc * _hardened(chip, m[1]) + cut.kre)
                total += [
                    -along * math.cos(phi) - inward * math.sin(phi),
                    along * math.sin(phi) - inward * math.cos(phi),
                ]
        return total

    def rate(time: float, state: Real) -> Real:
        x, v = state[:2], state[2:]
        return np.concatenate([v, force(speed * time) / mass - 2 * DAMPING * natural * v - natural**2 * x])

    end = turns * 2 * np.pi / speed
    angles = np.linspace(0, 2 * np.pi, 13)[1:]
    times = end - (2 * np.pi - angles) / speed
    solution = solve_ivp(rate, (0, end), np.zeros(4), t_eval=times, rtol=1e-7, atol=1e-12, max_step=2e-5)
    return angles, solution.y[:2].T


def _hardened(chip: float, m: float) -> float:
    """Chip of the same force at the pressure of 0.1 mm; below the edge's radius along the tangent of the power."""
    if chip > EDGE:
        return chip ** (1 - m) * 1e-4**m
    return (EDGE**-m * chip + m * EDGE**-m * (EDGE - chip)) * 1e-4**m if m else chip


LAWS = (ChipLaw(), ChipLaw((0.3, 0.5, 0.2), 1e-4, EDGE))


@pytest.mark.parametrize("kind", ["up", "down"])
@pytest.mark.parametrize("law", LAWS, ids=["constant", "power"])
def test_the_motion_of_a_stable_cut_is_that_of_an_ordinary_differential_equation(kind: str, law: ChipLaw) -> None:
    cut, speed, depth = half_immersion(kind, chip_law=law), 9000 * RPM, 5e-5
    simulated = simulate_cut(two_modes(), cut, speed, depth, turns=60)
    angles, motion = periodic_motion(cut, speed, depth, 60)
    last = simulated.motion[-simulated.steps :]
    at = np.arange(1, simulated.steps + 1) * 2 * np.pi / simulated.steps
    compared = np.column_stack([np.interp(angles, at, last[:, axis]) for axis in range(2)])
    assert simulated.repeats
    # the rest of the regeneration's transient and of the loss of contact at the thin end of the chip
    assert np.abs(compared - motion).max() < 0.03 * np.ptp(motion)


@pytest.mark.parametrize("kind", ["up", "down"])
@pytest.mark.parametrize(("helix", "law"), [(0.0, LAWS[0]), (0.5, LAWS[0]), (0.5, LAWS[1])])
def test_walls_of_the_simulation_are_those_of_the_harmonics(kind: str, helix: float, law: ChipLaw) -> None:
    cut, speeds = half_immersion(kind, helix_angle=helix, chip_law=law), np.array([4000.0, 9000.0, 15000.0]) * RPM
    depth = 1e-4
    by_harmonics = surface_error(two_modes(), cut, speeds, depth)
    assert by_harmonics.stable is not None
    assert by_harmonics.stable.all()
    assert by_harmonics.wall == kind
    for number, speed in enumerate(speeds):
        simulated = simulate_cut(two_modes(), cut, float(speed), depth)
        wall = simulated.walls[-2, 0 if kind == "up" else 1]
        scale = np.abs(by_harmonics.error[number]).max()
        assert np.abs(wall - by_harmonics.error[number]).max() < 0.03 * scale


@pytest.mark.parametrize(
    ("cut", "speed"),
    [
        (half_immersion("down", helix_angle=0.5), 9000),
        (half_immersion("down"), 15000),
        (half_immersion("up"), 11000),
        # in up milling the forced vibration of unequal teeth holds some of them out of the thin chip, unlike the lobes
        (replace(half_immersion("down", helix_angle=0.4), pitch_angles=(2.0, 2.2, 2 * math.pi - 4.2)), 9000),
        (half_immersion("down", process_damping=5e4), 1500),
        (replace(half_immersion("down"), profile=ball_profile(0.0127)), 9000),
        # a sharp edge: the force at the edge radius ends at once where the chip does, as edge forces do
        (half_immersion("down", chip_law=ChipLaw((0.3, 0.5, 0.2), 1e-3, 1e-6)), 11000),
    ],
    ids=["helix", "straight", "up", "pitch", "damping", "ball", "power"],
)
def test_cuts_settle_below_the_limit_of_the_lobes_and_not_above(cut: MillingProcess, speed: float) -> None:
    limit = float(certified_lobes(two_modes(), cut, np.array([speed * RPM]), 0.006).depth_limits[0])
    assert 1e-5 < limit < 0.006
    assert _unsteadiness(cut, speed, 0.93 * limit) < 0.02 < _unsteadiness(cut, speed, 1.07 * limit)


def _unsteadiness(cut: MillingProcess, speed: float, depth: float) -> float:
    """Share of the motion that does not repeat after 400 turns with chips so thick that edges hardly leave the cut.

    A law of the chip thickness is that of the thinner chips, scaled.
    """
    law = replace(cut.chip_law, reference=10 * cut.chip_law.reference, edge_radius=10 * cut.chip_law.edge_radius)
    thick = replace(cut, feed_per_tooth=10 * cut.feed_per_tooth, kte=0.0, kre=0.0, chip_law=law)
    return simulate_cut(two_modes(), thick, speed * RPM, depth, turns=400).unsteadiness


def test_a_tooth_that_runout_holds_out_of_the_cut_leaves_its_chip_to_the_next() -> None:
    """Two teeth, one 30 um shorter at a feed of 10 um: the other cuts twice the feed, alone."""
    cut = MillingProcess(2, 0.01, math.pi / 2, 6e8, 0.3, 0.0, 0.0, math.pi, 1e-5, runout=15e-6)
    simulated = simulate_cut(two_modes(), cut, 100.0, 1e-7, turns=4)
    last = simulated.chip[-simulated.steps :]
    assert last.max() == pytest.approx(2e-5, rel=0.02)
    assert np.count_nonzero(last > 1e-9) < 0.52 * simulated.steps


def test_a_varied_speed_settles_where_a_constant_one_chatters() -> None:
    """At low speed a variation of the speed lifts the limit (Insperger & Stepan 2004)."""
    cut, speed = half_immersion("down"), 2000.0
    limit = float(certified_lobes(two_modes(), cut, np.array([speed * RPM]), 0.01).depth_limits[0])
    variation = SpeedVariation(0.2, 0.5)
    still = simulate_cut(two_modes(), cut, speed * RPM, 1.3 * limit, turns=100)
    varied = simulate_cut(two_modes(), cut, speed * RPM, 1.3 * limit, turns=100, variation=variation)
    size = [np.ptp(run.motion[-40 * run.steps :, 1]) for run in (still, varied)]
    assert not still.repeats
    assert size[1] < 0.5 * size[0]
    # every two turns, as teeth and speed do
    assert simulate_cut(two_modes(), cut, speed * RPM, 1.2 * limit, turns=100, variation=variation).repeats


def test_a_slow_variation_is_simulated_long_enough_to_repeat() -> None:
    cut, variation = half_immersion("down"), SpeedVariation(0.1, 1 / 24)
    simulated = simulate_cut(two_modes(), cut, 6000 * RPM, 1e-5, variation=variation)
    assert simulated.repeats
    with pytest.raises(InputError, match="30 turns are less than two periods of the varied speed; give 48 or more"):
        simulate_cut(two_modes(), cut, 6000 * RPM, 1e-5, turns=30, variation=variation)


def test_the_error_of_the_wall_converges_to_the_static_deflection_at_low_speed() -> None:
    """Far below the modes the tool follows the force that acts as an edge passes the wall: F_y / k_y."""
    cut = half_immersion("down", helix_angle=0.6)
    stiff, speed, depth = two_modes(1e3 * STIFFNESS), 200.0 * RPM, 8e-3
    error = surface_error(stiff, cut, np.array([speed]), depth)
    simulated = simulate_cut(two_modes(1e6 * STIFFNESS), cut, speed, depth, turns=3)
    # each height is passed when its edge has turned by its lag
    lags = 2 * error.heights * math.tan(0.6) / cut.diameter
    turn = np.arange(1, simulated.steps + 1) * 2 * np.pi / simulated.steps
    push = np.interp(np.mod(np.pi + lags, 2 * np.pi), turn, simulated.force[-simulated.steps :, 1], period=2 * np.pi)
    static = -push / (1e3 * STIFFNESS[1])
    assert np.median(np.abs(error.error[0] - static)) < 0.02 * np.abs(static).max()


def test_motion_at_frequencies_nobody_measured_is_stated() -> None:
    model = replace(two_modes(), band=(500.0, 1000.0))
    cut = half_immersion("down")
    error = surface_error(model, cut, np.array([4000.0, 15000.0]) * RPM, 1e-4)  # teeth pass at 200 and 750 Hz
    assert error.unmeasured[0] > 0.1 > error.unmeasured[1]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"feed_per_tooth": 0.0}, "feed_per_tooth_m"),
        ({"start_angle": 0.3, "exit_angle": 2.0}, "makes no wall"),
    ],
)
def test_a_cut_without_feed_or_wall_is_refused(change: dict[str, float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        surface_error(two_modes(), half_immersion("up", **change), np.array([100.0]), 1e-3)


def test_speeds_depths_and_variations_that_cannot_be_are_refused() -> None:
    cut = half_immersion("up")
    with pytest.raises(InputError, match="must be positive"):
        simulate_cut(two_modes(), cut, 0.0, 1e-3)
    with pytest.raises(InputError, match="feed_per_tooth_m"):
        simulate_cut(two_modes(), replace(cut, feed_per_tooth=0.0), 100.0, 1e-3)
    with pytest.raises(InputError, match="too long to simulate"):
        simulate_cut(two_modes(), cut, 1.0, 1e-3, turns=10**6)
    with pytest.raises(InputError, match="amplitude of 0 to below 1"):
        SpeedVariation(1.5, 0.2)
