"""Forces of cutting teeth against the printed matrix, closed-form means and what must hold for any cutter."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from millfrf.core import InputError
from millfrf.cutting import MillingProcess, engaged_share, tooth_force, wrapped_immersion
from millfrf.cutting.tooth import rigid_chip_thickness, rigid_force

QUARTER, HALF = math.pi / 2, math.pi
immersions = st.floats(0, math.pi)
edge_angles = st.floats(0.2, math.pi / 2)


def acetal(start: float = QUARTER, leave: float = HALF, **changes: float) -> MillingProcess:
    """The cutter and material of Mohammadi & Ahmadi."""
    return MillingProcess(2, 12.7e-3, QUARTER, 119e6, 0.17, 0.33, start, leave, 0.15e-3, **changes)


def test_the_mean_over_a_turn_is_the_published_average_directional_matrix() -> None:
    """Half immersion, down-milling, krc = .17, kac = .33; three printed digits."""
    angles = (np.arange(20000) + 0.5) * 2 * np.pi / 20000
    total = np.zeros((3, 3))
    for angle in angles[(angles > QUARTER) & (angles < HALF)]:
        sine, cosine = math.sin(angle), math.cos(angle)
        total += 2 * np.outer(tooth_force(sine, cosine, 1.0, 0.0, 1.0, 0.17, 0.33), [sine, cosine, 0.0])
    published = [[0.117, -0.223, 0], [0.277, -0.202, 0], [-0.105, 0.105, 0]]
    np.testing.assert_allclose(total / len(angles), published, atol=6e-4)


@pytest.mark.parametrize(("start", "leave"), [(0.0, HALF), (QUARTER, HALF), (0.0, 0.7), (1.2, 1.9)])
def test_mean_forces_are_the_closed_form_of_altintas(start: float, leave: float) -> None:
    """Manufacturing Automation, 2nd ed., section 2.8, with the axial force counted along +Z of the tool."""
    process = acetal(start, leave, kte=3000.0, kre=2000.0, kae=1000.0)
    depth, feed, teeth = 2e-3, process.feed_per_tooth, process.teeth
    tangential, radial, axial = process.ktc, process.krc * process.ktc, process.kac * process.ktc

    def primitive(phi: float) -> np.ndarray:
        chip, edge = teeth * depth * feed / (8 * math.pi), teeth * depth / (2 * math.pi)
        s1, c1, s2, c2 = math.sin(phi), math.cos(phi), math.sin(2 * phi), math.cos(2 * phi)
        return np.array(
            [
                chip * (tangential * c2 - radial * (2 * phi - s2)) + edge * (-process.kte * s1 + process.kre * c1),
                chip * (tangential * (2 * phi - s2) + radial * c2) - edge * (process.kte * c1 + process.kre * s1),
                edge * (axial * feed * c1 - process.kae * phi),
            ]
        )

    angles = (np.arange(400_000) + 0.5) * 2 * np.pi / 400_000
    mean = rigid_force(process, depth, angles).mean(axis=0)
    np.testing.assert_allclose(mean, primitive(leave) - primitive(start), rtol=1e-4, atol=1e-4 * np.abs(mean).max())


@given(immersions, edge_angles, st.floats(-5, 5), st.floats(0, 5), st.floats(-5, 5))
def test_radial_force_opposes_the_chip_and_all_three_keep_their_length(
    angle: float, edge: float, tangential: float, radial: float, axial: float
) -> None:
    outward = np.array([math.sin(angle) * math.sin(edge), math.cos(angle) * math.sin(edge), -math.cos(edge)])
    force = tooth_force(math.sin(angle), math.cos(angle), math.sin(edge), math.cos(edge), tangential, radial, axial)
    assert np.dot(force, outward) == pytest.approx(-radial, abs=1e-12)
    assert np.linalg.norm(force) == pytest.approx(math.sqrt(tangential**2 + radial**2 + axial**2), abs=1e-12)


@given(immersions, st.floats(0.05, 1.0), st.floats(1e-3, 0.4), st.floats(0, 1))
def test_shares_of_a_pass_add_up_to_the_immersion(start: float, width: float, step: float, phase: float) -> None:
    """However the instants fall, no part of the immersion is lost or counted twice."""
    count = int((width + 2 * step) / step) + 3
    angles = start - 2 * step + step * (phase + np.arange(count))
    shares = [engaged_share(angle, step, start, start + width)[0] for angle in angles]
    assert sum(shares) * step == pytest.approx(width, abs=1e-12)


@given(st.floats(-50, 50))
def test_wrapping_keeps_the_direction_and_leaves_the_immersion_whole(angle: float) -> None:
    wrapped = wrapped_immersion(angle)
    assert -QUARTER - 1e-12 <= wrapped <= 3 * QUARTER + 1e-12
    assert math.cos(wrapped - angle) == pytest.approx(1, abs=1e-12)


@given(st.integers(1, 6), st.floats(0, 400e-6), st.floats(0.1, 3.0))
def test_runout_shifts_the_chip_among_teeth_but_removes_the_same(teeth: int, runout: float, angle: float) -> None:
    """Over a turn the teeth together remove teeth x feed, even when some of them no longer touch."""
    process = MillingProcess(teeth, 0.02, QUARTER, 1e9, 0.3, 0.1, 0.0, HALF, 0.1e-3, runout=runout)
    chips = [rigid_chip_thickness(process, tooth, np.array([angle]))[0] for tooth in range(teeth)]
    assert sum(chips) == pytest.approx(teeth * process.feed_per_tooth * math.sin(angle), rel=1e-9)


def test_a_negative_depth_is_refused() -> None:
    with pytest.raises(InputError, match=r"depth = -0.001 m must be zero or more"):
        rigid_force(acetal(), -1e-3, np.zeros(1))
