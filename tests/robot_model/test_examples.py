"""Every example of the robot models runs, on a small scale, and shows what its page says."""

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

FOLDER = Path(__file__).resolve().parents[2] / "examples"


def load(name: str) -> ModuleType:
    """An example as a module."""
    specification = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def test_posture_map() -> None:
    example = load("robot_posture_map")
    limits = example.over_redundancy(example.read_spatial_robot("staubli_rx170").robot, np.array([-30.0, 0.0]))
    assert limits[0] > 3e-3 > limits[1]


def test_planar_disagreement() -> None:
    """No explanation in the plane meets the measured frequencies; a sideways swing with two numbers is nearer."""
    example = load("robot_planar_disagreement")
    swing, column = example.sideways()
    off = np.sqrt(np.mean((np.array(swing) / [15.5, 13.6, 10.0] - 1) ** 2))
    assert off == pytest.approx(0.025, abs=0.002)
    assert column > 0
    outcome = example.explain(("stiffness",), search=False)
    assert outcome.deviation > 5
    assert np.all(np.array(example.with_links_as_assumed()) < [11.96, 11.79, 11.40])


def test_stiffness_identification() -> None:
    trial = load("robot_stiffness_identification").trial(count=40)
    assert np.abs(trial.pulls).max() < 3.5
    assert trial.verification.max() < 0.15e-3  # the paper's mean, on the real robot
    assert trial.verification.mean() < 0.02 * trial.deflections.mean()


def test_path_compensation() -> None:
    outcome = load("robot_path_compensation").run(points=10)
    assert outcome.corrected.mean() < 0.25 * outcome.without.mean()
