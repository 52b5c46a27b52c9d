"""The planar robot of Chen et al. 2026: published figures, rigid limit, gravity, identification."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation import Frf
from millfrf.core import FileFormatError, InputError
from millfrf.robot_model import (
    PlanarRobot,
    apply_identified,
    assumptions,
    exact_receptance,
    identify_from_frequencies,
    read_planar_robot,
    rigid_matrices,
    rigid_model,
)
from millfrf.robot_model.dynamic_stiffness import coupled_receptance
from millfrf.robot_model.finite_elements.beam_element import Section
from millfrf.robot_model.identification.parameter_search import identify_from_frfs

CHEN = read_planar_robot("chen_2026")


def test_printed_table_gives_these_frequencies() -> None:
    """Not the paper's 16, 14 and 10 Hz: no angle convention reaches them with its masses and stiffnesses."""
    first = [rigid_model(CHEN.robot, angles).natural_frequencies[0] for angles in CHEN.poses.values()]
    assert first == pytest.approx([11.96, 11.79, 11.40], abs=0.005)


def test_tip_height_and_reach() -> None:
    tips = np.array([CHEN.robot.tip(angles) for angles in CHEN.poses.values()])
    assert tips[:, 1] == pytest.approx([-0.543] * 3, abs=5e-4)
    assert tips[:, 0] == pytest.approx([0.76, 1.02, 1.26], abs=5e-3)


def test_gravity_stiffness_is_the_second_derivative_of_the_potential() -> None:
    angles = np.array([0.4, -1.1, 0.6])

    def potential(small: np.ndarray) -> float:
        directions = CHEN.robot.directions(angles + small)
        rise = CHEN.robot.lengths * np.sin(directions)
        return float(9.81 * CHEN.robot.masses @ (np.cumsum(rise) - rise / 2))

    step, unit = 1e-4, np.eye(3)
    hessian = np.array(
        [
            [
                (
                    potential(step * (a + b))
                    - potential(step * (a - b))
                    - potential(step * (b - a))
                    + potential(-step * (a + b))
                )
                / (4 * step**2)
                for b in unit
            ]
            for a in unit
        ]
    )
    with_gravity = rigid_matrices(CHEN.robot, angles, 9.81)[1] - rigid_matrices(CHEN.robot, angles)[1]
    assert with_gravity == pytest.approx(hessian, rel=1e-4, abs=1e-2)


def test_exact_links_made_stiff_are_the_rigid_model() -> None:
    """The difference falls as 1 / stiffness; what remains after extrapolation is below 1e-6."""
    frequencies = np.array([0.0, 5.0, 11.0, 14.0, 22.0, 40.0])
    angles = CHEN.poses["P2"]
    undamped = replace(CHEN.robot, damping_ratios=np.zeros(3))
    rigid = rigid_model(undamped, angles).receptance(frequencies)

    def exact(stiffness: float) -> np.ndarray:
        stiff = tuple(
            Section(stiffness, stiffness, stiffness, stiffness, mass / length)
            for mass, length in zip(CHEN.robot.masses, CHEN.robot.lengths, strict=True)
        )
        return exact_receptance(replace(undamped, sections=stiff), angles, frequencies).values

    coarse, fine = exact(4e9), exact(8e9)
    assert np.abs(coarse - rigid).max() / np.abs(fine - rigid).max() == pytest.approx(2, rel=0.01)
    assert np.abs(2 * fine - coarse - rigid).max() < 1e-6 * np.abs(rigid).max()


@settings(max_examples=20)
@given(st.lists(st.floats(-2.5, 2.5), min_size=3, max_size=3), st.floats(1.0, 400.0))
def test_assembly_is_receptance_coupling_and_reciprocal(angles: list[float], hertz: float) -> None:
    assembled = exact_receptance(CHEN.robot, np.array(angles), np.array([hertz])).values[0]
    coupled = coupled_receptance(CHEN.robot, np.array(angles), np.array([hertz])).values[0]
    size = np.abs(assembled).max()
    assert np.abs(assembled - coupled).max() < 1e-7 * size
    assert np.abs(assembled - assembled.T).max() < 1e-9 * size
    assert np.linalg.eigvalsh(assembled.imag).max() < 1e-9 * size  # power flows in


def test_identification_recovers_stiffness_within_its_error_bars() -> None:
    rng = np.random.default_rng(7)
    lines = np.linspace(10.0, 30.0, 31)  # the paper's band
    measured = []
    for angles in CHEN.poses.values():
        model = rigid_model(CHEN.robot, angles)
        clean = model.receptance(lines)[:, :2, :2]
        noise = rng.normal(size=(*clean.shape, 2)) @ np.array([1, 1j]) * 0.02 / np.sqrt(2)
        frf = Frf(
            lines, clean * (1 + noise), model.responses[:2], model.excitations[:2], "receptance", "m/N", lines > 0
        )
        measured.append((angles, frf))
    guess = replace(CHEN.robot, stiffness=CHEN.robot.stiffness * [2.0, 0.6, 1.3])
    result = identify_from_frfs(guess, measured, ("stiffness",))
    assert result.unidentifiable == ()
    assert np.all(np.abs(result.values - CHEN.robot.stiffness) < 3.5 * result.standard_errors)
    assert apply_identified(guess, result).stiffness == pytest.approx(result.values)


def test_three_frequencies_do_not_fix_nine_parameters() -> None:
    poses = [(angles, CHEN.measured[name]) for name, angles in CHEN.poses.items()]
    result = identify_from_frequencies(CHEN.robot, poses, search=False)
    assert len(result.unidentifiable) >= 6
    assert not result.identifiable.all()
    first = [rigid_model(apply_identified(CHEN.robot, result), a).natural_frequencies[0] for a, _ in poses]
    assert np.abs(np.array(first) / [15.5, 13.6, 10.0] - 1).max() < 0.08


def test_assumed_numbers_are_listed() -> None:
    assert len(assumptions("chen_2026")) == 3


def test_bad_input_says_what_to_do(tmp_path: object) -> None:
    with pytest.raises(InputError, match="chen_2026"):
        read_planar_robot("nobody")
    with pytest.raises(InputError, match="2 joint angles for 3 links"):
        CHEN.robot.tip(np.zeros(2))
    with pytest.raises(InputError, match="must be positive"):
        PlanarRobot(np.array([1.0]), np.array([-1.0]), np.array([1.0]), np.array([0.1]))
    broken = tmp_path / "r.toml"  # type: ignore[operator]
    broken.write_text('[robot]\nname = "x"\nkind = "planar"\nsource = "s"\nlinks = 3\n')
    with pytest.raises(FileFormatError, match="links"):
        read_planar_robot(broken)
