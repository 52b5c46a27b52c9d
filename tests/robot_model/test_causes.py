"""What is wrong with the model: single causes told apart from frequencies at several postures."""

from dataclasses import replace

import numpy as np
import pytest

from millfrf.core import InputError
from millfrf.robot_model import SpatialRobot, modes_at, read_spatial_robot, with_joint_factor, with_payload
from millfrf.robot_model.model_updating.changes import with_link_factor, with_rigid_links
from millfrf.robot_model.model_updating.weighed_changes import (
    PostureFrequencies,
    equivalent_causes,
    explain_frequencies,
)

CASE = read_spatial_robot("staubli_rx170")
ROBOT = CASE.robot
POSTURES = np.radians([[0, -20, 110, 0, 90, 0], [0, 30, 60, 20, 60, 0], [0, 50, 30, 80, -60, 0]])


def _found(truth: SpatialRobot, postures: np.ndarray, noise: float = 0.0, n_modes: int = 5) -> list[PostureFrequencies]:
    rng = np.random.default_rng(2)
    cases = []
    for q in postures:
        frequencies = modes_at(truth, q).frequencies[:n_modes]
        cases.append(PostureFrequencies(q, frequencies * (1 + noise * rng.normal(size=n_modes))))
    return cases


@pytest.mark.long
@pytest.mark.parametrize(
    ("truth", "name", "value"),
    [
        (with_joint_factor(ROBOT, "3", 0.6), "joint 3 stiffness", 0.6),
        (with_joint_factor(ROBOT, "5", 1.8), "joint 5 stiffness", 1.8),
        (with_payload(ROBOT, 8.0), "payload", 8.0),
        (with_link_factor(ROBOT, 0.3), "links", 0.3),
    ],
    ids=["joint 3", "joint 5", "payload", "links"],
)
def test_the_cause_is_found_with_its_size(truth: SpatialRobot, name: str, value: float) -> None:
    causes = explain_frequencies(ROBOT, _found(truth, POSTURES, 0.002), 0.002)
    assert causes[0].name == name
    assert causes[0].parameter == pytest.approx(value, abs=4 * causes[0].standard_error)
    assert causes[0].chi_square < 2 * causes[0].n_data
    assert [cause.name for cause in equivalent_causes(causes)] == [name]


@pytest.mark.long
def test_a_right_model_needs_no_cause() -> None:
    causes = explain_frequencies(ROBOT, _found(ROBOT, POSTURES[:2], 0.002), 0.002)
    assert "as modelled" in {cause.name for cause in equivalent_causes(causes)}


def test_one_mode_in_one_posture_tells_nothing_apart() -> None:
    result = _found(with_joint_factor(ROBOT, "3", 0.9), POSTURES[:1], n_modes=1)
    assert len(equivalent_causes(explain_frequencies(ROBOT, result, 0.005))) >= 3
    with pytest.raises(InputError, match="0 frequencies"):
        explain_frequencies(ROBOT, [])


def test_rigid_links_are_the_limit_of_stiff_ones() -> None:
    """Mass and inertia are kept; frequencies rise when links stop giving way, and tend to those of rigid ones."""
    rigid = modes_at(with_rigid_links(ROBOT), POSTURES[1]).frequencies
    assert len(rigid) == 6
    soft, stiff = (modes_at(with_link_factor(ROBOT, f), POSTURES[1]).frequencies[:6] for f in (1.0, 1e5))
    assert np.all(rigid > soft)
    assert stiff == pytest.approx(rigid, rel=1e-5)


def test_changes_say_what_they_cannot() -> None:
    with pytest.raises(InputError, match="no joint at frame '9'"):
        with_joint_factor(ROBOT, "9", 2.0)
    with pytest.raises(InputError, match="payload"):
        with_payload(ROBOT, -1.0)
    heavier = modes_at(with_payload(ROBOT, 5.0, np.array([0.0, 0.0, -0.1])), POSTURES[0]).frequencies[0]
    assert heavier < modes_at(replace(ROBOT), POSTURES[0]).frequencies[0]
