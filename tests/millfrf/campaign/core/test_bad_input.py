"""What is wrong with a campaign is one line that names it, before anything is computed."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from millfrf.campaign import on_dask as worker_checks
from millfrf.campaign.campaign_run import RunOptions, run_campaign
from millfrf.campaign.tasks import Task, in_order
from millfrf.command_line import run
from millfrf.core import InputError


def rename(folder: Path) -> None:
    (folder / "more").mkdir()
    (folder / "more" / "P1_up.h5").write_bytes((folder / "recordings" / "P1_up.h5").read_bytes())


def clash(folder: Path) -> None:
    for number, words in enumerate(("A,B C", "A B,C")):
        text = f"file,tool,pose\nrecordings/{('P1_up', 'P2_up')[number]}.h5,{words}\n"
        (folder / f"table{number}.csv").write_text(text)


def nothing(folder: Path) -> None:
    del folder


TABLES = '[[recordings]]\ntable = "table0.csv"\n[[recordings]]\ntable = "table1.csv"\n[sets]\nby = ["tool", "pose"]'
MISTAKES: dict[str, tuple[Callable[[Path], Any], tuple[str, str], str]] = {
    "no file": (nothing, ('"recordings/*.h5"', '"recordings/*.hdf"'), "no file recordings/*.hdf in"),
    "two of one name": (
        rename,
        ('"recordings/*.h5"', '"recordings/*.h5", "more/*.h5"'),
        "two recordings have the name P1_up: recordings/P1_up.h5 and more/P1_up.h5; rename one",
    ),
    "a cycle": (
        lambda folder: (folder / "out").mkdir() or (folder / "recordings" / "P1_up.h5").rename(folder / "out" / "a.h5"),
        ('"recordings/*.h5"', '"*/*.h5"'),
        "cannot be its own input (a cycle)",
    ),
    "no such label": (
        nothing,
        ('by = ["pose"]', 'by = ["posture"]'),
        "no recording has the label posture; they have immersion, pose",
    ),
    "no such key": (nothing, ("part_s", "parts_s"), "estimate.parts_s is not a known key; did you mean part_s?"),
    "no tap": (nothing, ('"frf_tip.h5"', '"tip.h5"'), "no file tip.h5 in"),
    "an empty band": (nothing, ("[13.0, 30.0]", "[30.0, 13.0]"), "band_hz [30, 13] is empty"),
    "no pattern": (nothing, ("(?P<pose>", "(?P<pose"), "is no regular expression"),
    "no such robot": (nothing, ('title = "Two poses"', 'robot = "my.toml"'), "no robot file my.toml in"),
    "no such method": (nothing, ('"zero-order"', '"best"'), "lobes.method must be 'certified', 'zero-order'"),
    "learning without a robot": (nothing, ("[report]", "[learn]"), "[learn] needs a robot; add robot ="),
    "a table without its file": (
        lambda folder: (folder / "t.csv").write_text("file,pose\nrecordings/P9.h5,P9\n"),
        ("[sets]", 'table = "t.csv"\n[sets]'),
        "table t.csv names recordings/P9.h5, which does not exist; correct the name",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_one_line(mistake: str, campaign: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spoil, (old, new), words = MISTAKES[mistake]
    spoil(campaign.parent)
    text = campaign.read_text()
    assert old in text
    campaign.write_text(text.replace(old, new, 1))
    capsys.readouterr()
    assert run(["campaign", str(campaign), "--workers", "0", "--out", str(campaign.parent / "out")]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
    assert not (campaign.parent / "out" / "results").exists()


def test_two_sets_of_one_name_are_refused(campaign: Path) -> None:
    clash(campaign.parent)
    head, _, tail = campaign.read_text().partition("[[recordings]]")
    campaign.write_text(f"{head}{TABLES}\n{tail[tail.index('[estimate]') :]}")
    with pytest.raises(InputError, match=r"two sets have the name A B C: that of P1_up.h5 and that of P2_up.h5"):
        run_campaign(campaign, RunOptions(campaign.parent / "out", workers=0))


def test_no_scheduler_answers(campaign: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from millfrf.campaign import on_dask

    monkeypatch.setattr(on_dask, "CONNECT_SECONDS", 1.0)
    with pytest.raises(InputError, match=r"no scheduler answers at tcp://127.0.0.1:9 within 1 s; check the address"):
        run_campaign(campaign, RunOptions(campaign.parent / "out", scheduler="tcp://127.0.0.1:9"))


def test_planned_tasks_cannot_need_each_other_or_share_a_name() -> None:
    with pytest.raises(InputError, match=r"tasks need each other: \w:1 needs \w:1 needs \w:1 needs \w:1; take one"):
        in_order([Task("a", "1", needs=("b:1",)), Task("b", "1", needs=("c:1",)), Task("c", "1", needs=("a:1",))])
    with pytest.raises(InputError, match="two tasks have the name a:1"):
        in_order([Task("a", "1"), Task("a", "1")])
    with pytest.raises(InputError, match="needs b:1, which is no task"):
        in_order([Task("a", "1", needs=("b:1",))])


class Client:
    """Stands for a client whose one worker answers as this process would, but for what is changed."""

    def __init__(self, threads: int = 1, **changed: Any) -> None:
        self._threads, self._changed = threads, changed

    def wait_for_workers(self, number: int, timeout: float) -> None:
        if self._changed.get("none"):
            raise TimeoutError

    def nthreads(self) -> dict[str, int]:
        return {"tcp://10.0.0.7:4000": self._threads}

    def run(self, function: Callable[..., Any], *given: Any, on_error: str) -> dict[str, Any]:
        folder = self._changed.get("sees")
        answer = function(*(given if folder is None else (folder, *given[1:])))
        fault = self._changed.get("raises")
        return {"tcp://10.0.0.7:4000": fault or {**answer, **self._changed}}


WORKERS: dict[str, tuple[dict[str, Any], str]] = {
    "none": ({"none": True}, "has no worker after 30 s; start some with 'dask worker tcp://s:1 --nthreads 1'"),
    "another program": ({"program": "abc"}, "has another version of millfrf or of its libraries"),
    "another python": ({"python": "3.9.1"}, "has python 3.9.1, this computer 3."),
    "another dask": ({"distributed": "2020.1"}, "has distributed 2020.1, this computer"),
    "no millfrf": ({"raises": ModuleNotFoundError("No module named 'millfrf'")}, "cannot run this version of millfrf"),
    "another folder": ({"sees": "/nowhere/at/all"}, "does not see the folder"),
    "no right to write": ({"writes": "Permission denied"}, "cannot write into"),
    "no recordings": ({"sees_probe": False}, "put recordings on a disk that all machines share"),
    "threads": ({"threads": 4}, "has 4 threads; start it with --nthreads 1"),
}


@pytest.mark.parametrize("case", WORKERS)
def test_workers_that_would_give_other_results_get_no_work(case: str, tmp_path: Path) -> None:
    changed, words = WORKERS[case]
    (tmp_path / "a.h5").write_text("a")
    client = Client(changed["threads"]) if "threads" in changed else Client(**changed)
    with pytest.raises(InputError) as refused:
        worker_checks.check_workers(client, tmp_path, tmp_path / "a.h5", "tcp://s:1")
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)
    assert [each.name for each in tmp_path.iterdir()] == ["a.h5"]


def test_a_worker_as_this_process_is_accepted(tmp_path: Path) -> None:
    (tmp_path / "a.h5").write_text("a")
    worker_checks.check_workers(Client(), tmp_path, tmp_path / "a.h5", None)


def test_a_second_run_at_the_same_time_is_refused(campaign: Path) -> None:
    from millfrf.campaign.run_folder import only_run

    with only_run(campaign.parent / "out"), pytest.raises(InputError, match="another run uses"):
        run_campaign(campaign, RunOptions(campaign.parent / "out", workers=0))


def test_a_folder_with_files_of_no_campaign_is_refused(campaign: Path) -> None:
    out = campaign.parent / "mine"
    out.mkdir()
    (out / "report.html").write_text("mine")
    with pytest.raises(
        InputError, match=r"report\.html exists, and no campaign has written this folder; name another folder"
    ):
        run_campaign(campaign, RunOptions(out, workers=0))
    assert [(path.name, path.read_text()) for path in out.iterdir()] == [("report.html", "mine")]


def test_without_dask_the_extra_is_named(campaign: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"needs? Dask, which is not installed: pip install 'millfrf\[cluster\]'"):
        run_campaign(campaign, RunOptions(campaign.parent / "out", workers=1))
