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
    result = movement(robot, learned, 9)
    inside = (result.angles > LOW[1]) & (result.angles < HIGH[1])
    errors = [np.abs(each / result.true - 1)[inside].max() for each in (result.modelled, result.predicted)]
    assert errors[1] < 0.2 * errors[0]
    assert np.mean((result.band[0] <= result.true) & (result.true <= result.band[1])) >= 0.9
    width = (result.band[1] - result.band[0]) / result.predicted
    assert width[~inside].mean() > 1.5 * width[inside].mean()
    draw(tmp_path / "movement.png", result, learned)
    assert (tmp_path / "movement.png").stat().st_size > 20_000
