"""Limits with coefficients that depend on the chip thickness, against simulations that share no code with them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from random_cutters import TWO_MODES, RandomCutter, judge_limit, modal_model, random_cutter
from sliced_mill import Structure

from millfrf.core import InputError
from millfrf.cutting import ChipLaw, MillingProcess, turning_process
from millfrf.stability import (
    SpeedVariation,
    certified_lobes,
    certified_numerics,
    collocation,
    multi_frequency,
    nyquist_limits,
    semi_discretisation,
    varied_speed_limits,
    zero_order,
)

Real = NDArray[np.float64]
RPM = math.pi / 30
LAW = ChipLaw((0.3, 0.5, 0.4), edge_radius=8e-6)
SPEEDS = np.linspace(9000, 19000, 5) * RPM


MODEL = modal_model(TWO_MODES)


def _cut(start: float = 0.0, leave: float = math.pi / 2, **changes: object) -> MillingProcess:
    values: dict[str, object] = {"feed_per_tooth": 1e-4, "chip_law": LAW} | changes
    return MillingProcess(2, 0.012, math.pi / 2, 3e8, 0.35, 0.15, start, leave, **values)  # type: ignore[arg-type]


def _with_law(drawn: RandomCutter, seed: int) -> MillingProcess:
    """A law with exponents of steels (tangential) and thrust, whose pressure at 0.1 mm is that of the drawn cutter."""
    rng = np.random.default_rng([5, seed])
    exponents = (float(rng.uniform(0.1, 0.4)), float(rng.uniform(0.1, 0.6)), float(rng.uniform(0.1, 0.6)))
    law = ChipLaw(exponents, float(rng.uniform(3e-5, 1e-3)), float(rng.uniform(4e-6, 15e-6)))
    return replace(drawn.process, chip_law=law, ktc=drawn.process.ktc * (1e-4 / law.reference) ** exponents[0])


@pytest.mark.parametrize(
    ("seed", "steps"),
    [(3, 1440), (5, 1440), (7, 1440), *(pytest.param(seed, 4320, marks=pytest.mark.slow) for seed in range(21))],
)
def test_random_cutters_decay_below_their_limit_and_grow_above(seed: int, steps: int) -> None:
    """The simulation of short cuts with thin chips is right to 2 % from 4320 steps a turn on."""
    drawn = random_cutter(seed)
    judge_limit(replace(drawn, process=_with_law(drawn, seed)), steps)


def _chatters(process: MillingProcess, structure: Structure, speed: float, depth: float) -> bool:
    """Whether a small disturbance of a straight-edged cut grows, by the forces of the law themselves, not linearised.

    Every instant the chip is the feed's less the tool's advance since the tooth before it passed. The motion settles
    first with chips of a rigid tool, which are those of the periodic motion; then chips follow the motion, and one of
    two runs is pushed by a hundred thousandth of the feed, so that the chips of both end at the same instant: that a
    force ends earlier where a chip does is no part of the limits. The law is written out here.
    """
    steps = 2000 * process.teeth  # a turn
    pitch, settling, turns, step = steps // process.teeth, 20, 44, 2 * math.pi / steps / speed
    law, coefficients = process.chip_law, process.ktc * np.array([1.0, process.krc, process.kac])
    decay = np.exp(structure.poles * step)
    push = (decay - 1) / structure.poles
    motion = np.zeros((steps * turns, 2, 3))  # of both runs
    state = np.zeros((2, len(structure.poles)), dtype=complex)
    force = np.zeros((2, 3))
    for i in range(pitch, len(motion)):
        state = decay * state + push * (force @ structure.left.T)
        motion[i] = 2 * np.real(state @ structure.right)
        since = (motion[i] - motion[i - pitch]) * (i >= settling * steps)
        if i == settling * steps:
            state[1] += 1e-5 * process.feed_per_tooth / np.abs(structure.right).max()
        force = np.zeros((2, 3))
        for tooth in range(process.teeth):
            phi = 2 * math.pi * ((i + 0.5) / steps + tooth / process.teeth) % (2 * math.pi)
            if not process.start_angle < phi < process.exit_angle:
                continue
            chip = np.maximum(process.feed_per_tooth * math.sin(phi) + since @ [math.sin(phi), math.cos(phi), 0], 0)
            pressed = []
            for pressure, m in zip(coefficients, law.exponents, strict=True):
                bent = pressure * law.edge_radius * (law.edge_radius / law.reference) ** -m
                tangent = (1 - m) * bent / law.edge_radius
                power = pressure * chip * (np.maximum(chip, law.edge_radius) / law.reference) ** -m
                pressed.append(np.where(chip > law.edge_radius, power, bent + tangent * (chip - law.edge_radius)))
            along, inward, up = (depth * np.where(chip > 0, value, 0.0) for value in pressed)
            force[:, 0] += -along * math.cos(phi) - inward * math.sin(phi)
            force[:, 1] += along * math.sin(phi) - inward * math.cos(phi)
            force[:, 2] -= up
    apart = np.linalg.norm(motion[:, 1] - motion[:, 0], axis=1).reshape(turns, -1).max(axis=1)
    return bool(apart[-1] > apart[(settling + turns) // 2])


@pytest.mark.parametrize(
    ("start", "leave", "rpm"),
    [
        (0.0, 1.2, 11000.0),
        pytest.param(1.9, math.pi, 9000.0, marks=pytest.mark.slow),
        pytest.param(0.0, math.pi, 14000.0, marks=pytest.mark.slow),
    ],
)
def test_the_limit_is_that_of_the_forces_themselves(start: float, leave: float, rpm: float) -> None:
    process, structure = _cut(start, leave), TWO_MODES
    [limit] = certified_numerics(MODEL, process, np.array([rpm * RPM]), 0.01).depth_limits
    assert not _chatters(process, structure, rpm * RPM, 0.98 * limit)
    assert _chatters(process, structure, rpm * RPM, 1.02 * limit)


@pytest.mark.parametrize("changes", [{}, {"helix_angle": 0.5}, {"pitch_angles": (3.0, 2 * math.pi - 3.0)}])
def test_exponents_of_zero_are_the_constant_law(changes: dict[str, object]) -> None:
    bare = _cut(chip_law=ChipLaw(), **changes)
    law = _cut(chip_law=ChipLaw((0.0, 0.0, 0.0), 1e-4, 1e-5), **changes)
    limits = [certified_numerics(MODEL, process, SPEEDS, 0.01).depth_limits for process in (bare, law)]
    np.testing.assert_array_equal(*limits)


def test_a_tiny_exponent_changes_limits_by_as_little() -> None:
    tiny = _cut(chip_law=ChipLaw((1e-7, 1e-7, 1e-7), edge_radius=8e-6))
    limits = [collocation(MODEL, process, SPEEDS, 0.01).depth_limits for process in (_cut(chip_law=ChipLaw()), tiny)]
    np.testing.assert_allclose(*limits, rtol=3e-6)


@pytest.mark.parametrize(("start", "leave"), [(0.0, math.pi / 2), (1.9, math.pi), (0.0, math.pi), (1.0, 2.2)])
def test_solvers_agree(start: float, leave: float) -> None:
    process = _cut(start, leave)
    limits = collocation(MODEL, process, SPEEDS, 0.01).depth_limits
    certified = certified_lobes(MODEL, process, SPEEDS, 0.01)
    np.testing.assert_allclose(certified.depth_limits, limits, rtol=1e-6)
    assert certified.status == ("verified",) * len(SPEEDS)
    np.testing.assert_allclose(multi_frequency(MODEL, process, SPEEDS, 0.01).depth_limits, limits, rtol=2e-3)
    third = semi_discretisation(MODEL, process, SPEEDS[:2], 0.01, steps=120, order=3)
    np.testing.assert_allclose(third.depth_limits, limits[:2], rtol=2e-3)
    barely_helical = certified_numerics(MODEL, replace(process, helix_angle=1e-4), SPEEDS[:2], 0.01)
    np.testing.assert_allclose(barely_helical.depth_limits, limits[:2], rtol=1e-3)
    barely_varied = varied_speed_limits(MODEL, process, SPEEDS[:1], 0.01, SpeedVariation(1e-6, 1.0))
    np.testing.assert_allclose(barely_varied.depth_limits, limits[:1], rtol=5e-3)


def test_unequal_pitch_has_a_feed_for_each_tooth() -> None:
    process = _cut(1.9, math.pi, pitch_angles=(2.9, 2 * math.pi - 2.9))
    limits = certified_numerics(MODEL, process, SPEEDS, 0.01).depth_limits
    np.testing.assert_allclose(multi_frequency(MODEL, process, SPEEDS, 0.01).depth_limits, limits, rtol=2e-3)


def test_averaged_solvers_agree_with_each_other() -> None:
    process = _cut(0.0, math.pi)
    pair = [solver(MODEL, process, SPEEDS, 0.01).depth_limits for solver in (zero_order, nyquist_limits)]
    np.testing.assert_allclose(*pair, rtol=1e-3)


def test_the_chip_of_a_turning_tool_scales_its_limit() -> None:
    """The chip is constant: the limit is that of a constant coefficient ``(1 - m) K (h / h_0)^-m``."""
    law = ChipLaw((0.25, 0.25, 0.25), 2e-4, 1e-5)
    feed, angle = 5e-5, 1.2
    tool = turning_process(0.05, angle, 2e9, 0.3, 0.1, feed=feed, chip_law=law)
    slope = 0.75 * (feed * math.sin(angle) / 2e-4) ** -0.25
    equivalent = replace(tool, ktc=tool.ktc * slope, chip_law=ChipLaw())
    speeds = np.array([900.0, 2200.0]) * RPM
    limits = [certified_numerics(MODEL, process, speeds, 0.05).depth_limits for process in (tool, equivalent)]
    assert np.isfinite(limits[0]).all()
    np.testing.assert_allclose(*limits, rtol=1e-9)


def test_more_feed_makes_deeper_cuts_stable() -> None:
    """Far above the edge radius limits grow as ``f^m``, with the same exponent everywhere; the law is a scale."""
    law = ChipLaw((0.3, 0.3, 0.3), edge_radius=1e-7)
    feeds = (1e-4, 2e-4)
    limits = [
        collocation(MODEL, _cut(1.0, 2.0, chip_law=law, feed_per_tooth=feed), SPEEDS, 0.02).depth_limits
        for feed in feeds
    ]
    np.testing.assert_allclose(limits[1], limits[0] * 2**0.3, rtol=1e-6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"feed_per_tooth": 0.0}, "give feed_per_tooth_m"),
        ({"chip_law": (0.3, 0.3, 1.0)}, r"kac_exponent = 1.0 must be 0 to below 1"),
        ({"chip_law": (0.3, 0.3, -0.1)}, r"kac_exponent = -0.1"),
        ({"edge_radius": 0.0}, "give edge_radius_m"),
        ({"reference": 0.0}, "reference_chip"),
    ],
)
def test_what_the_law_needs_is_named(changes: dict[str, object], message: str) -> None:
    values = {"exponents": (0.3, 0.3, 0.3), "reference": 1e-3, "edge_radius": 1e-5} | changes
    feed = values.pop("feed_per_tooth", 1e-4)
    values["exponents"] = values.pop("chip_law", values["exponents"])
    with pytest.raises(InputError, match=message):
        replace(_cut(chip_law=ChipLaw(**values)), feed_per_tooth=feed)  # type: ignore[arg-type]
