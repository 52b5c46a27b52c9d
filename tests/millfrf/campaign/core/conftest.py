"""A small campaign: two poses of three immersions from the simulated cell, and one file that is no recording."""

import importlib.util
import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import pytest

_SPEC = importlib.util.spec_from_file_location(
    "good_files_of_campaigns", Path(__file__).parents[2] / "mistakes" / "good_files.py"
)
assert _SPEC is not None
assert _SPEC.loader is not None
good_files = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(good_files)

CAMPAIGN = """[campaign]
title = "Two poses"
[[recordings]]
files = ["recordings/*.h5"]
pattern = "(?P<pose>P\\\\d+)_(?P<immersion>[a-z]+)"
[sets]
by = ["pose"]
[estimate]
segment = 4.0
part_s = 10.0
[fit]
band_hz = [13.0, 30.0]
[calibrate]
tip = "frf_tip.h5"
sensor = "frf_housing.h5"
[lobes]
cutting = "cut.toml"
speeds_rpm = [600, 1200, 4]
max_depth_m = 0.01
method = "zero-order"
[report]
"""


@pytest.fixture(scope="session")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The campaign in a folder, from which each test takes its own copy."""
    files, folder = tmp_path_factory.mktemp("good"), tmp_path_factory.mktemp("made") / "campaign"
    good_files.make(files)
    (folder / "recordings").mkdir(parents=True)
    for pose in ("P1", "P2"):
        for immersion in ("up", "down", "central"):
            target = folder / "recordings" / f"{pose}_{immersion}.h5"
            target.write_bytes((files / f"{immersion}.h5").read_bytes())
            with h5py.File(target, "r+") as file:
                file.attrs["title"] = pose  # else they were copies of each other
                file.attrs["format_version"] = 2  # as another program writes it: without a copy of the texts
    (folder / "recordings" / "P2_broken.h5").write_text("no recording")
    for name in ("cut.toml", "frf_tip.h5", "frf_housing.h5", "model_tip.json"):
        (folder / name).write_bytes((files / name).read_bytes())
    (folder / "campaign.toml").write_text(CAMPAIGN, encoding="utf-8")
    return folder


@pytest.fixture
def campaign(good: Path, tmp_path: Path) -> Path:
    """The campaign's file in a folder with all that it names."""
    return Path(shutil.copytree(good, tmp_path / "campaign")) / "campaign.toml"


@pytest.fixture(scope="session")
def maker(good: Path) -> Callable[[Path], Path]:
    """Makes the campaign in a folder and returns its file."""
    return lambda folder: Path(shutil.copytree(good, folder)) / "campaign.toml"
