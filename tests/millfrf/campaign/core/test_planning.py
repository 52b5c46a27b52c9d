"""What is planned: labels from every source, sets, parts, the tree of sums, keys, and the dry run."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from millfrf.campaign.campaign_tables import EstimateTable
from millfrf.campaign.labels import Labels, joined_labels, labels_of_setup, read_label_table
from millfrf.campaign.opened import longest_chain
from millfrf.campaign.planning import estimate_tasks
from millfrf.campaign.progress import ProgressLines, measured_rates, note_time
from millfrf.campaign.recordings import FileLook, FoundRecording, without_copies
from millfrf.campaign.run_folder import PROGRAM, only_run
from millfrf.campaign.running import DONE, REFUSED, Ended, left_to_run
from millfrf.campaign.tasks import RecordingSet, Task, grouped, in_order, keys_of
from millfrf.command_line import run
from millfrf.core import InputError


def recording(name: str, seconds: float = 60.0, **values: str | float) -> FoundRecording:
    look = FileLook(1, 1, "ab", streams=(("main", int(seconds * 512), 512.0),))
    return FoundRecording(name, Path(f"/data/{name}.h5"), Labels(values), look, 1e9)


def test_labels_come_from_setup_name_and_table(tmp_path: Path) -> None:
    setup = '[robot]\npose = "P07"\nposture_deg = [1.0, 2.0]\n[conditions]\ntemperature_c = 21\n'
    keys = {"pose": "robot.pose", "posture_deg": "robot.posture_deg", "temperature_c": "conditions.temperature_c"}
    (tmp_path / "t.csv").write_text('file,level,posture_deg\na.h5,0.5,"1,2"\nb.h5,,\n')
    table = read_label_table(tmp_path / "t.csv")
    result = joined_labels([table["a.h5"], labels_of_setup(setup, {**keys, "tool": "tool.name"})])
    assert result == Labels({"level": 0.5, "pose": "P07", "temperature_c": 21.0}, (1.0, 2.0))
    assert table["b.h5"] == {}
    with pytest.raises(InputError, match="label pose is 'P07' and 'P08'; state it once"):
        joined_labels([{"pose": "P07"}, {"pose": "P08"}])
    with pytest.raises(InputError, match=r"its setup has robot = \{.*which is no label"):
        labels_of_setup(setup, {"robot": "robot"})


def test_sets_share_labels_and_average_numbers() -> None:
    members = [
        recording("b", pose="P1", session=2.0, temperature_c=20.0, immersion="up"),
        recording("a", pose="P1", session=2.0, temperature_c=22.0, immersion="down"),
        recording("c", pose="P1", session=1.0),
        recording("d", session=1.0),
    ]
    sets, lacking = grouped(members, ["pose", "session"])
    assert [each.name for each in sets] == ["P1 session=1", "P1 session=2"]
    assert sets[1].labels == {"pose": "P1", "session": 2.0, "temperature_c": 21.0}
    assert [each.name for each in lacking] == ["d"]
    assert [each.name for each in grouped(members, [])[0]] == ["b", "a", "c", "d"]


def test_copies_count_once_or_not_at_all() -> None:
    alike = [recording("a", pose="P1"), recording("b", pose="P1"), recording("c", pose="P2"), recording("d", pose="P3")]
    same = without_copies(alike[:2], {"a": "1", "b": "1"})
    assert [each.fault for each in same] == ["", "b.h5 is the same recording as a.h5; give each test once"]
    other = without_copies(alike, {"a": "1", "b": "2", "c": "1", "d": ""})
    assert [each.fault.split(";")[0] for each in other] == [
        "a.h5 is the same recording as c.h5",
        "",
        "c.h5 is the same recording as a.h5",
        "",
    ]


@pytest.mark.parametrize("count", [1, 8, 9, 64, 65, 200])
def test_sums_are_a_tree_in_which_each_recording_counts_once(count: int) -> None:
    members = tuple(recording(f"r{number}") for number in range(count))
    tasks = list(estimate_tasks(RecordingSet("s", members, {}, None), EstimateTable()))
    by_name = {task.identity: task for task in tasks}

    def leaves(identity: str) -> list[str]:
        task = by_name[identity]
        return [identity] if task.kind == "spectra" else [leaf for need in task.needs for leaf in leaves(need)]

    last = [need for need in by_name["estimate:s"].needs if not need.startswith("check:")]
    assert len(last) <= 8
    assert all(len(task.needs) <= 8 for task in tasks if task.kind == "sum")
    assert sorted(leaf for each in last for leaf in leaves(each)) == sorted(f"spectra:{each.name}" for each in members)


def test_a_long_recording_is_split_at_segments_without_gap() -> None:
    each = RecordingSet("s", (recording("long", 4000.0),), {}, None)
    tasks = list(estimate_tasks(each, EstimateTable(segment_s=8.0, part_s=900.0)))
    parts = [task.settings["segments"] for task in tasks if task.kind == "spectra"]
    assert len(parts) == 4
    assert parts[0][0] == 0
    assert parts[-1][1] == (4000 * 512 - 4096) // 2048 + 1
    assert all(each[1] == other[0] for each, other in pairwise(parts))
    whole = list(estimate_tasks(each, EstimateTable(segment_s=8.0, part_s=900.0, exclude=True)))
    assert [task.settings["segments"] for task in whole if task.kind == "spectra"] == [None]


def chain(**changed: Any) -> dict[str, Task]:
    settings = {"fit": {"band_hz": [8.0, 60.0]}, **changed}
    return in_order(
        [
            Task("check", "a", ("/x/a.h5",)),
            Task("check", "b", ("/x/b.h5",)),
            Task("fit", "a", (), ("check:a",), settings["fit"]),
            Task("fit", "b", (), ("check:b",), settings["fit"]),
            Task("learn", "all", (), ("fit:a", "fit:b")),
        ]
    )


def test_a_key_hangs_on_all_that_a_result_is_made_from() -> None:
    before = keys_of(chain(), {"/x/a.h5": "1", "/x/b.h5": "2"}, "v1")
    moved = keys_of(chain(), {"/x/a.h5": "9", "/x/b.h5": "2"}, "v1")
    assert {name for name in before if before[name] != moved[name]} == {"check:a", "fit:a", "learn:all"}
    other = keys_of(chain(fit={"band_hz": [9.0, 60.0]}), {"/x/a.h5": "1", "/x/b.h5": "2"}, "v1")
    assert {name for name in before if before[name] != other[name]} == {"fit:a", "fit:b", "learn:all"}
    newer = keys_of(chain(), {"/x/a.h5": "1", "/x/b.h5": "2"}, "v2")
    assert not set(before.values()) & set(newer.values())
    unknown = keys_of(chain(), {"/x/a.h5": "", "/x/b.h5": "2"}, "v1")
    assert {name for name, key in unknown.items() if key is None} == {"check:a", "fit:a", "learn:all"}


def test_what_only_others_read_is_made_only_for_them() -> None:
    tasks = in_order([Task("spectra", "a"), Task("estimate", "a", needs=("spectra:a",)), Task("fit", "a")])
    assert left_to_run(tasks, {"estimate:a": "done", "fit:a": "done"}) == []
    assert left_to_run(tasks, {"fit:a": "done"}) == ["spectra:a", "estimate:a"]
    assert longest_chain(tasks, {"spectra:a": 2.0, "estimate:a": 3.0, "fit:a": 4.0}) == 5.0


def test_a_dry_run_tells_the_graph_and_writes_nothing(campaign: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert run(["campaign", str(campaign), "--dry-run"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    for words in ("check 7 0 files", "spectra 13 0 check", "join 6 0 spectra", "lobes 2 0 calibrate"):
        assert words in said
    assert "7 recordings, 2 sets, 34 tasks and the report; 34 to run" in said
    assert "default rates, which may be wrong" in said
    assert not (campaign.parent / "campaign_results").exists()


def test_a_dry_run_tells_that_another_version_made_the_results(
    campaign: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = campaign.parent / "campaign_results"
    with only_run(out):
        pass
    words = "has changed since the last run: all results will be computed again"
    assert run(["campaign", str(campaign), "--dry-run"]) == 0
    assert words not in capsys.readouterr().out
    (out / PROGRAM).write_text("that of last year")
    assert run(["campaign", str(campaign), "--dry-run"]) == 0
    assert words in capsys.readouterr().out


def test_time_left_counts_each_kind_at_its_own_pace() -> None:
    lines = ProgressLines({"check:a": 1.0, "check:b": 1.0, "fit:a": 100.0, "fit:b": 100.0})
    lines.ended(Ended("check:a", DONE, "", 10.0))
    assert "1 of 4 tasks" in lines.line(1)
    assert lines.line(1).endswith("about 10 s left without these; time of fit not known yet")
    lines.ended(Ended("fit:a", DONE, "", 10.0))
    assert lines.line(2).endswith("about 10 s left")
    lines.ended(Ended("check:b", REFUSED, "no", 0.1))
    assert "1 refused" in lines.line(1)
    assert lines.line(0).endswith("no worker is connected; waiting")
    lines = ProgressLines({"check:a": 1.0, "learn:all": 30.0, "report:all": 20.0})
    lines.ended(Ended("check:a", DONE, "", 1.0))
    assert lines.line(1).endswith("/s, 0 refused, time of learn, report not known yet")
    measured = ProgressLines({"check:a": 1.0, "learn:all": 600.0}, frozenset({"learn"}))
    measured.ended(Ended("check:a", DONE, "", 1.0))
    assert measured.line(2).endswith("about 5 min left")


def test_rates_are_measured_by_earlier_runs(tmp_path: Path) -> None:
    before = measured_rates(tmp_path)
    assert not before.measured
    note_time(tmp_path, Ended("fit:a", DONE, "", 30.0), 2.0)
    note_time(tmp_path, Ended("fit:b", REFUSED, "no pole", 500.0), 2.0)
    after = measured_rates(tmp_path)
    assert after.measured == {"fit"}
    assert after.seconds(Task("fit", "c"), 2.0) == pytest.approx(30.0)
    assert after.seconds(Task("lobes", "c"), 0.0) == before.seconds(Task("lobes", "c"), 0.0)
