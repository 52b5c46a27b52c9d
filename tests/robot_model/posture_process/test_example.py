"""The example of learned postures tells what its page says."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))  # examples are no installed package

from examples.robot_learned_postures import HIGH, LOW, draw, learned_postures, movement
from millfrf.robot_model import read_spatial_robot


@pytest.mark.long
def test_the_band_holds_the_movement_and_grows_beyond_the_measured_range(tmp_path: Path) -> None:
    robot = read_spatial_robot("kuka_kr90_r3100").robot
    learned = learned_postures(robot)
    found = movement(robot, learned, 9)
    inside = (found.angles > LOW[1]) & (found.angles < HIGH[1])
    errors = [np.abs(one / found.true - 1)[inside].max() for one in (found.modelled, found.predicted)]
    assert errors[1] < 0.2 * errors[0]
    assert np.mean((found.band[0] <= found.true) & (found.true <= found.band[1])) >= 0.9
    width = (found.band[1] - found.band[0]) / found.predicted
    assert width[~inside].mean() > 1.5 * width[inside].mean()
    draw(tmp_path / "movement.png", found, learned)
    assert (tmp_path / "movement.png").stat().st_size > 20_000
