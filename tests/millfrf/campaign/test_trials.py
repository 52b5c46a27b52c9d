"""The trials of docs/campaigns.md in small: killed runs, postures that were not measured, tasks with nothing to do."""

import json
import re
from pathlib import Path

import campaign_trial
import numpy as np
import pytest
from overhead_of_tasks import overhead_of
from unmeasured_postures import trial

from millfrf.campaign.simulated.make import SimulatedCampaign, make_campaign


@pytest.mark.slow
def test_runs_that_were_killed_end_with_the_same_bytes_and_list_every_broken_file(tmp_path: Path) -> None:
    made = tmp_path / "campaign"
    make_campaign(SimulatedCampaign(made, 36, 6, seed=1))
    text = (made / "campaign.toml").read_text()
    text = re.sub(r"^\[diagnose\]\n(?:[^\[\n].*\n|\n)*", "", text, flags=re.MULTILINE)
    (made / "trial.toml").write_text(text)
    whole, one_worker, resumed = (tmp_path / name for name in ("whole", "one_worker", "resumed"))
    campaign_trial.undisturbed(made / "trial.toml", whole, 2)
    count = campaign_trial.results(whole)
    campaign_trial.with_a_worker_killed(made / "trial.toml", one_worker, 4, count // 3)
    campaign_trial.killed_and_resumed(made / "trial.toml", resumed, 2, count // 2)
    assert len(campaign_trial.files_of(whole)) > 50
    assert campaign_trial.differing(whole, one_worker) == []
    assert campaign_trial.differing(whole, resumed) == []
    truth = json.loads((made / "concealed.json").read_text())
    stated = (whole / "failures.csv").read_text() + (whole / "summary" / "report.html").read_text()
    missed = [each for each in truth["broken"] if Path(each["file"]).stem not in stated]
    assert missed == []


@pytest.mark.slow
def test_bands_of_postures_that_were_not_measured_hold_the_truth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MILLFRF_TRIALS", str(tmp_path))
    rows = trial(seed=7, poses=12, new=12, left_out=0, sessions=1, limits=False)["new"]
    for quantity in ("frequency", "damping"):
        ends = np.array([row[2:] for row in rows if row[0] == quantity])
        assert len(ends) > 60
        assert np.mean((ends[:, 0] <= 0) & (ends[:, 1] >= 0)) >= 0.88
    errors = np.array([row[1] for row in rows if row[0] == "frequency"])
    assert np.sqrt(np.mean(errors**2)) < 0.02


@pytest.mark.slow
def test_a_task_with_nothing_to_do_costs_milliseconds_and_no_memory(tmp_path: Path) -> None:
    few, many = (overhead_of(count, 1, tmp_path / str(count)) for count in (200, 2000))
    assert many.tasks == 2000
    assert many.statuses == {"done"}
    assert many.scheduler_seconds / many.tasks < 0.02
    assert many.scheduler_bytes < few.scheduler_bytes + 60e6
    assert many.worker_bytes < few.worker_bytes + 60e6
