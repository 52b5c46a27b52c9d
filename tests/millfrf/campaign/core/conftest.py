"""A small campaign: two poses of three immersions from the simulated cell, and one file that is no recording."""

import importlib.util
from collections.abc import Callable
from pathlib import Path

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
    """Good files of every kind."""
    folder = tmp_path_factory.mktemp("good")
    good_files.make(folder)
    return folder


@pytest.fixture
def campaign(good: Path, tmp_path: Path) -> Path:
    """The campaign's file in a folder with all that it names."""
    make_campaign(good, tmp_path / "campaign")
    return tmp_path / "campaign" / "campaign.toml"


def make_campaign(good: Path, folder: Path) -> None:
    """Write the campaign into a folder."""
    (folder / "recordings").mkdir(parents=True)
    for pose in ("P1", "P2"):
        for immersion in ("up", "down", "central"):
            target = folder / "recordings" / f"{pose}_{immersion}.h5"
            target.write_bytes((good / f"{immersion}.h5").read_bytes())
    (folder / "recordings" / "P2_broken.h5").write_text("no recording")
    for name in ("cut.toml", "frf_tip.h5", "frf_housing.h5", "model_tip.json"):
        (folder / name).write_bytes((good / name).read_bytes())
    (folder / "campaign.toml").write_text(CAMPAIGN, encoding="utf-8")


@pytest.fixture(scope="session")
def maker(good: Path) -> Callable[[Path], Path]:
    """Makes the campaign in a folder and returns its file."""

    def make(folder: Path) -> Path:
        make_campaign(good, folder)
        return folder / "campaign.toml"

    return make
