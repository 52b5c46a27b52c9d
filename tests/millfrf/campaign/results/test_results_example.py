"""The example of a campaign's report: it finds the drift that it was made with, and names the outlying set."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from millfrf.campaign.results.summary import write_summary
from millfrf.robot_model import read_spatial_robot

EXAMPLE = Path(__file__).resolve().parents[4] / "examples" / "campaign_results.py"


@pytest.fixture
def example() -> ModuleType:
    spec = importlib.util.spec_from_file_location("campaign_results_example", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.long
def test_drift_and_loose_table_are_found(example: ModuleType, tmp_path: Path) -> None:
    files = tmp_path / "sets"
    files.mkdir()
    sets, models = example.measured_sets(files, read_spatial_robot(example.ROBOT).robot)
    assert len(sets) == len(models) == example.POSES * example.SESSIONS
    verdict = write_summary(tmp_path, "made", sets, robot=example.ROBOT, learned=None, failures=())
    poses = [line for line in verdict if line.startswith("Drift: pose")]
    assert len(poses) == 1
    assert f"pose {example.DRIFT}: mode 1" in poses[0]
    assert "the other poses do not" in poses[0]
    warm = [line for line in verdict if line.startswith("Drift: all poses")]
    assert warm
    assert all("damping" in line and "temperature" in line for line in warm)
    [off] = [line for line in verdict if line.startswith("Outlier: ")]
    assert off.startswith("Outlier: {} session={}".format(*example.UNCLAMPED))
    assert np.isfinite([model.natural_frequencies.min() for model in models]).all()
