"""The whole summary: table and report of sets whose truth is known."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from millfrf.campaign.results.sets import MeasuredSet
from millfrf.campaign.results.summary import write_summary
from millfrf.core.provenance import read_provenance, sha256

ERRORS = np.array([[0.01, 0.001], [0.02, 0.001], [0.03, 0.001]])


def _filled(campaign: Any, modelled: Any, shapes: Any) -> list[MeasuredSet]:
    for pose in ("P01", "P02"):
        for session in (1.0, 2.0, 3.0):
            model = modelled([10.0, 16.0, 30.0], [0.03, 0.02, 0.02], shapes, ERRORS)
            campaign.add(
                {"pose": pose, "session": session},
                model,
                recorded_at=1.7e9 + 86400 * session,
                depths=[2e-3, 1e-3, np.inf],
            )
    campaign.add({"pose": "P03", "session": 1.0}, None, failures=("P03_1.h5: the file is cut off; record again",))
    return campaign.sets


def test_the_table_holds_every_mode_of_every_set(campaign: Any, modelled: Any, shapes: Any, tmp_path: Path) -> None:
    sets = _filled(campaign, modelled, shapes)
    write_summary(tmp_path, "Hall 3", sets, robot=None, learned=None, failures=())
    frame = pd.read_csv(tmp_path / "modes.csv")
    assert len(frame) == 6 * 3 + 1
    first = frame[(frame["set"] == "P01 session=2") & (frame["mode_of_set"] == 2)].iloc[0]
    assert first["frequency_hz"] == pytest.approx(16.0)
    assert first["frequency_standard_error_hz"] == pytest.approx(0.02)
    assert first["damping_ratio"] == pytest.approx(0.02)
    assert first["depth_limit_m"] == pytest.approx(1e-3)
    assert first["depth_limit_speed_rpm"] == pytest.approx(150 * 30 / np.pi)
    assert first["recorded_at"] == "2023-11-16T22:13:20Z"
    assert frame[frame["pose"] == "P03"]["failures"].item() == "P03_1.h5: the file is cut off; record again"


@pytest.mark.long
def test_parquet_and_csv_hold_the_same(campaign: Any, modelled: Any, shapes: Any, tmp_path: Path) -> None:
    sets = _filled(campaign, modelled, shapes)
    write_summary(tmp_path, "Hall 3", sets, robot=None, learned=None, failures=())
    text = pd.read_csv(tmp_path / "modes.csv", keep_default_na=False, na_values={"mode": ""})
    binary = pd.read_parquet(tmp_path / "modes.parquet")
    assert list(text.columns) == list(binary.columns)
    for name in ("set", "pose", "failures", "verdict"):
        assert list(text[name]) == list(binary[name])
    numbers = pd.read_csv(tmp_path / "modes.csv")["frequency_hz"]
    assert np.allclose(numbers, binary["frequency_hz"].astype(float), rtol=1e-9, equal_nan=True)


def test_the_table_states_its_sources(campaign: Any, modelled: Any, shapes: Any, tmp_path: Path) -> None:
    sets = _filled(campaign, modelled, shapes)
    write_summary(tmp_path, "Hall 3", sets, robot=None, learned=None, failures=())
    stated = read_provenance(tmp_path / "modes.csv")
    assert sets[0].model is not None
    assert sha256(sets[0].model) in {each["sha256"] for each in stated["sources"]}


@pytest.mark.long
def test_equal_input_gives_equal_bytes_in_any_order(campaign: Any, modelled: Any, shapes: Any, tmp_path: Path) -> None:
    sets = _filled(campaign, modelled, shapes)
    folders = tmp_path / "one", tmp_path / "two"
    for folder, ordered in zip(folders, (sets, sets[::-1]), strict=True):
        folder.mkdir()
        write_summary(folder, "Hall 3", ordered, robot=None, learned=None, failures=("a.h5: broken",))
    names = sorted(path.name for path in folders[0].iterdir())
    assert names == sorted(path.name for path in folders[1].iterdir())
    assert all((folders[0] / name).read_bytes() == (folders[1] / name).read_bytes() for name in names)


def test_a_model_that_cannot_be_read_is_a_failure_of_its_set_alone(
    campaign: Any, modelled: Any, shapes: Any, tmp_path: Path
) -> None:
    sets = _filled(campaign, modelled, shapes)
    assert sets[1].model is not None
    sets[1].model.write_text("{")
    write_summary(tmp_path, "Hall 3", sets, robot=None, learned=None, failures=())
    frame = pd.read_csv(tmp_path / "modes.csv")
    assert "is not JSON" in frame[frame["set"] == "P01 session=2"]["failures"].item()
    assert len(frame) == 5 * 3 + 2


def test_a_campaign_in_which_everything_failed_says_so(campaign: Any, tmp_path: Path) -> None:
    campaign.add({"pose": "P01"}, None, failures=("P01.h5: no samples; record again",))
    write_summary(tmp_path, "Hall 3", campaign.sets, robot=None, learned=None, failures=())
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "P01.h5: no samples; record again" in page
    assert len(pd.read_csv(tmp_path / "modes.csv")) == 1
    assert len(pd.read_parquet(tmp_path / "modes.parquet")) == 1


def test_a_failure_that_campaign_and_set_both_tell_stands_once(
    campaign: Any, modelled: Any, shapes: Any, tmp_path: Path
) -> None:
    campaign.add({"pose": "P01"}, None, failures=("check of P01_1: P01_1.h5 is cut off",))
    verdict = write_summary(
        tmp_path, "Hall 3", campaign.sets, robot=None, learned=None, failures=("check P01_1: P01_1.h5 is cut off",)
    )
    assert [line for line in verdict if "P01_1.h5" in line] == ["Failed: P01: check P01_1: P01_1.h5 is cut off"]
